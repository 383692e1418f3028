#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <type_traits>
#include <vector>

#include "mesh_check_before.h"
#include "text_words.h"

namespace meshless {
namespace {

constexpr std::size_t kMaxKeywords = 300;  // characters of a line with keywords that are looked at

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

/// A number as it is kept; as a whole one it is -1 where it is none that a cell may have.
template <class Number>
Number valueOf(double x) {
  if constexpr (std::is_same_v<Number, double>) return x;
  return x >= 0.0 && x <= static_cast<double>(kMaxCorners + kMaxFaces) && x == std::floor(x) ? static_cast<Number>(x)
                                                                                             : Number{-1};
}

/// Lines, and blocks of numbers in text or binary.
class VtkText {
 public:
  explicit VtkText(std::string_view text) : rest_(text) {}

  /// The start of the next line, in lower case; empty at the end.
  std::string line() {
    std::string_view next;
    return nextLine(rest_, next) ? lowerCase(next.substr(0, kMaxKeywords)) : std::string();
  }
  /// Words of the next line that has any; empty at the end.
  std::vector<std::string> words() {
    std::vector<std::string> all;
    while (all.empty() && !rest_.empty()) all = wordsOf(line());
    return all;
  }
  /// false where the file ends first, or a number of text is none.
  template <class Number>
  bool numbers(bool binary, const std::string& type, double count, std::vector<Number>& values) {
    values.clear();
    const std::size_t size = !binary                                      ? 2  // a digit and a blank
                             : type == "float" || type == "int"           ? 4
                             : type == "double" || type == "vtktypeint64" ? 8
                                                                          : 0;
    if (size == 0 || !(count >= 0.0) || !(count * static_cast<double>(size) <= static_cast<double>(rest_.size()) + 1.0))
      return false;
    const std::size_t n = static_cast<std::size_t>(count);
    if (binary && n * size > rest_.size()) return false;
    values.reserve(n);
    for (std::size_t k = 0; k < n; ++k) {
      if (!binary) {
        const std::optional<double> x = numberOf(nextWord(rest_));
        if (!x) return false;
        values.push_back(valueOf<Number>(*x));
        continue;
      }
      const char* from = rest_.data() + k * size;
      if (type == "float") values.push_back(valueOf<Number>(bigEndian<float>(from)));
      if (type == "double") values.push_back(valueOf<Number>(bigEndian<double>(from)));
      if (type == "int") values.push_back(valueOf<Number>(bigEndian<std::int32_t>(from)));
      if (type == "vtktypeint64") values.push_back(valueOf<Number>(static_cast<double>(bigEndian<std::int64_t>(from))));
    }
    if (binary) rest_.remove_prefix(n * size);
    return true;
  }

