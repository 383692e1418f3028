// Gmsh's format, as its manual describes it ("MSH file format" for 4.1, "legacy" for 2.2).
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <unordered_set>
#include <utility>
#include <vector>

#include "cells_of_file.h"
#include "mesh_format.h"
#include "text_words.h"

namespace meshless {
namespace {

/// A type of Gmsh: how many nodes it has, and the type of VTK whose corners come in the same order.
struct GmshType {
  int gmsh;
  std::size_t nodes;
  int vtk;
};
constexpr int kCurvedTriangle = 22, kCurvedQuad = 23, kCurvedTetrahedron = 24, kCurvedHexahedron = 25,
              kCurvedWedge = 26, kCurvedPyramid = 27;
constexpr GmshType kGmshTypes[] = {
    {1, 2, kVtkLine},
    {2, 3, kVtkTriangle},
    {3, 4, kVtkQuad},
    {4, 4, kVtkTetrahedron},
    {5, 8, kVtkHexahedron},
    {6, 6, kVtkWedge},
    {7, 5, kVtkPyramid},
    {8, 3, kVtkLine},
    {9, 6, kCurvedTriangle},
    {10, 9, kCurvedQuad},
    {11, 10, kCurvedTetrahedron},
    {12, 27, kCurvedHexahedron},
    {13, 18, kCurvedWedge},
    {14, 14, kCurvedPyramid},
    {15, 1, kVtkVertex},
    {16, 8, kCurvedQuad},
    {17, 20, kCurvedHexahedron},
    {18, 15, kCurvedWedge},
    {19, 13, kCurvedPyramid},
    {20, 9, kCurvedTriangle},
    {21, 10, kCurvedTriangle},
    {22, 12, kCurvedTriangle},
    {23, 15, kCurvedTriangle},
    {24, 15, kCurvedTriangle},
    {25, 21, kCurvedTriangle},
    {26, 4, kVtkLine},
    {27, 5, kVtkLine},
    {28, 6, kVtkLine},
    {29, 20, kCurvedTetrahedron},
    {30, 35, kCurvedTetrahedron},
    {31, 56, kCurvedTetrahedron},
    {36, 16, kCurvedQuad},
    {37, 25, kCurvedQuad},
    {38, 36, kCurvedQuad},
    {92, 64, kCurvedHexahedron},
    {93, 125, kCurvedHexahedron},
};

/// The nodes' numbers, which may be any, and where their points are.
class NodeNumbers {
 public:
  void add(std::int64_t tag, Index index) {
    sorted_ = sorted_ && (nodes_.empty() || nodes_.back().first < tag);
    nodes_.emplace_back(tag, index);
  }
  void reserve(std::size_t n) { nodes_.reserve(n); }
  /// A number that is there twice, or -1.
  std::int64_t sort() {
    if (sorted_) return -1;
    std::sort(nodes_.begin(), nodes_.end());
    for (std::size_t k = 1; k < nodes_.size(); ++k)
      if (nodes_[k].first == nodes_[k - 1].first) return nodes_[k].first;
    return -1;
  }
  std::int64_t indexOf(std::int64_t tag) const {
    const auto at = std::lower_bound(nodes_.begin(), nodes_.end(), std::pair<std::int64_t, Index>(tag, 0));
    return at != nodes_.end() && at->first == tag ? static_cast<std::int64_t>(at->second) : -1;
  }

 private:
  std::vector<std::pair<std::int64_t, Index>> nodes_;
  bool sorted_ = true;
};

class GmshReader {
 public:
  GmshReader(const std::string& name, std::string_view text) : name_(name), rest_(text) {}

  Result<CellsOfFile> read() {
    if (Status status = readFormat(); !status) return status.error();
    if (!binary_)
      if (const std::string fault = notText(rest_); !fault.empty()) return unreadable(name_, fault);
    bool has_nodes = false;
    for (std::string section; nextSection(section);) {
      if (section == "Nodes") {
        if (has_nodes) return unreadable(name_, "has $Nodes twice");
        if (Status status = version_ >= 4.0 ? readNodes4() : readNodes2(); !status) return status.error();
        if (const std::int64_t twice = numbers_.sort(); twice >= 0)
          return unreadable(name_, "has the node " + std::to_string(twice) + " twice");
        has_nodes = true;
      } else if (section == "Elements") {
        if (!has_nodes) return unreadable(name_, "has no $Nodes before its $Elements");
        if (Status status = version_ >= 4.0 ? readElements4() : readElements2(); !status) return status.error();
        if (Status status = endOf(section); !status) return status.error();
        return std::move(found_);
      }
      if (Status status = endOf(section); !status) return status.error();
    }
    return unreadable(name_, "has no $Nodes and $Elements, or is truncated");
  }

