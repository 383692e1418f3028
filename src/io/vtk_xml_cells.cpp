// VTK's XML format ("VTK File Formats", kitware), as far as the points and cells of unstructured grids and PolyData go.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <zlib.h>

#include "cells_of_file.h"
#include "mesh_format.h"
#include "text_words.h"

namespace meshless {
namespace {

constexpr std::size_t kMostPieces = 10000;
constexpr std::size_t kMaxTagDepth = 64;    // of tags in each other
constexpr double kMostPacked = 1040.0;      // bytes that zlib makes of one, at most
constexpr std::size_t kMaxBlock = 1 << 30;  // bytes

using Attributes = std::map<std::string, std::string>;

struct VtuArray {
  Attributes attributes;
  std::string_view text;  // within its tags
  bool there = false;
};

struct VtuPiece {
  Attributes attributes;
  VtuArray points, connectivity, offsets, types;
  VtuArray polygons, polygon_ends, strips, strip_ends;  // of PolyData
};

/// What the tags say; nothing is decoded yet.
struct VtuFile {
  Attributes head, appended;
  std::string_view appended_data;  // from behind the underscore
  std::vector<VtuPiece> pieces;
};

/// Bytes as they are, or spelled as base64, perhaps as several texts one behind the other, each padded.
class ByteSource {
 public:
  ByteSource(std::string_view from, bool base64) : rest_(from), base64_(base64) {}

  /// false where there are fewer.
  bool take(std::size_t n, std::string& bytes) {
    bytes.clear();
    if (!(static_cast<double>(n) <= most())) return false;
    if (!base64_) {
      bytes.assign(rest_.substr(0, n));
      rest_.remove_prefix(n);
      return true;
    }
    bytes.reserve(n);
    while (bytes.size() < n) {
      if (held_ == held_end_ && !decodeFour()) return false;
      while (held_ < held_end_ && bytes.size() < n) bytes.push_back(four_[held_++]);
    }
    return true;
  }
  /// Bytes that may still come.
  double most() const {
    return base64_ ? 0.75 * static_cast<double>(rest_.size()) + 3.0 : static_cast<double>(rest_.size());
  }

 private:
  static int valueOfDigit(char c) {
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
  }
  bool decodeFour() {
    std::uint32_t bits = 0;
    int digits = 0, padding = 0;
    while (digits + padding < 4) {
      if (rest_.empty()) return false;
      const char c = rest_.front();
      rest_.remove_prefix(1);
      if (isBlank(c)) continue;
      const int value = c == '=' ? 0 : valueOfDigit(c);
      if (value < 0 || (c != '=' && padding > 0)) return false;
      (c == '=' ? padding : digits)++;
      bits = bits << 6 | static_cast<std::uint32_t>(value);
    }
    if (digits < 2) return false;
    for (int k = 0; k < 3; ++k) four_[k] = static_cast<char>(bits >> (16 - 8 * k) & 0xff);
    held_ = 0;
    held_end_ = digits - 1;
    return true;
  }

  std::string_view rest_;
  bool base64_;
  char four_[3] = {};
  int held_ = 0, held_end_ = 0;
};

std::string attribute(const Attributes& of, const std::string& key, const std::string& otherwise = "") {
  const auto at = of.find(key);
  return at == of.end() ? otherwise : at->second;
}

/// The tags of a file. What is wrong, or empty.
class VtuTags {
 public:
  explicit VtuTags(std::string_view text) : rest_(text) {}