 private:
  std::string_view rest_;
};

/// The cells as VTK wrote them before version 5: for each its size, then its corners. false where the block is damaged.
bool readCells(VtkText& text, bool binary, bool offsets, double n, double size, std::vector<std::int32_t>& cells) {
  if (!offsets) return text.numbers(binary, "int", size, cells);
  cells.clear();
  std::vector<std::int32_t> starts, corners;
  std::vector<std::string> head = text.words();
  if (head.size() != 2 || head[0] != "offsets" || !text.numbers(binary, head[1], n, starts)) return false;
  head = text.words();
  if (head.size() != 2 || head[0] != "connectivity" || !text.numbers(binary, head[1], size, corners)) return false;
  for (std::size_t k = 0; k + 1 < starts.size(); ++k) {
    const std::int32_t from = starts[k], to = starts[k + 1];
    if (!(from >= 0 && to >= from && to <= size)) return false;
    cells.push_back(to - from);
    cells.insert(cells.end(), corners.begin() + from, corners.begin() + to);
  }
  return true;
}

/// Number of cells; -1 where sizes or corners are not what they can be.
double checkCells(const std::vector<std::int32_t>& cells, std::size_t points) {
  double found = 0.0;
  for (std::size_t at = 0; at < cells.size(); ++found) {
    const std::int32_t size = cells[at++];
    if (size < 1 || static_cast<std::size_t>(size) > cells.size() - at) return -1.0;
    for (std::int32_t k = 0; k < size; ++k, ++at)
      if (cells[at] < 0 || static_cast<std::size_t>(cells[at]) >= points) return -1.0;
  }
  return found;
}

/// Every second triangle of a strip has its first two corners swapped, so that all face one way.
std::vector<std::int32_t> trianglesOfStrips(const std::vector<std::int32_t>& strips) {
  std::vector<std::int32_t> cells;
  for (std::size_t at = 0; at < strips.size(); at += 1 + static_cast<std::size_t>(strips[at]))
    for (std::size_t k = 0; k + 2 < static_cast<std::size_t>(strips[at]); ++k) {
      const std::int32_t* corner = &strips[at + 1 + k];
      cells.insert(cells.end(), {3, corner[k % 2], corner[1 - k % 2], corner[2]});
    }
  return cells;
}

}  // namespace

Result<std::string> plainVtk(const std::string& name, std::string_view whole, PromisedCounts& promised) {
  const auto unreadable = [&](const std::string& what) {
    return Error{ErrorCode::kUnreadable, "'" + name + "' " + what};
  };
  VtkText text(whole);

  const std::string version = text.line();
  const std::size_t version_at = version.find("vtk datafile version");
  if (version_at == std::string::npos)
    return unreadable("is no legacy VTK file: it does not begin with '# vtk DataFile Version'");
  // From version 5 on, cells are two arrays, the first with one entry more than there are cells.
  const bool offsets = std::strtod(version.c_str() + version_at + 20, nullptr) >= 5.0;
  text.line();  // the title
  const std::string format = text.line();
  const bool binary = format.find("binary") != std::string::npos;
  if (!binary && format.find("ascii") == std::string::npos)
    return unreadable("is neither ASCII nor BINARY, or truncated");
  if (!binary)
    if (const std::string fault = notText(whole); !fault.empty()) return unreadable(fault);
  std::vector<std::string> words = text.words();
  if (words.size() != 2 || words[0] != "dataset" || words[1] != "polydata")
    return unreadable("is not a DATASET POLYDATA, or truncated; accepted: POLYDATA");

  std::vector<double> points;
  std::vector<std::int32_t> cells, strips;
  double polygons = 0.0;
  bool has_points = false;
  while (!(words = text.words()).empty()) {
    if (words[0] == "point_data" || words[0] == "cell_data") break;  // no shape after it
    if (words[0] == "points") {
      const double n = words.size() == 3 ? countOf(words[1]) : std::nan("");
      if (n > static_cast<double>(kMaxPoints)) return checkCounts(name, n, 0.0, 0.0).error();
      if (!text.numbers(binary, words.size() == 3 ? words[2] : "", 3.0 * n, points))
        return unreadable("is truncated or damaged in its POINTS (float or double)");
      has_points = true;
    } else if (words[0] == "polygons" || words[0] == "triangle_strips" || words[0] == "lines" ||
               words[0] == "vertices") {
      std::vector<std::int32_t> read;
      const double n = words.size() == 3 ? countOf(words[1]) : std::nan("");
      const double size = words.size() == 3 ? countOf(words[2]) : std::nan("");
      const double corners = offsets ? size : size - n;
      if (n > static_cast<double>(kMaxFaces) || corners > static_cast<double>(kMaxCorners))
        return checkCounts(name, 1.0, n, corners).error();
      if (!has_points || !readCells(text, binary, offsets, n, size, read))
        return unreadable("is truncated or damaged in its " + words[0]);
      if (words[0] == "lines" || words[0] == "vertices") continue;
      const double found = checkCells(read, points.size() / 3);
      if (found < 0.0 || found != (offsets ? std::max(0.0, n - 1.0) : n))
        return unreadable("has damaged " + words[0] +
                          ": their sizes and corners do not fit their number and that of the points");
      if (words[0] == "polygons") {
        cells = std::move(read);
        polygons = found;
      } else {
        strips = trianglesOfStrips(read);
      }
    }
  }
  if (!has_points) return unreadable("has no POINTS, or is truncated");
  if (points.empty()) return Error{ErrorCode::kUnsuitableShape, "'" + name + "' has no points"};

  cells.insert(cells.end(), strips.begin(), strips.end());
  polygons += static_cast<double>(strips.size() / 4);
  if (Status status = checkCounts(name, 1.0, polygons, 0.0); !status) return status.error();
  promised.points = points.size() / 3;
  promised.faces = static_cast<std::size_t>(polygons);
  std::string plain = "# vtk DataFile Version 3.0\nplain\nBINARY\nDATASET POLYDATA\nPOINTS " +
                      std::to_string(points.size() / 3) + " double\n";
  for (double x : points) putBigEndian(plain, x);
  if (!cells.empty()) {
    plain += "\nPOLYGONS " + std::to_string(*promised.faces) + " " + std::to_string(cells.size()) + "\n";
    for (std::int32_t k : cells) putBigEndian(plain, k);
  }
  plain += "\n";
  return plain;
}

}  // namespace meshless
