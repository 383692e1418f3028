#include <algorithm>
#include <array>
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
constexpr double kMaxBytes = 512.0 * 1024 * 1024;

struct Field {
  std::string name;
  char type = 'F';
  double size = 4, count = 1;  // bytes of one value; values of a point
  double offset = 0;           // bytes, in a point
  double column = 0;           // in a line of text
};

struct Header {
  std::vector<Field> fields;
  std::array<int, 3> xyz{{-1, -1, -1}};
  double points = 0, step = 0, columns = 0;
  std::string data;
};

/// A whole number >= 0; NaN where it is none.
double count(const std::string& word) {
  if (word.empty() || !std::all_of(word.begin(), word.end(), [](unsigned char c) { return std::isdigit(c); }))
    return std::nan("");
  return std::strtod(word.c_str(), nullptr);
}

/// What is wrong with the header, or an empty text. Leaves the stream at the data.
std::string readHeader(std::istream& in, Header& header) {
  std::vector<std::string> names, sizes, types, counts;
  double width = std::nan(""), height = 1.0, points = std::nan("");
  std::size_t read = 0;
  for (std::string line; header.data.empty() && read < (1 << 16) && std::getline(in, line); read += line.size() + 1) {
    std::istringstream text(line);
    std::vector<std::string> w(std::istream_iterator<std::string>(text), {});
    if (w.size() < 2) continue;
    const std::string key = w[0];
    w.erase(w.begin());
    if (key == "FIELDS") names = w;
    if (key == "SIZE") sizes = w;
    if (key == "TYPE") types = w;
    if (key == "COUNT") counts = w;
    if (key == "WIDTH") width = count(w[0]);
    if (key == "HEIGHT") height = count(w[0]);
    if (key == "POINTS") points = count(w[0]);
    if (key == "DATA") header.data = w[0];
  }
  if (header.data.empty()) return "is no PCD file, or its header is truncated: it has no DATA line";
  if (header.data != "ascii" && header.data != "binary" && header.data != "binary_compressed")
    return "has DATA " + header.data.substr(0, 20) + "; accepted: ascii, binary, binary_compressed";
  if (counts.empty()) counts.assign(names.size(), "1");
  if (names.empty() || sizes.size() != names.size() || types.size() != names.size() || counts.size() != names.size())
    return "has FIELDS, SIZE, TYPE and COUNT of different lengths, or lacks one";
  if (std::isnan(points)) points = width * height;
  if (!(points == width * height)) return "has WIDTH, HEIGHT and POINTS that do not agree";
  header.points = points;
  for (std::size_t k = 0; k < names.size(); ++k) {
    Field field;
    field.name = names[k];
    field.type = types[k][0];
    field.size = count(sizes[k]);
    field.count = count(counts[k]);
    field.offset = header.step;
    field.column = header.columns;
    const bool real = field.type == 'F' && (field.size == 4 || field.size == 8);
    const bool whole = (field.type == 'I' || field.type == 'U') &&
                       (field.size == 1 || field.size == 2 || field.size == 4 || field.size == 8);
    if (types[k].size() != 1 || !(real || whole) || !(field.count >= 1.0 && field.count <= 10000.0))
      return "has a field '" + names[k].substr(0, 30) + "' of a type, size or count that there is not";
    for (int d = 0; d < 3; ++d)
      if (names[k] == std::string(1, "xyz"[d]) && real && field.count == 1.0) header.xyz[d] = static_cast<int>(k);
    header.step += field.size * field.count;
    header.columns += field.count;
    header.fields.push_back(field);
  }
  for (int at : header.xyz)
    if (at < 0) return "has no fields x, y and z of float or double";
  if (header.points <= kMaxPoints && header.step * header.points > kMaxBytes) return "needs more than 512 MiB";
  return {};
}