  std::string read(VtuFile& file) {
    while (true) {
      const std::size_t at = rest_.find('<');
      const std::string_view between = rest_.substr(0, at);
      // The first text in an array is its numbers; tags with keys may come behind.
      if (array_ && !open_.empty() && open_.back() == "DataArray" && array_->text.empty() &&
          between.find_first_not_of(" \t\r\n") != std::string_view::npos)
        array_->text = between;
      if (at == std::string_view::npos) return "is truncated: it has no </VTKFile>";
      rest_.remove_prefix(at);
      if (skip("<!--", "-->") || skip("<?", "?>")) continue;
      if (rest_.substr(0, 2) == "<!") return "has a document type or CDATA; accepted: tags and comments";
      const std::size_t end = tagEnd();
      if (end == std::string_view::npos) return "is truncated, or has a tag of more than 65536 characters";
      std::string_view tag = rest_.substr(1, end - 1);
      rest_.remove_prefix(end + 1);
      if (!tag.empty() && tag[0] == '/') {
        tag.remove_prefix(1);
        const std::string name(nextWord(tag));
        if (open_.empty() || open_.back() != name) return "is damaged: </" + printable(name) + "> ends nothing";
        open_.pop_back();
        if (name == "DataArray") array_ = nullptr;
        if (open_.empty()) return name == "VTKFile" ? "" : "is no VTK XML file: it does not begin with <VTKFile";
        continue;
      }
      const bool closed = !tag.empty() && tag.back() == '/';
      if (closed) tag.remove_suffix(1);
      const std::string name(nextWord(tag));
      Attributes attributes;
      if (name.empty() || !readAttributes(tag, attributes))
        return "is damaged: the tag '" + printable(name) + "' is none";
      if (open_.empty() && name != "VTKFile") return "is no VTK XML file: it does not begin with <VTKFile";
      if (const std::string fault = enter(name, std::move(attributes), file); !fault.empty()) return fault;
      if (closed) {
        array_ = nullptr;
        if (open_.empty()) return "";
        continue;
      }
      if (open_.size() >= kMaxTagDepth) return "has tags in each other more than 64 deep";
      open_.push_back(name);
      if (name == "AppendedData") {
        const std::size_t from = rest_.find_first_not_of(" \t\r\n");
        if (from == std::string_view::npos || rest_[from] != '_')
          return "is damaged: its AppendedData do not begin with _";
        rest_.remove_prefix(from + 1);
        // They may hold any bytes, so that only the end of the file tells theirs.
        const std::size_t to = rest_.rfind("</AppendedData>");
        if (to == std::string_view::npos || rest_.find("</VTKFile>", to) == std::string_view::npos)
          return "is truncated: it has no </AppendedData> and </VTKFile>";
        file.appended_data = rest_.substr(0, to);
        return "";
      }
    }
  }

 private:
  bool skip(std::string_view from, std::string_view to) {
    if (rest_.substr(0, from.size()) != from) return false;
    const std::size_t end = rest_.find(to, from.size());
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + to.size());
    return true;
  }
  /// Where the tag at the start ends: at > outside of quotes.
  std::size_t tagEnd() const {
    char quote = '\0';
    for (std::size_t k = 1; k < std::min(rest_.size(), kMaxLine); ++k) {
      const char c = rest_[k];
      if (quote != '\0') {
        if (c == quote) quote = '\0';
      } else if (c == '"' || c == '\'') {
        quote = c;
      } else if (c == '>') {
        return k;
      }
    }
    return std::string_view::npos;
  }
  static bool readAttributes(std::string_view text, Attributes& attributes) {
    while (true) {
      const std::size_t from = text.find_first_not_of(" \t\r\n");
      if (from == std::string_view::npos) return true;
      const std::size_t equals = text.find('=', from);
      if (equals == std::string_view::npos) return false;
      std::string_view key = text.substr(from, equals - from);
      const std::size_t quote = text.find_first_not_of(" \t\r\n", equals + 1);
      if (quote == std::string_view::npos || (text[quote] != '"' && text[quote] != '\'')) return false;
      const std::size_t end = text.find(text[quote], quote + 1);
      if (end == std::string_view::npos) return false;
      attributes[std::string(nextWord(key))] = std::string(text.substr(quote + 1, end - quote - 1));
      text.remove_prefix(end + 1);
    }
  }
  std::string enter(const std::string& name, Attributes&& attributes, VtuFile& file) {
    array_ = nullptr;
    const std::string parent = open_.empty() ? "" : open_.back();
    if (name == "VTKFile") {
      file.head = std::move(attributes);
    } else if (name == "AppendedData") {
      file.appended = std::move(attributes);
    } else if (name == "Piece" && (parent == "UnstructuredGrid" || parent == "PolyData")) {
      if (file.pieces.size() >= kMostPieces) return "has more than 10000 pieces";
      file.pieces.emplace_back();
      file.pieces.back().attributes = std::move(attributes);
    } else if (name == "DataArray" && !file.pieces.empty() &&
               (parent == "Points" || parent == "Cells" || parent == "Polys" || parent == "Strips")) {
      VtuPiece& piece = file.pieces.back();
      const std::string of = parent == "Points" ? parent : attribute(attributes, "Name");
      const bool polys = parent == "Polys", strips = parent == "Strips";
      VtuArray* array = of == "Points"         ? &piece.points
                        : of == "connectivity" ? &(polys    ? piece.polygons
                                                   : strips ? piece.strips
                                                            : piece.connectivity)
                        : of == "offsets"      ? &(polys    ? piece.polygon_ends
                                                   : strips ? piece.strip_ends
                                                            : piece.offsets)
                        : of == "types"        ? &piece.types
                                               : nullptr;
      if (!array) return "";
      if (array->there) return "has the array '" + of + "' twice in one piece";
      array->there = true;
      array->attributes = std::move(attributes);
      array_ = array;
    }
    return "";
  }

