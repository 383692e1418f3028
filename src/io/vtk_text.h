// Legacy VTK files: lines with keywords, and blocks of numbers in text or binary.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "mesh_format.h"
#include "text_words.h"

namespace meshless {

constexpr std::size_t kMaxKeywords = 300;  // characters of a line with keywords that are looked at

template <class T>
T bigEndian(const char* at) {
  char bytes[sizeof(T)];
  std::reverse_copy(at, at + sizeof(T), bytes);  // every machine that ROS runs on is little-endian
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
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
    const std::size_t size = !binary                                                        ? 2  // a digit and a blank
                             : type == "float" || type == "int" || type == "vtktypeint32"   ? 4
                             : type == "double" || type == "vtktypeint64" || type == "long" ? 8
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
      if (type == "int" || type == "vtktypeint32") values.push_back(valueOf<Number>(bigEndian<std::int32_t>(from)));
      if (type == "vtktypeint64" || type == "long")
        values.push_back(valueOf<Number>(static_cast<double>(bigEndian<std::int64_t>(from))));
    }
    if (binary) rest_.remove_prefix(n * size);
    return true;
  }

 private:
  std::string_view rest_;
};

/// What the header of a legacy file says.
struct VtkHead {
  bool offsets = false;  // from version 5 on, cells are two arrays, the first with one entry more than there are cells
  bool binary = false;
  std::string dataset;  // in lower case; empty where there is none
};

inline Result<VtkHead> readVtkHead(const std::string& name, std::string_view whole, VtkText& text) {
  VtkHead head;
  const std::string version = text.line();
  const std::size_t version_at = version.find("vtk datafile version");
  if (version_at == std::string::npos)
    return unreadable(name, "is no legacy VTK file: it does not begin with '# vtk DataFile Version'");
  head.offsets = std::strtod(version.c_str() + version_at + 20, nullptr) >= 5.0;
  text.line();  // the title
  const std::string format = text.line();
  head.binary = format.find("binary") != std::string::npos;
  if (!head.binary && format.find("ascii") == std::string::npos)
    return unreadable(name, "is neither ASCII nor BINARY, or truncated");
  if (!head.binary)
    if (const std::string fault = notText(whole); !fault.empty()) return unreadable(name, fault);
  const std::vector<std::string> words = text.words();
  if (words.size() == 2 && words[0] == "dataset") head.dataset = words[1];
  return head;
}

/// The cells as VTK wrote them before version 5: for each its size, then its corners. false where the block is damaged.
inline bool readCells(VtkText& text, bool binary, bool offsets, double n, double size,
                      std::vector<std::int32_t>& cells) {
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

}  // namespace meshless
