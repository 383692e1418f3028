#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "mesh_check_before.h"
#include "text_words.h"

namespace meshless {
namespace {

/// Bytes of a PLY type; 0 where there is none of this name.
std::size_t plyBytes(const std::string& type) {
  for (const char* one : {"char", "uchar", "int8", "uint8"})
    if (type == one) return 1;
  for (const char* two : {"short", "ushort", "int16", "uint16"})
    if (type == two) return 2;
  for (const char* four : {"int", "uint", "int32", "uint32", "float", "float32"})
    if (type == four) return 4;
  return type == "double" || type == "float64" ? 8 : 0;
}

bool isWhole(const std::string& type) {
  return plyBytes(type) > 0 && type.compare(0, 5, "float") != 0 && type != "double";
}

struct PlyElement {
  double count = 0.0;
  double properties = 0.0, bytes = 0.0;  // without those of the list, which comes first
  std::string list_size, list_entry;     // types; empty without a list
};

/// The whole number of `bytes` at `at`; -1 for a negative one.
double listSize(const char* at, std::size_t bytes, bool has_sign, bool big_endian) {
  std::uint64_t value = 0;
  for (std::size_t k = 0; k < bytes; ++k)
    value = value << 8 | static_cast<unsigned char>(at[big_endian ? k : bytes - 1 - k]);
  return has_sign && value >> (8 * bytes - 1) ? -1.0 : static_cast<double>(value);
}

/// Where the data that the header promises ends. PCL takes memory for it while it looks.
Result<std::size_t> endOfPlyData(const std::string& name, std::string_view data,
                                 const std::vector<PlyElement>& elements, bool big_endian) {
  double at = 0.0, corners = 0.0;
  const double end = static_cast<double>(data.size());
  const Error truncated = unreadable(name, "is truncated or damaged in its data");
  for (const PlyElement& element : elements) {
    if (element.list_size.empty()) {
      at += element.count * element.bytes;
      if (!(at <= end)) return truncated;
      continue;
    }
    const std::size_t bytes = plyBytes(element.list_size);
    const double entry = static_cast<double>(plyBytes(element.list_entry));
    for (double k = 0.0; k < element.count; ++k) {
      if (!(at + static_cast<double>(bytes) <= end)) return truncated;
      const double size =
          listSize(data.data() + static_cast<std::size_t>(at), bytes, element.list_size[0] != 'u', big_endian);
      if (size < 0.0) return truncated;
      corners += size;
      at += static_cast<double>(bytes) + size * entry + element.bytes;
      if (!(at <= end)) return truncated;
    }
  }
  if (Status status = checkCounts(name, 1.0, 0.0, corners); !status) return status.error();
  return static_cast<std::size_t>(at);
}

/// Whether data in text holds it, from `from` on: so many words, in lines that PCL may hold.
Status checkPlyText(const std::string& name, std::string_view text, std::size_t from,
                    const std::vector<PlyElement>& elements) {
  if (const std::string fault = notText(text, from); !fault.empty()) return unreadable(name, fault);
  std::string_view data = text.substr(from);
  double others = 0.0;  // than corners
  for (const PlyElement& element : elements)
    others += element.count * (element.properties + (element.list_size.empty() ? 0.0 : 1.0));
  double words = 0.0;
  std::size_t line_number = 0;
  for (std::string_view line; nextLine(data, line);) {
    ++line_number;
    if (line.size() > kMaxLine)
      return unreadable(name,
                        "line " + std::to_string(line_number) + " after the header is longer than 65536 characters");
    for (std::size_t k = 0; k < line.size(); ++k)
      if (!isBlank(line[k]) && (k == 0 || isBlank(line[k - 1]))) ++words;
  }
  if (!(others <= words)) return unreadable(name, "is truncated or damaged in its data");
  return checkCounts(name, 1.0, 0.0, words - others);
}

struct PlyProperty {
  std::size_t bytes = 0, size_bytes = 0;  // of a number; of a list's size, 0 where it is no list
  bool signed_size = false;
};

/// Where `count` items of such properties end that begin at `at`; nothing where the data ends first.
std::optional<std::size_t> endOfItems(std::string_view data, std::size_t at, double count,
                                      const std::vector<PlyProperty>& properties, bool big_endian) {
  std::size_t fixed = 0;
  bool has_list = false;
  for (const PlyProperty& property : properties) {
    fixed += property.bytes;
    has_list = has_list || property.size_bytes > 0;
  }
  if (!has_list) {
    const double end = static_cast<double>(at) + count * static_cast<double>(fixed);
    if (!(end <= static_cast<double>(data.size()))) return std::nullopt;
    return static_cast<std::size_t>(end);
  }
  for (double k = 0.0; k < count; ++k)
    for (const PlyProperty& property : properties) {
      double items = 1.0;
      if (property.size_bytes > 0) {
        if (property.size_bytes > data.size() - at) return std::nullopt;
        items = listSize(data.data() + at, property.size_bytes, property.signed_size, big_endian);
        at += property.size_bytes;
      }
      if (!(items >= 0.0 && items * static_cast<double>(property.bytes) <= static_cast<double>(data.size() - at)))
        return std::nullopt;
      at += static_cast<std::size_t>(items) * property.bytes;
    }
  return at;
}

}  // namespace

Result<PromisedCounts> checkPly(const std::string& name, std::string_view text) {
  if (text.substr(0, 3) != "ply") return unreadable(name, "is no PLY file: it does not begin with 'ply'");
  const double bytes = static_cast<double>(text.size());
  std::string_view head = headOf(text);
  const std::size_t head_size = head.size();
  double points = std::nan(""), faces = 0.0, properties = 0.0;
  bool ended = false, has_faces = false;
  std::string format, element;
  std::vector<PlyElement> elements;
  std::vector<std::string> names;  // of the element's properties
  // PCL aborts the process on lists where it expects none: the header must be one that it knows.
  for (std::string_view line; !ended && nextLine(head, line);) {
    const std::vector<std::string> w = wordsOf(line);
    const auto bad = [&] {
      return unreadable(name, "has a damaged header: '" + printable(std::string(line.substr(0, 60))) + "'");
    };
    if (w.empty()) continue;
    if (w[0] == "comment" || w[0] == "obj_info" || w[0] == "ply") continue;
    if (w[0] == "format") {
      if (w.size() < 2 || !format.empty()) return bad();
      format = w[1];
      if (format != "ascii" && format != "binary_little_endian" && format != "binary_big_endian") return bad();
    } else if (w[0] == "end_header") {
      ended = true;
    } else if (w[0] == "property" && w.size() == 3) {
      // A coordinate of a whole-number type is one that no cloud has room for.
      const bool coordinate = element == "vertex" && (w[2] == "x" || w[2] == "y" || w[2] == "z");
      if (element.empty() || plyBytes(w[1]) == 0 || (coordinate && isWhole(w[1]))) return bad();
      if (std::find(names.begin(), names.end(), w[2]) != names.end()) return bad();
      names.push_back(w[2]);
      properties += 1.0;
      elements.back().properties += 1.0;
      elements.back().bytes += static_cast<double>(plyBytes(w[1]));
    } else if (w[0] == "property" && w.size() == 5 && w[1] == "list") {
      const bool corners = w[4] == "vertex_indices" || w[4] == "vertex_index";
      if (element != "face" || !corners || !isWhole(w[2]) || !isWhole(w[3]) || !names.empty()) return bad();
      names.push_back(w[4]);
      elements.back().list_size = w[2];
      elements.back().list_entry = w[3];
    } else if (w[0] == "element" && w.size() == 3) {
      const double n = countOf(w[2]);
      // No element is shorter than a byte.
      if (!(n <= bytes))
        return unreadable(name, "promises " + printable(w[2]) + " of " + printable(w[1]) + " and is truncated");
      element = w[1];
      names.clear();
      elements.emplace_back();
      elements.back().count = n;
      if (element == "camera" && n == 1.0) continue;  // PCL's own files have it
      if (element != "vertex" && element != "face")
        return unreadable(name, "has the element '" + printable(element) + "'; accepted: vertex, face");
      if (element == "vertex" ? !std::isnan(points) : std::isnan(points) || has_faces) return bad();
      has_faces = element == "face";
      (element == "vertex" ? points : faces) = n;
    } else {
      return bad();
    }
  }
  if (!ended) return unreadable(name, "has a truncated header: it has no end_header");
  if (format.empty()) return unreadable(name, "has a damaged header: it has no format");
  if (std::isnan(points)) points = 0.0;
  if (Status status = checkCounts(name, points, faces, 0.0); !status) return status.error();
  if (!(8.0 * properties * points <= static_cast<double>(kMaxMeshBytes)))
    return unreadable(name, "has properties that need more than 512 MiB");
  const std::size_t data = head_size - head.size();
  PromisedCounts promised;
  if (format == "ascii") {
    if (Status status = checkPlyText(name, text, data, elements); !status) return status.error();
  } else {
    const Result<std::size_t> end = endOfPlyData(name, text.substr(data), elements, format == "binary_big_endian");
    if (!end) return end.error();
    promised.bytes = data + *end;
  }
  promised.points = static_cast<std::size_t>(points);
  promised.faces = static_cast<std::size_t>(faces);
  return promised;
}

Result<std::string> withoutOtherElements(const std::string& name, std::string_view text) {
  struct Element {
    double count;
    bool other;
    std::vector<PlyProperty> properties;
  };
  std::vector<Element> elements;
  std::string plain, format;
  bool ended = false, has_others = false;
  std::string_view head = headOf(text);
  const std::size_t head_size = head.size();
  for (std::string_view line; !ended && nextLine(head, line);) {
    const std::vector<std::string> w = wordsOf(line);
    const std::string word = w.empty() ? "" : w[0];
    if (word == "format" && w.size() > 1) format = w[1];
    ended = word == "end_header";
    if (word == "element") {
      const double count = w.size() == 3 ? countOf(w[2]) : std::nan("");
      if (!(count <= static_cast<double>(text.size()))) return std::string();
      const Status few = checkCounts(name, w[1] == "vertex" ? count : 1.0, w[1] == "face" ? count : 0.0, 0.0);
      if (!few) return few.error();
      // Strips are triangles: what has them is refused, and not read as a cloud.
      const bool other = w[1] != "vertex" && w[1] != "face" && w[1] != "camera" && w[1] != "tristrips";
      elements.push_back({count, other, {}});
      has_others = has_others || other;
    } else if (word == "property") {
      const bool list = w.size() == 5 && w[1] == "list";
      PlyProperty property;
      property.bytes = list ? plyBytes(w[3]) : w.size() == 3 ? plyBytes(w[1]) : 0;
      if (list) {
        property.size_bytes = isWhole(w[2]) ? plyBytes(w[2]) : 0;
        property.signed_size = w[2][0] != 'u';
      }
      if (elements.empty() || property.bytes == 0 || (list && property.size_bytes == 0)) return std::string();
      elements.back().properties.push_back(property);
    }
    if ((word != "element" && word != "property") || elements.empty() || !elements.back().other)
      plain.append(line) += '\n';
  }
  if (!ended || !has_others) return std::string();
  const std::string_view data = text.substr(head_size - head.size());
  std::size_t at = 0;
  std::vector<std::string_view> kept;  // copied once all is known to be there
  for (const Element& element : elements) {
    std::optional<std::size_t> end;
    if (format == "ascii") {
      std::string_view rest = data.substr(at), line;
      double lines = 0.0;
      while (lines < element.count && nextLine(rest, line)) {
        if (line.size() > kMaxLine) return unreadable(name, "has a line that is longer than 65536 characters");
        ++lines;
      }
      if (lines == element.count) end = data.size() - rest.size();
    } else {
      end = endOfItems(data, at, element.count, element.properties, format == "binary_big_endian");
    }
    if (!end) return unreadable(name, "is truncated or damaged in its data");
    if (!element.other) kept.push_back(data.substr(at, *end - at));
    at = *end;
  }
  for (std::string_view part : kept) plain.append(part);
  return plain;
}

}  // namespace meshless