  std::string_view rest_;
  std::vector<std::string> open_;
  VtuArray* array_ = nullptr;  // whose text comes next; no piece is added within one
};

/// Numbers of the arrays of one file.
class VtuNumbers {
 public:
  VtuNumbers(const std::string& name, const VtuFile& file)
      : name_(name),
        file_(file),
        swapped_(attribute(file.head, "byte_order", "LittleEndian") == "BigEndian"),
        wide_(attribute(file.head, "header_type", "UInt32") == "UInt64"),
        packed_(!attribute(file.head, "compressor").empty()) {}

  /// `count` of them as Number; what cannot be one of its numbers is -1. `what` is for messages.
  template <class Number>
  Status read(const VtuArray& array, const std::string& what, std::size_t count, std::vector<Number>& values) const {
    values.clear();
    const auto bad = [&](const std::string& how) { return unreadable(name_, "is damaged: its " + what + " " + how); };
    if (!array.there) return bad("are not there");
    if (count == 0) return Done{};
    const std::string format = attribute(array.attributes, "format", "ascii");
    if (format == "ascii") {
      std::string_view rest = array.text;
      if (count > rest.size() / 2 + 1) return bad("hold fewer than " + std::to_string(count) + " numbers");
      values.reserve(count);
      for (std::size_t k = 0; k < count; ++k) {
        const std::string_view word = nextWord(rest);
        if (word.empty()) return bad("hold " + std::to_string(k) + " of " + std::to_string(count) + " numbers");
        const std::optional<double> x = numberOf(word);
        if (!x) return bad("hold '" + printable(std::string(word.substr(0, 60))) + "', which is no number");
        values.push_back(numberAs<Number>(*x));
      }
      return Done{};
    }
    const std::string type = attribute(array.attributes, "type");
    const std::size_t size = sizeOf(type);
    if (size == 0)
      return bad("are of the type '" + printable(type) +
                 "'; accepted: Float32, Float64, Int8 to Int64, UInt8 to UInt64");
    std::string_view from = array.text;
    bool base64 = true;
    if (format == "appended") {
      const double offset = countOf(attribute(array.attributes, "offset"));
      if (!(offset < static_cast<double>(file_.appended_data.size())))
        return bad("begin behind the end of the AppendedData");
      from = file_.appended_data.substr(static_cast<std::size_t>(offset));
      base64 = attribute(file_.appended, "encoding") != "raw";
    } else if (format != "binary") {
      return bad("are of the format '" + printable(format) + "'; accepted: ascii, binary, appended");
    }
    std::string bytes;
    ByteSource source(from, base64);
    if (const std::string fault = packed_ ? unpack(source, count * size, bytes) : plain(source, count * size, bytes);
        !fault.empty())
      return bad(fault);
    values.reserve(count);
    for (std::size_t k = 0; k < count; ++k) values.push_back(numberAs<Number>(at(type, bytes.data() + k * size)));
    return Done{};
  }

