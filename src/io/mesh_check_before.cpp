#include "mesh_check_before.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <vector>

#include "text_words.h"

namespace meshless {
namespace {

constexpr std::size_t kMaxPolygon = 1000;  // corners

Error unreadable(const std::string& name, const std::string& what) {
  return {ErrorCode::kUnreadable, "'" + name + "' " + what};
}

/// For a message.
std::string printable(std::string text) {
  text = text.substr(0, 60);
  for (char& c : text)
    if (!std::isprint(static_cast<unsigned char>(c))) c = '?';
  return text;
}

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

Result<PromisedCounts> checkStl(const std::string& name, std::string_view text) {
  const std::uint64_t bytes = text.size();
  const bool whole_header = bytes >= 84;
  std::uint32_t faces = 0;
  if (whole_header) std::memcpy(&faces, text.data() + 80, sizeof faces);
  if (whole_header && 84 + 50ull * faces == bytes) {
    if (faces == 0) return Error{ErrorCode::kUnsuitableShape, "'" + name + "' has no triangles"};
    if (Status status = checkCounts(name, 3.0 * faces / 4.0, faces, 0.0); !status) return status.error();
    return PromisedCounts{};
  }
  if (text.substr(0, 5) != "solid") {
    if (!whole_header) return unreadable(name, "is no STL file, or truncated");
    std::ostringstream what;
    what << "promises " << faces << " triangles and is " << (84 + 50ull * faces > bytes ? "truncated" : "longer");
    return unreadable(name, what.str());
  }
  // Text; its end is a line "endsolid NAME".
  const std::string_view tail = text.substr(bytes - std::min<std::size_t>(bytes, kMaxHeader));
  if (lowerCase(tail).find("endsolid") == std::string::npos)
    return unreadable(name, "is truncated: it has no endsolid");
  // The reader takes a file with other bytes for a binary one, and makes room for as many triangles as they spell.
  for (std::size_t at = 0; at < text.size(); ++at) {
    const auto c = static_cast<unsigned char>(text[at]);
    if (c > 126 || (c < 32 && c != '\n' && c != '\r' && c != '\t'))
      return unreadable(name, "begins as text and has the byte " + std::to_string(c) + " at " + std::to_string(at));
  }
  return PromisedCounts{};
}

/// Whether an OBJ line ends in a backslash.
bool continues(std::string_view line) {
  while (!line.empty() && isBlank(line.back())) line.remove_suffix(1);
  return !line.empty() && line.back() == '\\';
}

/// The words of the next line of an OFF file that has any, without its comment; empty at the end.
std::vector<std::string> offWords(std::string_view& text, std::size_t& line_number) {
  std::vector<std::string> words;
  for (std::string_view line; words.empty() && nextLine(text, line);) {
    ++line_number;
    words = wordsOf(line.substr(0, std::min(line.find('#'), kMaxLine)));
  }
  return words;
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
  for (const Element& element : elements) {
    std::optional<std::size_t> end;
    if (format == "ascii") {
      std::string_view rest = data.substr(at), line;
      double lines = 0.0;
      while (lines < element.count && nextLine(rest, line)) ++lines;
      if (lines == element.count) end = data.size() - rest.size();
    } else {
      end = endOfItems(data, at, element.count, element.properties, format == "binary_big_endian");
    }
    if (!end) return unreadable(name, "is truncated or damaged in its data");
    if (!element.other) plain.append(data.substr(at, *end - at));
    at = *end;
  }
  return plain;
}

Result<std::string> plainOff(const std::string& name, std::string_view text, PromisedCounts& promised) {
  if (const std::string fault = notText(text); !fault.empty()) return unreadable(name, fault);
  std::size_t line_number = 0;
  const auto bad = [&](const std::string& what) {
    return unreadable(name, "line " + std::to_string(line_number) + ": " + what);
  };
  std::vector<std::string> w = offWords(text, line_number);
  if (!w.empty() && w[0].size() >= 3 && w[0].compare(w[0].size() - 3, 3, "OFF") == 0) {
    const std::string kind = w[0].substr(0, w[0].size() - 3);
    for (const char* known : {"", "C", "N", "CN", "ST", "STC", "STN", "STCN"})
      if (kind == known) w[0].clear();
    if (!w[0].empty() || (w.size() > 1 && w[1] == "BINARY"))
      return bad("'" + printable(w[0].empty() ? "OFF BINARY" : w[0]) + "'; accepted: OFF, COFF, NOFF, in text");
    w.erase(w.begin());
    if (w.empty()) w = offWords(text, line_number);
  }
  const double points = w.size() >= 2 ? countOf(w[0]) : std::nan(""),
               faces = w.size() >= 2 ? countOf(w[1]) : std::nan("");
  if (std::isnan(points) || std::isnan(faces))
    return bad("is no OFF file, or truncated: no numbers of points and faces");
  if (Status status = checkCounts(name, points, faces, 0.0); !status) return status.error();
  promised.points = static_cast<std::size_t>(points);
  std::string plain;
  for (double k = 0.0; k < points; ++k) {
    w = offWords(text, line_number);
    if (w.empty()) return bad("is truncated in its points");
    if (w.size() < 3) return bad("a point needs three numbers, it has " + std::to_string(w.size()));
    for (std::size_t c = 0; c < 3; ++c)
      if (!numberOf(w[c])) return bad("'" + printable(w[c]) + "' is no number");
    plain += "v " + w[0] + " " + w[1] + " " + w[2] + "\n";
  }
  for (double k = 0.0; k < faces; ++k) {
    w = offWords(text, line_number);
    if (w.empty()) return bad("is truncated in its faces");
    const double corners = countOf(w[0]);
    if (!(corners <= static_cast<double>(w.size() - 1))) return bad("a face has fewer corners than it says");
    if (corners > static_cast<double>(kMaxPolygon)) return bad("a face has more than 1000 corners");
    if (corners < 3.0) continue;  // a point or an edge
    plain += "f";
    for (std::size_t c = 1; static_cast<double>(c) <= corners; ++c) {
      const double corner = countOf(w[c]);
      if (std::isnan(corner)) return bad("'" + printable(w[c]) + "' is no number of a point");
      // One that names no point becomes 0, for the check of the mesh to name.
      plain += " " + (corner < points ? std::to_string(static_cast<std::size_t>(corner) + 1) : std::string("0"));
    }
    plain += "\n";
  }
  return plainObj(name, plain);
}

Status checkCounts(const std::string& name, double points, double faces, double corners) {
  if (!(points >= 1.0)) return Error{ErrorCode::kUnsuitableShape, "'" + name + "' has no points"};
  const auto tooMany = [&](double n, const char* of, std::size_t most) {
    std::ostringstream text;
    text.precision(15);
    text << "'" << name << "' has " << n << " " << of << "; accepted: up to " << most;
    return Error{ErrorCode::kUnsuitableShape, text.str()};
  };
  if (!(points <= static_cast<double>(kMaxPoints))) return tooMany(points, "points", kMaxPoints);
  if (!(faces <= static_cast<double>(kMaxFaces))) return tooMany(faces, "faces", kMaxFaces);
  if (!(corners <= static_cast<double>(kMaxCorners))) return tooMany(corners, "corners of faces", kMaxCorners);
  return Done{};
}

Result<MeshFormat> meshFormatOf(const std::string& name) {
  const std::string ending = lowerCase(std::filesystem::path(name).extension().string());
  if (ending == ".pcd") return MeshFormat::kPcd;
  if (ending == ".ply") return MeshFormat::kPly;
  if (ending == ".obj") return MeshFormat::kObj;
  if (ending == ".stl") return MeshFormat::kStl;
  if (ending == ".vtk") return MeshFormat::kVtk;
  if (ending == ".off") return MeshFormat::kOff;
  return unreadable(name, "is of an unknown kind; accepted endings: .pcd, .ply, .obj, .stl, .vtk, .off");
}

Result<PromisedCounts> checkBeforeReading(const std::string& name, std::string_view text, MeshFormat format) {
  if (text.empty()) return unreadable(name, "is empty");
  switch (format) {
    case MeshFormat::kPly:
      return checkPly(name, text);
    case MeshFormat::kStl:
      return checkStl(name, text);
    case MeshFormat::kPcd:  // for these, what makes them plain looks at every number
    case MeshFormat::kVtk:
    case MeshFormat::kObj:
    case MeshFormat::kOff:
      break;
  }
  return PromisedCounts{};
}

Result<std::string> plainObj(const std::string& name, std::string_view text) {
  // Some programs write their whole buffer. More of them are a hole in a file, and no text.
  const std::size_t end = text.find_last_not_of('\0') + 1;  // 0: nothing else
  constexpr std::size_t kMostNuls = 65536;
  if (text.size() - end <= kMostNuls) text = text.substr(0, end);
  if (const std::string fault = notText(text); !fault.empty()) return unreadable(name, fault);
  std::string plain;
  std::size_t points = 0, faces = 0, corners = 0, line_number = 0;
  const auto bad = [&](const std::string& what) {
    return unreadable(name, "line " + std::to_string(line_number) + ": " + what);
  };
  std::string joined;
  for (std::string_view line; nextLine(text, line);) {
    ++line_number;
    if (line.size() > kMaxLine) return bad("is longer than 65536 characters");
    const std::size_t first = line.find_first_not_of(" \t");
    if (first == std::string_view::npos || (line[first] != 'v' && line[first] != 'f')) continue;
    if (continues(line)) {  // only here: a comment may end in the path of a folder
      joined.clear();
      bool more = true;
      while (more && continues(line) && joined.size() <= kMaxLine) {
        joined.append(line.substr(0, line.rfind('\\'))) += ' ';
        more = nextLine(text, line);
        line_number += more;
      }
      if (more) joined.append(line.substr(0, kMaxLine + 1));
      if (joined.size() > kMaxLine) return bad("is longer than 65536 characters");
      line = joined;
    }
    const std::vector<std::string> w = wordsOf(line);
    if (w[0] == "v") {
      if (w.size() < 4) return bad("a vertex needs three numbers, it has " + std::to_string(w.size() - 1));
      plain += "v";
      for (std::size_t k = 1; k < 4; ++k) {
        const std::optional<double> x = numberOf(w[k]);
        if (!x) return bad("'" + w[k].substr(0, 30) + "' is no number");
        // What float cannot hold becomes NaN, for the check of the mesh to name.
        char number[32] = "nan";
        if (std::abs(*x) <= 3.4e38) std::snprintf(number, sizeof number, "%.9g", std::abs(*x) < 1e-37 ? 0.0 : *x);
        plain += " ";
        plain += number;
      }
      plain += "\n";
      ++points;
    } else if (w[0] == "f") {
      if (w.size() < 4) return bad("a face needs three corners, it has " + std::to_string(w.size() - 1));
      if (w.size() > kMaxPolygon + 1) return bad("a face has more than 1000 corners");
      plain += "f";
      for (std::size_t k = 1; k < w.size(); ++k) {
        char* end = nullptr;
        errno = 0;
        const long long corner = std::strtoll(w[k].c_str(), &end, 10);
        if (end == w[k].c_str() || (*end != '\0' && *end != '/') || errno != 0)
          return bad("'" + w[k].substr(0, 30) + "' is no vertex number");
        // Relative numbers become absolute ones; one that names no vertex becomes 0, for the check of the mesh to name.
        long long absolute = corner < 0 ? static_cast<long long>(points) + 1 + corner : corner;
        if (absolute < 0 || absolute > static_cast<long long>(kMaxPoints)) absolute = 0;
        plain += " " + std::to_string(absolute);
      }
      plain += "\n";
      ++faces;
      corners += w.size() - 1;
    } else {
      continue;
    }
    if (points > kMaxPoints || faces > kMaxFaces || corners > kMaxCorners) break;
  }
  if (Status status =
          checkCounts(name, static_cast<double>(points), static_cast<double>(faces), static_cast<double>(corners));
      !status)
    return status.error();
  return plain;
}

}  // namespace meshless