/// A header that PCL reads without doubt.
std::string headerText(const std::vector<Field>& fields, double points, const std::string& data) {
  std::string names, sizes, types, counts;
  for (const Field& field : fields) {
    names += " " + field.name;
    sizes += " " + std::to_string(static_cast<int>(field.size));
    types += std::string(" ") + field.type;
    counts += " " + std::to_string(static_cast<int>(field.count));
  }
  const std::string n = std::to_string(static_cast<std::size_t>(points));
  return "VERSION 0.7\nFIELDS" + names + "\nSIZE" + sizes + "\nTYPE" + types + "\nCOUNT" + counts + "\nWIDTH " + n +
         "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + n + "\nDATA " + data + "\n";
}

/// x, y, z of every point as doubles; false where the data ends first or a coordinate is no number.
bool decode(const Header& header, const std::string& body, std::string& out) {
  const std::size_t n = static_cast<std::size_t>(header.points);
  if (header.data == "ascii") {
    std::istringstream lines(body);
    std::vector<std::string> w;
    for (std::size_t k = 0; k < n;) {
      std::string line;
      if (!std::getline(lines, line)) return false;
      std::istringstream text(line);
      w.assign(std::istream_iterator<std::string>(text), {});
      if (w.empty()) continue;
      if (static_cast<double>(w.size()) != header.columns) return false;
      for (int at : header.xyz) {
        const std::string& word = w[static_cast<std::size_t>(header.fields[at].column)];
        char* end = nullptr;
        const double x = std::strtod(word.c_str(), &end);
        if (*end != '\0') return false;
        out.append(reinterpret_cast<const char*>(&x), sizeof x);
      }
      ++k;
    }
    return true;
  }
  const std::size_t step = static_cast<std::size_t>(header.step);
  if (n * step > body.size()) return false;
  for (std::size_t k = 0; k < n; ++k)
    for (int at : header.xyz) {
      const char* from = body.data() + k * step + static_cast<std::size_t>(header.fields[at].offset);
      double x = 0.0;
      if (header.fields[at].size == 4) {
        float single;
        std::memcpy(&single, from, sizeof single);
        x = single;
      } else {
        std::memcpy(&x, from, sizeof x);
      }
      out.append(reinterpret_cast<const char*>(&x), sizeof x);
    }
  return true;
}

}  // namespace

Result<std::string> plainPcd(const std::string& path, PromisedCounts& promised) {
  const std::string name = "'" + std::filesystem::path(path).filename().string() + "' ";
  std::ifstream in(path, std::ios::binary);
  if (!in) return Error{ErrorCode::kUnreadable, name + "cannot be opened"};
  Header header;
  const std::string fault = readHeader(in, header);
  if (!fault.empty()) return Error{ErrorCode::kUnreadable, name + fault};
  if (!(header.points >= 1.0)) return Error{ErrorCode::kUnsuitableShape, name + "has no points"};
  if (!(header.points <= kMaxPoints)) {
    std::ostringstream text;
    text << name << "has " << header.points << " points; accepted: up to 2000000";
    return Error{ErrorCode::kUnsuitableShape, text.str()};
  }
  promised.points = static_cast<std::size_t>(header.points);
  const std::string body(std::istreambuf_iterator<char>(in), {});
  if (header.data == "binary_compressed") {
    std::uint32_t sizes[2] = {0, 0};  // packed, unpacked
    if (body.size() >= sizeof sizes) std::memcpy(sizes, body.data(), sizeof sizes);
    if (body.size() < sizeof sizes || sizes[0] > body.size() - sizeof sizes || sizes[1] != header.step * header.points)
      return Error{ErrorCode::kUnreadable, name + "is truncated or damaged in its compressed data"};
    return headerText(header.fields, header.points, header.data) + body;
  }
  std::vector<Field> fields(3);
  for (int d = 0; d < 3; ++d) {
    fields[d].name = std::string(1, "xyz"[d]);
    fields[d].size = 8;
  }
  std::string plain = headerText(fields, header.points, "binary");
  if (!decode(header, body, plain))
    return Error{ErrorCode::kUnreadable, name + "is truncated or damaged in its points"};
  return plain;
}

}  // namespace meshless
