// PLY, as G. Turk's description of it ("The PLY Polygon File Format", 1994) and the programs that write it have it: any
// elements of any properties. PCL's reader takes lists of a byte and ints alone, and is silent about others.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <utility>
#include <vector>

#include "cells_of_file.h"
#include "mesh_format.h"
#include "text_words.h"

namespace meshless {
namespace {

enum class PlyType { kNone, kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };

PlyType plyType(const std::string& name) {
  constexpr std::pair<const char*, PlyType> kTypes[] = {
      {"char", PlyType::kInt8},     {"int8", PlyType::kInt8},     {"uchar", PlyType::kUint8},
      {"uint8", PlyType::kUint8},   {"short", PlyType::kInt16},   {"int16", PlyType::kInt16},
      {"ushort", PlyType::kUint16}, {"uint16", PlyType::kUint16}, {"int", PlyType::kInt32},
      {"int32", PlyType::kInt32},   {"uint", PlyType::kUint32},   {"uint32", PlyType::kUint32},
      {"float", PlyType::kFloat},   {"float32", PlyType::kFloat}, {"double", PlyType::kDouble},
      {"float64", PlyType::kDouble}};
  for (const auto& [known, type] : kTypes)
    if (name == known) return type;
  return PlyType::kNone;
}

std::size_t bytesOfType(PlyType type) {
  constexpr std::array<std::size_t, 9> kBytes{0, 1, 1, 2, 2, 4, 4, 4, 8};
  return kBytes[static_cast<std::size_t>(type)];
}

bool isReal(PlyType type) { return type == PlyType::kFloat || type == PlyType::kDouble; }

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kNone, size = PlyType::kNone;  // size: of a list
};

struct PlyElement {
  std::string name;
  double count = 0.0;
  std::vector<PlyProperty> properties;
};

class PlyReader {
 public:
  PlyReader(const std::string& name, std::string_view text) : name_(name), text_(text) {}

  Result<CellsOfFile> read() {
    if (Status status = readHeader(); !status) return status.error();
    if (ascii_)
      if (const std::string fault = notText(text_, text_.size() - rest_.size()); !fault.empty())
        return unreadable(name_, fault);
    for (const PlyElement& element : elements_)
      if (Status status = element.name == "vertex" ? readVertices(element)
                          : element.name == "face" ? readFaces(element)
                                                   : skip(element);
          !status)
        return status.error();
    return std::move(found_);
  }

 private:
  Status readHeader() {
    if (text_.substr(0, 3) != "ply") return unreadable(name_, "is no PLY file: it does not begin with 'ply'");
    std::string_view head = headOf(text_);
    const std::size_t head_size = head.size();
    bool ended = false, has_format = false;
    for (std::string_view line; !ended && nextLine(head, line);) {
      ++line_;
      const std::vector<std::string> w = wordsOf(line);
      const auto bad = [&] {
        return unreadable(name_, "line " + std::to_string(line_) + ": a damaged header: '" +
                                     printable(std::string(line.substr(0, 60))) + "'");
      };
      if (w.empty() || w[0] == "comment" || w[0] == "obj_info" || w[0] == "ply") continue;
      if (w[0] == "format" && w.size() > 1 && !has_format) {
        has_format = true;
        ascii_ = w[1] == "ascii";
        big_endian_ = w[1] == "binary_big_endian";
        if (!ascii_ && !big_endian_ && w[1] != "binary_little_endian") return bad();
      } else if (w[0] == "end_header") {
        ended = true;
      } else if (w[0] == "element" && w.size() == 3) {
        if (Status status = addElement(w[1], countOf(w[2]), w[2]); !status) return status;
      } else if (w[0] == "property" && !elements_.empty() && (w.size() == 3 || (w.size() == 5 && w[1] == "list"))) {
        PlyProperty property{w.back(), plyType(w[w.size() - 2])};
        if (w.size() == 5) property.size = plyType(w[2]);
        auto& properties = elements_.back().properties;
        if (property.type == PlyType::kNone ||
            (w.size() == 5 && (property.size == PlyType::kNone || isReal(property.size))) ||
            std::any_of(properties.begin(), properties.end(), [&](const auto& one) { return one.name == w.back(); }))
          return bad();
        properties.push_back(std::move(property));
      } else {
        return bad();
      }
    }
    if (!ended) return unreadable(name_, "has a truncated header: it has no end_header");
    if (!has_format) return unreadable(name_, "has a damaged header: it has no format");
    rest_ = text_.substr(head_size - head.size());
    return Done{};
  }

