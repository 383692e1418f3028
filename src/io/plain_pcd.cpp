#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "mesh_format.h"
#include "text_words.h"

namespace meshless {
namespace {

// LZF writes at most 264 bytes for three that it reads.
constexpr double kMostUnpacked = 88.0;

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

/// What is wrong with the header, or an empty text. Leaves `text` at the data.
std::string readHeader(std::string_view& text, Header& header) {
  std::vector<std::string> names, sizes, types, counts;
  double width = std::nan(""), height = 1.0, points = std::nan("");
  std::string_view head = headOf(text);
  const std::size_t head_size = head.size();
  for (std::string_view line; header.data.empty() && nextLine(head, line);) {
    std::vector<std::string> w = wordsOf(line);
    if (w.size() < 2) continue;
    const std::string key = w[0];
    w.erase(w.begin());
    if (key == "FIELDS") names = w;
    if (key == "SIZE") sizes = w;
    if (key == "TYPE") types = w;
    if (key == "COUNT") counts = w;
    if (key == "WIDTH") width = countOf(w[0]);
    if (key == "HEIGHT") height = countOf(w[0]);
    if (key == "POINTS") points = countOf(w[0]);
    if (key == "DATA") header.data = w[0];
  }
  text.remove_prefix(head_size - head.size());
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
    field.size = countOf(sizes[k]);
    field.count = countOf(counts[k]);
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
  if (header.points <= static_cast<double>(kMaxPoints) &&
      header.step * header.points > static_cast<double>(kMaxMeshBytes))
    return "needs more than 512 MiB";
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

/// The coordinates of one line's point behind `out`; false where it has other columns or they are no numbers.
bool decodeLine(const Header& header, std::string_view line, std::string& out) {
  double xyz[3], column = 0.0;
  for (std::string_view word = nextWord(line); !word.empty(); word = nextWord(line), ++column) {
    if (column >= header.columns) return false;
    for (int d = 0; d < 3; ++d) {
      if (header.fields[static_cast<std::size_t>(header.xyz[d])].column != column) continue;
      const std::optional<double> x = numberOf(word);
      if (!x) return false;
      xyz[d] = *x;
    }
  }
  if (column != header.columns) return false;
  out.append(reinterpret_cast<const char*>(xyz), sizeof xyz);
  return true;
}

/// x, y, z of every point as doubles; false where the data ends first or a coordinate is no number.
bool decode(const Header& header, std::string_view body, std::string& out) {
  const std::size_t n = static_cast<std::size_t>(header.points);
  if (header.data == "ascii") {
    std::size_t k = 0;
    for (std::string_view line; k < n && nextLine(body, line);) {
      std::string_view rest = line;
      if (nextWord(rest).empty()) continue;
      if (!decodeLine(header, line, out)) return false;
      ++k;
    }
    return k == n;
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

Result<std::string> plainPcd(const std::string& name, std::string_view text, std::optional<std::size_t>& points_in) {
  const auto unreadable = [&](const std::string& what) {
    return Error{ErrorCode::kUnreadable, "'" + name + "' " + what};
  };
  Header header;
  std::string_view body = text;
  if (const std::string fault = readHeader(body, header); !fault.empty()) return unreadable(fault);
  if (Status status = checkCounts(name, header.points, 0.0, 0.0); !status) return status.error();
  points_in = static_cast<std::size_t>(header.points);
  if (header.data == "binary_compressed") {
    std::uint32_t sizes[2] = {0, 0};  // packed, unpacked
    if (body.size() >= sizeof sizes) std::memcpy(sizes, body.data(), sizeof sizes);
    if (body.size() < sizeof sizes || sizes[0] > body.size() - sizeof sizes ||
        sizes[1] != header.step * header.points || sizes[1] > kMostUnpacked * sizes[0])
      return unreadable("is truncated or damaged in its compressed data");
    return headerText(header.fields, header.points, header.data).append(body.substr(0, sizeof sizes + sizes[0]));
  }
  if (header.data == "ascii")
    if (const std::string fault = notText(text); !fault.empty()) return unreadable(fault);
  std::vector<Field> fields(3);
  for (int d = 0; d < 3; ++d) {
    fields[d].name = std::string(1, "xyz"[d]);
    fields[d].size = 8;
  }
  std::string plain = headerText(fields, header.points, "binary");
  if (!decode(header, body, plain)) return unreadable("is truncated or damaged in its points");
  return plain;
}

}  // namespace meshless