 private:
  template <class Number>
  static Number numberAs(double x) {
    if constexpr (std::is_same_v<Number, double>) return x;
    return x >= 0.0 && x <= 1e15 && x == std::floor(x) ? static_cast<Number>(x) : Number{-1};
  }
  static std::size_t sizeOf(const std::string& type) {
    if (type == "Int8" || type == "UInt8") return 1;
    if (type == "Int16" || type == "UInt16") return 2;
    if (type == "Int32" || type == "UInt32" || type == "Float32") return 4;
    return type == "Int64" || type == "UInt64" || type == "Float64" ? 8 : 0;
  }
  template <class T>
  double numberAt(const char* from) const {
    char bytes[sizeof(T)];
    std::memcpy(bytes, from, sizeof(T));
    if (swapped_) std::reverse(bytes, bytes + sizeof(T));
    T value;
    std::memcpy(&value, bytes, sizeof(T));
    return static_cast<double>(value);
  }
  double at(const std::string& type, const char* from) const {
    if (type == "Float32") return numberAt<float>(from);
    if (type == "Float64") return numberAt<double>(from);
    if (type == "Int8") return numberAt<std::int8_t>(from);
    if (type == "UInt8") return numberAt<std::uint8_t>(from);
    if (type == "Int16") return numberAt<std::int16_t>(from);
    if (type == "UInt16") return numberAt<std::uint16_t>(from);
    if (type == "Int32") return numberAt<std::int32_t>(from);
    if (type == "UInt32") return numberAt<std::uint32_t>(from);
    if (type == "Int64") return numberAt<std::int64_t>(from);
    return numberAt<std::uint64_t>(from);
  }
  /// The next number of a header; NaN where the data end.
  double headerNumber(ByteSource& source) const {
    std::string bytes;
    if (!source.take(wide_ ? 8 : 4, bytes)) return std::nan("");
    return wide_ ? numberAt<std::uint64_t>(bytes.data()) : numberAt<std::uint32_t>(bytes.data());
  }

  // Each: what is wrong, or empty.

  std::string plain(ByteSource& source, std::size_t size, std::string& bytes) const {
    const double promised = headerNumber(source);
    if (!(promised == static_cast<double>(size))) return "are truncated, or not as long as their number says";
    return source.take(size, bytes) ? "" : "are truncated";
  }

  std::string unpack(ByteSource& source, std::size_t size, std::string& bytes) const {
    const double blocks = headerNumber(source), block = headerNumber(source), last = headerNumber(source);
    const double whole = last > 0.0 ? (blocks - 1.0) * block + last : blocks * block;
    if (!(blocks >= 1.0 && block >= 1.0 && block <= static_cast<double>(kMaxBlock) && last <= block &&
          whole == static_cast<double>(size)))
      return "are truncated, or not as long as their number says";
    if (!(blocks * (wide_ ? 8.0 : 4.0) <= source.most() && static_cast<double>(size) <= kMostPacked * source.most()))
      return "are truncated: they promise " + std::to_string(size) + " bytes";
    std::vector<double> packed_sizes;
    for (double k = 0.0; k < blocks; ++k) packed_sizes.push_back(headerNumber(source));
    bytes.resize(size);
    std::size_t done = 0;
    std::string packed;
    for (const double packed_size : packed_sizes) {
      if (!(packed_size <= static_cast<double>(compressBound(static_cast<uLong>(block)))))
        return "have a block that is larger than its contents can be";
      if (!(packed_size <= source.most()) || !source.take(static_cast<std::size_t>(packed_size), packed))
        return "are truncated";
      const std::size_t wanted = std::min(static_cast<std::size_t>(block), size - done);
      uLongf got = static_cast<uLongf>(wanted);
      if (uncompress(reinterpret_cast<Bytef*>(&bytes[done]), &got, reinterpret_cast<const Bytef*>(packed.data()),
                     static_cast<uLong>(packed.size())) != Z_OK ||
          got != wanted)
        return "cannot be decompressed";
      done += wanted;
    }
    return done == size ? "" : "are truncated";
  }

