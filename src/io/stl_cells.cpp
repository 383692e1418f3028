// STL, binary and as text: triangles by their corners, which are one vertex where they are at the very same place.
#include <array>
#include <cstdint>
#include <cstring>
#include <unordered_map>
#include <vector>

#include "cells_of_file.h"
#include "mesh_format.h"
#include "text_words.h"

namespace meshless {
namespace {

constexpr std::size_t kStlHead = 84, kStlTriangle = 50;  // bytes

std::uint32_t countIn(std::string_view text) {
  std::uint32_t count = 0;
  if (text.size() >= kStlHead) std::memcpy(&count, text.data() + 80, sizeof count);
  return count;
}

class Triangles {
 public:
  explicit Triangles(CellsOfFile& to) : to_(to) {}

  bool tooMany() const { return to_.points.size() > kMaxPoints; }
  /// One with two corners at one place is none.
  void add(const std::array<Vec3, 3>& corners) {
    Triangle t;
    for (std::size_t k = 0; k < 3; ++k) t[k] = vertexAt(corners[k]);
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) return;
    to_.polygons.push_back(3);
    to_.polygons.insert(to_.polygons.end(), t.begin(), t.end());
    ++to_.polygon_count;
  }

 private:
  struct Hash {
    std::size_t operator()(const Vec3& p) const {
      std::size_t sum = 0;
      for (int k = 0; k < 3; ++k) sum = 31 * sum + std::hash<double>()(p[k]);
      return sum;
    }
  };
  Index vertexAt(const Vec3& p) {
    if (!p.allFinite()) {  // equal to no other one; the check of the mesh names it
      to_.points.push_back(p);
      return static_cast<Index>(to_.points.size() - 1);
    }
    const auto [found, is_new] = vertices_.try_emplace(p + Vec3::Zero(), static_cast<Index>(to_.points.size()));
    if (is_new) to_.points.push_back(p);
    return found->second;
  }

  CellsOfFile& to_;
  std::unordered_map<Vec3, Index, Hash> vertices_;
};

Status readBinary(const std::string& name, std::string_view text, Triangles& to) {
  const std::uint32_t count = countIn(text);
  if (count == 0) {
    if (text.size() < kStlHead + kStlTriangle)
      return Error{ErrorCode::kUnsuitableShape, "'" + name + "' has no triangles"};
    return unreadable(name, "promises 0 triangles at byte 80, and " + std::to_string(text.size() - kStlHead) +
                                " bytes follow; accepted: their number");
  }
  if (Status status = checkCounts(name, 1.0, count, 3.0 * count); !status) return status;
  const std::uint64_t needed = kStlHead + static_cast<std::uint64_t>(kStlTriangle) * count;
  if (text.size() < needed)
    return unreadable(name, "promises " + std::to_string(count) + " triangles, which are " + std::to_string(needed) +
                                " bytes, and has " + std::to_string(text.size()) + ": it is truncated");
  for (std::uint32_t k = 0; k < count; ++k) {
    std::array<float, 9> numbers;
    std::memcpy(numbers.data(), text.data() + kStlHead + kStlTriangle * k + 12, sizeof numbers);
    to.add({Vec3(numbers[0], numbers[1], numbers[2]), Vec3(numbers[3], numbers[4], numbers[5]),
            Vec3(numbers[6], numbers[7], numbers[8])});
    if (to.tooMany()) break;
  }
  return Done{};
}

Status readText(const std::string& name, std::string_view text, Triangles& to) {
  std::size_t line_number = 0, faces = 0, corner = 0;
  bool ended = false;
  std::array<Vec3, 3> corners;
  const auto bad = [&](const std::string& what) {
    return unreadable(name, "line " + std::to_string(line_number) + ": " + what);
  };
  for (std::string_view line; nextLine(text, line);) {
    ++line_number;
    for (std::string word; !(word = lowerCase(nextWord(line).substr(0, 20))).empty();) {
      if (word == "solid" || word == "endsolid") {  // its name follows, of any words
        ended = word == "endsolid";
        break;
      }
      if (word == "endloop") {
        if (corner != 3) return bad("a triangle has " + std::to_string(corner) + " corners; accepted: 3");
        to.add(corners);
        if (to.tooMany()) return Done{};
        if (++faces > kMaxFaces) return checkCounts(name, 1.0, static_cast<double>(faces), 0.0).error();
      }
      if (word == "outer" || word == "endloop") corner = 0;
      if (word != "vertex") continue;
      if (corner == 3) return bad("a triangle has more than 3 corners");
      for (int k = 0; k < 3; ++k) {
        const std::string_view number = nextWord(line);
        const std::optional<double> x = numberOf(number);
        if (!x)
          return bad(number.empty() ? "a corner has fewer than three numbers"
                                    : "'" + printable(std::string(number.substr(0, 60))) + "' is no number");
        corners[corner][k] = *x;
      }
      ++corner;
    }
  }
  if (!ended)
    return unreadable(name, "has no endsolid behind its " + std::to_string(faces) + " triangles: it is truncated");
  if (faces == 0) return Error{ErrorCode::kUnsuitableShape, "'" + name + "' has no triangles"};
  return Done{};
}

}  // namespace

// Binary files may begin with "solid", too, and texts with blanks.
Result<CellsOfFile> readStlCells(const std::string& name, std::string_view text) {
  CellsOfFile found;
  Triangles triangles(found);
  const bool exact =
      text.size() >= kStlHead && kStlHead + static_cast<std::uint64_t>(kStlTriangle) * countIn(text) == text.size();
  std::string_view rest = text.substr(0, kMaxHeader);
  const bool solid = lowerCase(nextWord(rest).substr(0, 6)) == "solid";
  const bool words = solid && lowerCase(text.substr(0, kMaxHeader)).find("facet") != std::string::npos;
  const bool none = solid && lowerCase(text.substr(0, kMaxHeader)).find("endsolid") != std::string::npos;
  if (solid && !exact && !words && !none && countIn(text) == 0)
    if (const std::string fault = notText(text); !fault.empty())
      return unreadable(name, "begins with solid and " + fault);
  if (!exact && !words && !none && text.size() < kStlHead)
    return unreadable(name, "is no STL file: it has " + std::to_string(text.size()) +
                                " bytes; accepted: a text that begins with solid, or 84 bytes and more");
  const Status read = exact || (!words && !none) ? readBinary(name, text, triangles) : readText(name, text, triangles);
  if (!read.ok()) return read.error();
  if (Status status = checkCounts(name, static_cast<double>(found.points.size()), 0.0, 0.0); !status)
    return status.error();
  return found;
}

}  // namespace meshless
