#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <vector>

#include "mesh_check_before.h"

namespace meshless {
namespace {

constexpr double kMaxPoints = 2000000;

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

template <class T>
T bigEndian(const char* at) {
  char bytes[sizeof(T)];
  std::reverse_copy(at, at + sizeof(T), bytes);  // every machine that ROS runs on is little-endian
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

template <class T>
void putBigEndian(std::string& out, T value) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof(T));
  std::reverse(bytes, bytes + sizeof(T));
  out.append(bytes, sizeof(T));
}

/// Lines, and blocks of numbers in text or binary.
class VtkText {
 public:
  explicit VtkText(std::string text) : text_(std::move(text)) {}

  bool line(std::string& line) {
    if (at_ >= text_.size()) return false;
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    line = text_.substr(at_, end - at_);
    if (!line.empty() && line.back() == '\r') line.pop_back();
    at_ = end + 1;
    return true;
  }
  /// Words of the next line that has any; empty at the end.
  std::vector<std::string> words() {
    std::vector<std::string> all;
    for (std::string next; all.empty() && line(next);) {
      std::istringstream in(lower(next.substr(0, 300)));
      all.assign(std::istream_iterator<std::string>(in), {});
    }
    return all;
  }
  /// false where the file ends first, or a number of text is none.
  bool numbers(bool binary, const std::string& type, double count, std::vector<double>& values) {
    values.clear();
    if (!(count >= 0.0) || !(count <= static_cast<double>(text_.size()))) return false;
    const std::size_t n = static_cast<std::size_t>(count);
    values.reserve(n);
    if (!binary) {
      const char* from = text_.c_str() + at_;
      for (std::size_t k = 0; k < n; ++k) {
        char* end = nullptr;
        values.push_back(std::strtod(from, &end));
        if (end == from) return false;
        from = end;
      }
      at_ = static_cast<std::size_t>(from - text_.c_str());
      return true;
    }
    const std::size_t size = type == "float" || type == "int" ? 4 : type == "double" || type == "vtktypeint64" ? 8 : 0;
    if (size == 0 || at_ > text_.size() || n * size > text_.size() - at_) return false;
    for (std::size_t k = 0; k < n; ++k, at_ += size) {
      const char* from = text_.data() + at_;
      if (type == "float") values.push_back(bigEndian<float>(from));
      if (type == "double") values.push_back(bigEndian<double>(from));
      if (type == "int") values.push_back(bigEndian<std::int32_t>(from));
      if (type == "vtktypeint64") values.push_back(static_cast<double>(bigEndian<std::int64_t>(from)));
    }
    return true;
  }

 private:
  std::string text_;
  std::size_t at_ = 0;
};

/// A whole number >= 0; NaN where it is none.
double count(const std::string& word) {
  if (word.empty() || !std::all_of(word.begin(), word.end(), [](unsigned char c) { return std::isdigit(c); }))
    return std::nan("");
  return std::strtod(word.c_str(), nullptr);
}

/// The cells as VTK wrote them before version 5: for each its size, then its corners. false where the block is damaged.
bool readCells(VtkText& text, bool binary, bool offsets, double n, double size, std::vector<double>& cells) {
  if (!offsets) return text.numbers(binary, "int", size, cells);
  cells.clear();
  std::vector<double> starts, corners;
  std::vector<std::string> head = text.words();
  if (head.size() != 2 || head[0] != "offsets" || !text.numbers(binary, head[1], n, starts)) return false;
  head = text.words();
  if (head.size() != 2 || head[0] != "connectivity" || !text.numbers(binary, head[1], size, corners)) return false;
  for (std::size_t k = 0; k + 1 < starts.size(); ++k) {
    const double from = starts[k], to = starts[k + 1];
    if (!(from >= 0.0 && to >= from && to <= size)) return false;
    cells.push_back(to - from);
    cells.insert(cells.end(), corners.begin() + static_cast<std::ptrdiff_t>(from),
                 corners.begin() + static_cast<std::ptrdiff_t>(to));
  }
  return true;
}

/// Number of cells; -1 where sizes or corners are not what they can be.
double checkCells(const std::vector<double>& cells, double points) {
  double found = 0.0;
  for (std::size_t at = 0; at < cells.size(); ++found) {
    const double size = cells[at++];
    if (!(size >= 1.0) || size != std::floor(size) || size > static_cast<double>(cells.size() - at)) return -1.0;
    for (double k = 0.0; k < size; ++k, ++at)
      if (!(cells[at] >= 0.0 && cells[at] < points) || cells[at] != std::floor(cells[at])) return -1.0;
  }
  return found;
}

}  // namespace