 private:
  Status truncated(const std::string& section) const {
    return unreadable(name_, "is truncated or damaged in its $" + section);
  }

  Status readFormat() {
    std::string_view line;
    std::vector<std::string> words;
    while (words.empty() && nextLine(rest_, line)) words = wordsOf(line.substr(0, kMaxLine));
    if (words.size() != 1 || words[0] != "$MeshFormat" || !nextLine(rest_, line))
      return unreadable(name_, "is no Gmsh file: it does not begin with $MeshFormat");
    words = wordsOf(line.substr(0, kMaxLine));
    const std::optional<double> version = words.size() == 3 ? numberOf(words[0]) : std::nullopt;
    if (!version || !((*version >= 2.0 && *version <= 2.2) || *version == 4.1))
      return unreadable(name_, "is of the version '" + (words.empty() ? "" : printable(words[0])) +
                                   "' of Gmsh's format; accepted: 2 to 2.2 and 4.1");
    version_ = *version;
    if ((words[1] != "0" && words[1] != "1") || words[2] != "8")
      return unreadable(name_, "has the file type '" + printable(words[1]) + "' and numbers of '" +
                                   printable(words[2]) + "' bytes; accepted: 0 or 1, and 8");
    binary_ = words[1] == "1";
    if (binary_) {
      std::uint32_t one = 0;
      if (rest_.size() < sizeof one) return truncated("MeshFormat");
      std::memcpy(&one, rest_.data(), sizeof one);
      rest_.remove_prefix(sizeof one);
      if (one != 1 && one != 0x01000000)
        return unreadable(name_, "has the number " + std::to_string(one) + " where a binary file has 1");
      swapped_ = one != 1;
    }
    return endOf("MeshFormat");
  }

  /// The next line that begins with $, without it.
  bool nextSection(std::string& section) {
    for (std::string_view line; nextLine(rest_, line);) {
      const std::vector<std::string> words = wordsOf(line.substr(0, 300));
      if (words.empty() || words[0][0] != '$') continue;
      section = words[0].substr(1);
      return true;
    }
    return false;
  }

  /// Goes on behind the end of it; what is between is not looked at.
  Status endOf(const std::string& section) {
    const std::string end = "$End" + section;
    const std::size_t at = rest_.find(end);
    if (at == std::string_view::npos) return unreadable(name_, "is truncated: it has no " + printable(end));
    rest_.remove_prefix(at + end.size());
    return Done{};
  }

  template <class T>
  bool binaryNumber(T& value) {
    if (rest_.size() < sizeof(T)) return false;
    char bytes[sizeof(T)];
    std::memcpy(bytes, rest_.data(), sizeof(T));
    if (swapped_) std::reverse(bytes, bytes + sizeof(T));
    std::memcpy(&value, bytes, sizeof(T));
    rest_.remove_prefix(sizeof(T));
    return true;
  }
  bool coordinate(double& x) {
    if (binary_) return binaryNumber(x);
    const std::optional<double> read = numberOf(nextWord(rest_));
    if (read) x = *read;
    return read.has_value();
  }
  /// A whole number, of 4 bytes in a binary file or as many as size_t has.
  bool whole(bool wide, std::int64_t& value) {
    if (binary_ && wide) return binaryNumber(value);
    if (binary_) {
      std::int32_t narrow = 0;
      if (!binaryNumber(narrow)) return false;
      value = narrow;
      return true;
    }
    const std::string_view word = nextWord(rest_);
    const std::size_t sign = !word.empty() && word[0] == '-';
    if (word.size() == sign || word.size() - sign > 18) return false;  // more would overflow
    value = 0;
    for (const char c : word.substr(sign)) {
      if (c < '0' || c > '9') return false;
      value = value * 10 + (c - '0');
    }
    if (sign) value = -value;
    return true;
  }
  bool number4(std::int64_t& value) { return whole(true, value); }
  bool number2(std::int64_t& value) { return whole(false, value); }