  Status addElement(const std::string& name, double count, const std::string& written) {
    // No element is shorter than a byte.
    if (!(count <= static_cast<double>(text_.size())))
      return unreadable(name_, "promises " + printable(written) + " of " + printable(name) + " and is truncated");
    const auto has = [&](const char* known) {
      return std::any_of(elements_.begin(), elements_.end(), [&](const auto& one) { return one.name == known; });
    };
    if (name == "tristrips") return unreadable(name_, "has the element 'tristrips'; accepted: vertex, face");
    if ((name == "vertex" && has("vertex")) || (name == "face" && (has("face") || !has("vertex"))))
      return unreadable(name_, "has a damaged header: " + name + " twice, or faces before vertices");
    if (Status status = checkCounts(name_, name == "vertex" ? count : 1.0, name == "face" ? count : 0.0, 0.0); !status)
      return status;
    elements_.push_back({name, count, {}});
    return Done{};
  }

  Status truncated(const PlyElement& element, double read) const {
    return unreadable(name_, "is truncated: it holds " + std::to_string(static_cast<std::size_t>(read)) + " of " +
                                 std::to_string(static_cast<std::size_t>(element.count)) + " of its element " +
                                 printable(element.name));
  }

  /// The next number; nothing where there is none: damage_ says what is there instead, if anything.
  std::optional<double> next(PlyType type) {
    if (ascii_) {
      while (!rest_.empty() && isBlank(rest_.front())) {
        line_ += rest_.front() == '\n';
        rest_.remove_prefix(1);
      }
      const std::string_view word = nextWord(rest_);
      const std::optional<double> x = numberOf(word);
      if (!x && !word.empty())
        damage_ =
            "line " + std::to_string(line_ + 1) + ": '" + printable(std::string(word.substr(0, 60))) + "' is no number";
      return x;
    }
    const std::size_t size = bytesOfType(type);
    if (rest_.size() < size) return std::nullopt;
    char bytes[8];
    std::memcpy(bytes, rest_.data(), size);
    rest_.remove_prefix(size);
    if (big_endian_) std::reverse(bytes, bytes + size);
    const auto as = [&](auto value) {
      std::memcpy(&value, bytes, sizeof value);
      return static_cast<double>(value);
    };
    switch (type) {
      case PlyType::kInt8:
        return as(std::int8_t{});
      case PlyType::kUint8:
        return as(std::uint8_t{});
      case PlyType::kInt16:
        return as(std::int16_t{});
      case PlyType::kUint16:
        return as(std::uint16_t{});
      case PlyType::kInt32:
        return as(std::int32_t{});
      case PlyType::kUint32:
        return as(std::uint32_t{});
      case PlyType::kFloat:
        return as(float{});
      case PlyType::kDouble:
        return as(double{});
      case PlyType::kNone:
        break;
    }
    return std::nullopt;
  }

  /// How many a list has.
  std::optional<double> nextSize(PlyType type) {
    const std::optional<double> size = next(type);
    if (!size) return std::nullopt;
    if (*size >= 0.0 && *size == std::floor(*size) && *size <= static_cast<double>(rest_.size())) return size;
    damage_ = "has a list of damaged size";
    return std::nullopt;
  }

  bool skip(const PlyProperty& property) {
    double count = 1.0;
    if (property.size != PlyType::kNone) {
      const std::optional<double> size = nextSize(property.size);
      if (!size) return false;
      count = *size;
    }
    if (!ascii_) {
      if (!(count * static_cast<double>(bytesOfType(property.type)) <= static_cast<double>(rest_.size()))) return false;
      rest_.remove_prefix(static_cast<std::size_t>(count) * bytesOfType(property.type));
      return true;
    }
    for (double k = 0.0; k < count; ++k)
      if (!next(property.type)) return false;
    return true;
  }

  Status stopped(const PlyElement& element, double read) const {
    return damage_.empty() ? truncated(element, read) : Status(unreadable(name_, "is damaged: " + damage_));
  }

  Status skip(const PlyElement& element) {
    for (double k = 0.0; k < element.count && !element.properties.empty(); ++k)
      for (const PlyProperty& property : element.properties)
        if (!skip(property)) return stopped(element, k);
    return Done{};
  }