  const std::string& name_;
  const VtuFile& file_;
  bool swapped_, wide_, packed_;
};

/// So many cells: the end of each in `ends`, the corners in `connectivity`, `types` of VTK or all of one type.
Status readCells(const std::string& name, const VtuNumbers& numbers, std::size_t size, const VtuArray& connectivity,
                 const VtuArray& ends, const VtuArray* types, int type, std::int64_t first, CellsOfFile& found,
                 double& corners) {
  std::vector<std::int64_t> offsets, kinds, nodes;
  if (Status status = numbers.read(ends, "offsets", size, offsets); !status) return status;
  if (types)
    if (Status status = numbers.read(*types, "types", size, kinds); !status) return status;
  std::int64_t end = 0;
  for (std::size_t k = 0; k < offsets.size(); ++k) {
    if (offsets[k] < end)
      return unreadable(name, "is damaged: the offset of cell " + std::to_string(k) + " is " +
                                  std::to_string(offsets[k]) + "; accepted: not below " + std::to_string(end));
    end = offsets[k];
  }
  corners += static_cast<double>(end);
  if (Status status = checkCounts(name, 1.0, 0.0, corners); !status) return status;
  if (Status status = numbers.read(connectivity, "connectivity", static_cast<std::size_t>(end), nodes); !status)
    return status;
  // Corners are counted within their piece.
  const auto points = static_cast<std::int64_t>(found.points.size()) - first;
  for (std::int64_t& node : nodes) node = node >= 0 && node < points ? node + first : -1;
  std::int64_t from = 0;
  for (std::size_t k = 0; k < offsets.size(); ++k) {
    const auto count = static_cast<std::size_t>(offsets[k] - from);
    const int kind = types ? static_cast<int>(std::min<std::int64_t>(kinds[k], 1000)) : type;
    const std::string fault = types || count > 2 ? found.add(kind, nodes.data() + from, count) : "";
    if (!fault.empty()) return unreadable(name, "is damaged: cell " + std::to_string(k) + " " + fault);
    if (found.polygon_count > kMaxFaces) return checkCounts(name, 1.0, static_cast<double>(found.polygon_count), 0.0);
    from = offsets[k];
  }
  return Done{};
}

Status readPiece(const std::string& name, const VtuPiece& piece, bool poly_data, const VtuNumbers& numbers,
                 CellsOfFile& found, double& cells, double& corners) {
  constexpr int kPolygon = 7, kStrip = 6;
  const auto count = [&](const char* key) { return countOf(attribute(piece.attributes, key, poly_data ? "0" : "")); };
  const double n = count("NumberOfPoints"), size = poly_data ? count("NumberOfPolys") : count("NumberOfCells"),
               strips = poly_data ? count("NumberOfStrips") : 0.0;
  if (std::isnan(n) || std::isnan(size) || std::isnan(strips))
    return unreadable(name, std::string("has a Piece without NumberOfPoints and ") +
                                (poly_data ? "NumberOfPolys" : "NumberOfCells") + "; accepted: whole numbers");
  if (n == 0.0 && size == 0.0 && strips == 0.0) return Done{};
  const auto first = static_cast<std::int64_t>(found.points.size());
  cells += size + strips;
  if (Status status = checkCounts(name, static_cast<double>(first) + n, cells, 0.0); !status) return status;
  const std::string components = attribute(piece.points.attributes, "NumberOfComponents", "3");
  if (components != "3") return unreadable(name, "has points of " + printable(components) + " numbers; accepted: 3");
  const auto points = static_cast<std::size_t>(n);
  {
    std::vector<double> coordinates;
    if (Status status = numbers.read(piece.points, "points", 3 * points, coordinates); !status) return status;
    for (std::size_t k = 0; k < points; ++k)
      found.points.emplace_back(coordinates[3 * k], coordinates[3 * k + 1], coordinates[3 * k + 2]);
  }
  const auto whole = static_cast<std::size_t>(size);
  if (!poly_data)
    return readCells(name, numbers, whole, piece.connectivity, piece.offsets, &piece.types, 0, first, found, corners);
  if (whole > 0)
    if (Status status = readCells(name, numbers, whole, piece.polygons, piece.polygon_ends, nullptr, kPolygon, first,
                                  found, corners);
        !status)
      return status;
  if (strips > 0.0)
    return readCells(name, numbers, static_cast<std::size_t>(strips), piece.strips, piece.strip_ends, nullptr, kStrip,
                     first, found, corners);
  return Done{};
}

}  // namespace

Result<CellsOfFile> readVtkXmlCells(const std::string& name, std::string_view text) {
  VtuFile file;
  if (const std::string fault = VtuTags(text).read(file); !fault.empty()) return unreadable(name, fault);
  const std::string type = attribute(file.head, "type");
  if (type != "UnstructuredGrid" && type != "PolyData")
    return unreadable(name, "is of the type '" + printable(type) + "'; accepted: PolyData, UnstructuredGrid");
  const std::string compressor = attribute(file.head, "compressor", "vtkZLibDataCompressor");
  if (compressor != "vtkZLibDataCompressor")
    return unreadable(name,
                      "is compressed by '" + printable(compressor) + "'; accepted: vtkZLibDataCompressor or none");
  const VtuNumbers numbers(name, file);
  CellsOfFile found;
  double cells = 0.0, corners = 0.0;
  for (const VtuPiece& piece : file.pieces)
    if (Status status = readPiece(name, piece, type == "PolyData", numbers, found, cells, corners); !status)
      return status.error();
  if (found.points.empty()) return Error{ErrorCode::kUnsuitableShape, "'" + name + "' has no points"};
  return found;
}

}  // namespace meshless