  /// Of points or cells: not more than are accepted, nor than the bytes that follow may hold.
  Status checkCount(const std::string& section, std::int64_t points, std::int64_t cells, std::size_t bytes_each) const {
    const auto n = static_cast<double>(std::max(points, cells));
    if (points < 0 || cells < 0) return truncated(section);
    if (Status status = checkCounts(name_, static_cast<double>(points), static_cast<double>(cells), 0.0); !status)
      return status;
    if (!(n * static_cast<double>(bytes_each) <= static_cast<double>(rest_.size())))
      return unreadable(name_, "is truncated or damaged: it promises " + std::to_string(static_cast<std::int64_t>(n)) +
                                   " of its $" + section);
    return Done{};
  }

  bool countLine(std::int64_t& n) {
    // Its line alone: what follows may be binary.
    std::string_view line;
    if (!nextLine(rest_, line)) return false;
    const std::vector<std::string> words = wordsOf(line.substr(0, 300));
    if (words.size() != 1 || !(countOf(words[0]) <= 1e18)) return false;
    n = static_cast<std::int64_t>(countOf(words[0]));
    return true;
  }

  Status readNodes2() {
    std::int64_t n = 0;
    if (!countLine(n)) return truncated("Nodes");
    if (Status status = checkCount("Nodes", n, 0, binary_ ? 28 : 8); !status) return status;
    found_.points.resize(static_cast<std::size_t>(n));
    numbers_.reserve(found_.points.size());
    for (std::size_t k = 0; k < found_.points.size(); ++k) {
      std::int64_t tag = 0;
      Vec3& p = found_.points[k];
      if (!number2(tag) || !coordinate(p[0]) || !coordinate(p[1]) || !coordinate(p[2])) return truncated("Nodes");
      numbers_.add(tag, static_cast<Index>(k));
    }
    return Done{};
  }

  Status readNodes4() {
    std::int64_t blocks = 0, n = 0, lowest = 0, highest = 0;
    if (!number4(blocks) || !number4(n) || !number4(lowest) || !number4(highest)) return truncated("Nodes");
    if (Status status = checkCount("Nodes", n, 0, binary_ ? 32 : 8); !status) return status;
    found_.points.reserve(static_cast<std::size_t>(n));
    numbers_.reserve(static_cast<std::size_t>(n));
    for (std::int64_t block = 0; block < blocks; ++block) {
      std::int64_t dimension = 0, entity = 0, parametric = 0, size = 0;
      if (!number2(dimension) || !number2(entity) || !number2(parametric) || !number4(size)) return truncated("Nodes");
      const std::size_t first = found_.points.size();
      if (dimension < 0 || dimension > 3 || size < 0 || size > n - static_cast<std::int64_t>(first))
        return truncated("Nodes");
      for (std::int64_t k = 0; k < size; ++k) {
        std::int64_t tag = 0;
        if (!number4(tag)) return truncated("Nodes");
        numbers_.add(tag, static_cast<Index>(first + static_cast<std::size_t>(k)));
      }
      for (std::int64_t k = 0; k < size; ++k) {
        Vec3 p;
        double parameter = 0.0;
        bool read = coordinate(p[0]) && coordinate(p[1]) && coordinate(p[2]);
        for (std::int64_t d = 0; read && parametric != 0 && d < dimension; ++d) read = coordinate(parameter);
        if (!read) return truncated("Nodes");
        found_.points.push_back(p);
      }
    }
    if (static_cast<std::int64_t>(found_.points.size()) != n) return truncated("Nodes");
    return Done{};
  }

  Status typeOf(std::int64_t type, const GmshType*& known) const {
    known = std::find_if(std::begin(kGmshTypes), std::end(kGmshTypes),
                         [&](const GmshType& one) { return one.gmsh == type; });
    if (known != std::end(kGmshTypes)) return Done{};
    return unreadable(name_,
                      "has elements of Gmsh's type " + std::to_string(type) +
                          "; accepted: points, lines, triangles, quads, tetrahedra, hexahedra, wedges and pyramids");
  }