  /// u and v of vertices, by the names that programs give them.
  static std::array<const char*, 2> textureNames(const PlyElement& element) {
    constexpr std::array<const char*, 2> kNames[] = {
        {"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}};
    const auto has = [&](const char* name) {
      return std::any_of(element.properties.begin(), element.properties.end(), [&](const PlyProperty& one) {
        return one.name == name && one.size == PlyType::kNone && isReal(one.type);
      });
    };
    for (const auto& names : kNames)
      if (has(names[0]) && has(names[1])) return names;
    return {"", ""};
  }

  Status readVertices(const PlyElement& element) {
    const std::array<const char*, 2> of_texture = textureNames(element);
    const bool textured = *of_texture[0] != '\0';
    std::vector<int> axis;  // x, y, z, u, v; below 0: none of them
    int found = 0;
    for (const PlyProperty& property : element.properties) {
      const std::size_t d = property.name.size() == 1 ? std::string("xyz").find(property.name) : std::string::npos;
      const bool is = d != std::string::npos && property.size == PlyType::kNone && isReal(property.type);
      const auto uv = std::find(of_texture.begin(), of_texture.end(), property.name) - of_texture.begin();
      axis.push_back(is ? static_cast<int>(d) : uv < 2 ? 3 + static_cast<int>(uv) : -1);
      found += is;
    }
    if (found != 3)
      return unreadable(name_, "has a damaged header: its vertices have no x, y and z of float or double");
    for (double k = 0.0; k < element.count; ++k) {
      Eigen::Matrix<double, 5, 1> p = Eigen::Matrix<double, 5, 1>::Zero();
      for (std::size_t n = 0; n < axis.size(); ++n) {
        if (axis[n] < 0) {
          if (!skip(element.properties[n])) return stopped(element, k);
          continue;
        }
        const std::optional<double> x = next(element.properties[n].type);
        if (!x) return stopped(element, k);
        p[axis[n]] = *x;
      }
      found_.points.push_back(p.head<3>());
      if (textured) textures_.push_back({static_cast<float>(p[3]), static_cast<float>(p[4])});
    }
    return Done{};
  }

  bool readTexture(const PlyProperty& property, std::vector<float>& list) {
    const std::optional<double> size = nextSize(property.size);
    list.clear();
    for (double k = 0.0; size && k < *size; ++k) {
      const std::optional<double> x = next(property.type);
      if (!x) return false;
      list.push_back(static_cast<float>(*x));
    }
    return size.has_value();
  }

  /// Of a face: those in its list, or of its vertices.
  void addTexture(const std::vector<std::int64_t>& nodes, const std::vector<float>* list) {
    FileTexture& to = found_.texture;
    if (list && list->size() != 2 * nodes.size())
      to.fault = "a face of " + std::to_string(nodes.size()) + " corners has " + std::to_string(list->size()) +
                 " numbers for them; accepted: two a corner";
    if (!to.fault.empty()) return to.corners.clear();
    for (std::size_t c = 0; c < nodes.size(); ++c)
      to.corners.push_back(list ? TexturePoint{(*list)[2 * c], (*list)[2 * c + 1]}
                                : textures_[static_cast<std::size_t>(nodes[c])]);
  }

  Status readFaces(const PlyElement& element) {
    constexpr int kVtkPolygon = 7;
    const auto corners = std::find_if(element.properties.begin(), element.properties.end(), [](const PlyProperty& one) {
      return one.name == "vertex_indices" || one.name == "vertex_index";
    });
    if (corners == element.properties.end() || corners->size == PlyType::kNone || isReal(corners->type))
      return unreadable(name_, "has a damaged header: its faces have no list of vertex_indices of a whole-number type");
    const auto texture = std::find_if(element.properties.begin(), element.properties.end(), [](const PlyProperty& one) {
      return one.name == "texcoord" && one.size != PlyType::kNone && isReal(one.type);
    });
    const bool listed = texture != element.properties.end();
    double all = 0.0;
    std::vector<std::int64_t> nodes;
    std::vector<float> list;
    for (double k = 0.0; k < element.count; ++k) {
      for (const PlyProperty& property : element.properties) {
        if (listed && &property == &*texture) {
          if (!readTexture(property, list)) return stopped(element, k);
          continue;
        }
        if (&property != &*corners) {
          if (!skip(property)) return stopped(element, k);
          continue;
        }
        const std::optional<double> size = nextSize(property.size);
        if (!size) return stopped(element, k);
        if (Status status = checkCounts(name_, 1.0, 0.0, all += *size); !status) return status;
        nodes.clear();
        for (double c = 0.0; c < *size; ++c) {
          const std::optional<double> node = next(property.type);
          if (!node) return stopped(element, k);
          // What is none names no point.
          nodes.push_back(*node == std::floor(*node) && std::abs(*node) < 1e15 ? static_cast<std::int64_t>(*node) : -1);
        }
      }
      if (nodes.size() < 3) continue;  // a point or an edge
      if (const std::string fault = found_.add(kVtkPolygon, nodes.data(), nodes.size()); !fault.empty())
        return unreadable(name_, "is damaged: its face " + std::to_string(static_cast<std::size_t>(k)) + " " + fault);
      if (listed || !textures_.empty()) addTexture(nodes, listed ? &list : nullptr);
    }
    return Done{};
  }

  const std::string& name_;
  const std::string_view text_;
  std::string_view rest_;
  bool ascii_ = false, big_endian_ = false;
  std::size_t line_ = 0;
  std::string damage_;
  std::vector<PlyElement> elements_;
  std::vector<TexturePoint> textures_;  // of vertices; empty: they have none
  CellsOfFile found_;
};

}  // namespace

Result<CellsOfFile> readPlyCells(const std::string& name, std::string_view text) {
  return PlyReader(name, text).read();
}

}  // namespace meshless