Result<std::string> plainVtk(const std::string& path, PromisedCounts& promised) {
  const std::string name = std::filesystem::path(path).filename().string();
  const auto unreadable = [&](const std::string& what) {
    return Error{ErrorCode::kUnreadable, "'" + name + "' " + what};
  };
  std::ifstream in(path, std::ios::binary);
  if (!in) return unreadable("cannot be opened");
  VtkText text(std::string(std::istreambuf_iterator<char>(in), {}));

  std::string version, title, format;
  text.line(version);
  const std::size_t version_at = lower(version).find("vtk datafile version");
  if (version_at == std::string::npos)
    return unreadable("is no legacy VTK file: it does not begin with '# vtk DataFile Version'");
  // From version 5 on, cells are two arrays, the first with one entry more than there are cells.
  const bool offsets = std::strtod(version.c_str() + version_at + 20, nullptr) >= 5.0;
  text.line(title);
  text.line(format);
  const bool binary = lower(format).find("binary") != std::string::npos;
  if (!binary && lower(format).find("ascii") == std::string::npos)
    return unreadable("is neither ASCII nor BINARY, or truncated");
  std::vector<std::string> words = text.words();
  if (words.size() != 2 || words[0] != "dataset" || words[1] != "polydata")
    return unreadable("is not a DATASET POLYDATA, or truncated; accepted: POLYDATA");

  std::vector<double> points, cells;
  double polygons = 0.0;
  bool has_points = false;
  while (!(words = text.words()).empty()) {
    if (words[0] == "point_data" || words[0] == "cell_data") break;  // no shape after it
    if (words[0] == "points") {
      const double n = words.size() == 3 ? count(words[1]) : std::nan("");
      if (n > kMaxPoints)
        return Error{ErrorCode::kUnsuitableShape,
                     "'" + name + "' has " + words[1].substr(0, 30) + " points; accepted: up to 2000000"};
      if (!text.numbers(binary, words.size() == 3 ? words[2] : "", 3.0 * n, points))
        return unreadable("is truncated or damaged in its POINTS (float or double)");
      has_points = true;
    } else if (words[0] == "polygons" || words[0] == "lines" || words[0] == "vertices") {
      std::vector<double> read;
      const double n = words.size() == 3 ? count(words[1]) : std::nan("");
      const double size = words.size() == 3 ? count(words[2]) : std::nan("");
      if (!has_points || !readCells(text, binary, offsets, n, size, read))
        return unreadable("is truncated or damaged in its " + words[0]);
      if (words[0] != "polygons") continue;
      polygons = checkCells(read, static_cast<double>(points.size() / 3));
      if (polygons < 0.0 || polygons != (offsets ? std::max(0.0, n - 1.0) : n))
        return unreadable(
            "has damaged polygons: their sizes and corners do not fit their number and that of the points");
      cells = std::move(read);
    } else if (words[0] == "triangle_strips") {
      return unreadable("has TRIANGLE_STRIPS; accepted: POLYGONS");
    }
  }
  if (!has_points) return unreadable("has no POINTS, or is truncated");
  if (points.empty()) return Error{ErrorCode::kUnsuitableShape, "'" + name + "' has no points"};

  promised.points = points.size() / 3;
  promised.faces = static_cast<std::size_t>(polygons);
  std::string plain = "# vtk DataFile Version 3.0\nplain\nBINARY\nDATASET POLYDATA\nPOINTS " +
                      std::to_string(points.size() / 3) + " double\n";
  for (double x : points) putBigEndian(plain, x);
  if (!cells.empty()) {
    plain += "\nPOLYGONS " + std::to_string(*promised.faces) + " " + std::to_string(cells.size()) + "\n";
    for (double k : cells) putBigEndian(plain, static_cast<std::int32_t>(k));
  }
  plain += "\n";
  return plain;
}

}  // namespace meshless