  /// One element's nodes, as they come next.
  Status readElement(const GmshType& type, std::int64_t tag, bool wide) {
    std::int64_t nodes[125];
    for (std::size_t k = 0; k < type.nodes; ++k) {
      std::int64_t node = 0;
      if (!whole(wide, node)) return truncated("Elements");
      nodes[k] = numbers_.indexOf(node);
      if (nodes[k] < 0)
        return unreadable(name_, "is damaged: its element " + std::to_string(tag) + " has the node " +
                                     std::to_string(node) + ", which is not there");
    }
    // Version 2 writes an element anew for each physical group that it is in.
    if (version_ < 4.0 && !seen_.insert(keyOf(type, nodes)).second) {
      ++found_.repeated;
      return Done{};
    }
    if (const std::string fault = found_.add(type.vtk, nodes, type.nodes); !fault.empty())
      return unreadable(name_, "is damaged: its element " + std::to_string(tag) + " " + fault);
    return Done{};
  }

  /// The same for the same nodes, in whatever order.
  static std::uint64_t keyOf(const GmshType& type, const std::int64_t* nodes) {
    std::int64_t sorted[125];
    std::copy(nodes, nodes + type.nodes, sorted);
    std::sort(sorted, sorted + type.nodes);
    std::uint64_t key = static_cast<std::uint64_t>(type.gmsh);
    for (std::size_t k = 0; k < type.nodes; ++k) {
      key = (key ^ static_cast<std::uint64_t>(sorted[k])) * 0x9e3779b97f4a7c15ull;
      key ^= key >> 32;
    }
    return key;
  }

  Status readElements2() {
    std::int64_t n = 0;
    if (!countLine(n)) return truncated("Elements");
    if (Status status = checkCount("Elements", 1, n, binary_ ? 8 : 6); !status) return status;
    for (std::int64_t read = 0; read < n;) {
      std::int64_t tag = 0, type = 0, size = 1, tags = 0, ignored = 0;
      const bool head =
          binary_ ? number2(type) && number2(size) && number2(tags) : number2(tag) && number2(type) && number2(tags);
      if (!head || size < 1 || size > n - read || tags < 0) return truncated("Elements");
      const GmshType* known = nullptr;
      if (Status status = typeOf(type, known); !status) return status;
      for (std::int64_t k = 0; k < size; ++k, ++read) {
        if (binary_ && !number2(tag)) return truncated("Elements");
        for (std::int64_t t = 0; t < tags; ++t)
          if (!number2(ignored)) return truncated("Elements");
        if (Status status = readElement(*known, tag, false); !status) return status;
      }
    }
    return Done{};
  }

  Status readElements4() {
    std::int64_t blocks = 0, n = 0, lowest = 0, highest = 0;
    if (!number4(blocks) || !number4(n) || !number4(lowest) || !number4(highest)) return truncated("Elements");
    if (Status status = checkCount("Elements", 1, n, binary_ ? 16 : 4); !status) return status;
    std::int64_t read = 0;
    for (std::int64_t block = 0; block < blocks; ++block) {
      std::int64_t dimension = 0, entity = 0, type = 0, size = 0, tag = 0;
      if (!number2(dimension) || !number2(entity) || !number2(type) || !number4(size) || size < 0 || size > n - read)
        return truncated("Elements");
      const GmshType* known = nullptr;
      if (Status status = typeOf(type, known); !status) return status;
      for (std::int64_t k = 0; k < size; ++k, ++read) {
        if (!number4(tag)) return truncated("Elements");
        if (Status status = readElement(*known, tag, true); !status) return status;
      }
    }
    return read == n ? Status(Done{}) : truncated("Elements");
  }

  const std::string& name_;
  std::string_view rest_;
  double version_ = 0.0;
  bool binary_ = false, swapped_ = false;
  NodeNumbers numbers_;
  std::unordered_set<std::uint64_t> seen_;
  CellsOfFile found_;
};

}  // namespace

Result<CellsOfFile> readGmshCells(const std::string& name, std::string_view text) {
  return GmshReader(name, text).read();
}

}  // namespace meshless
