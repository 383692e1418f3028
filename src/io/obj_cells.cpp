// Wavefront OBJ: the lines "v x y z", "f a b c ...", and of textures "vt u v". All else is passed over.
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "cells_of_file.h"
#include "mesh_format.h"
#include "text_words.h"

namespace meshless {
namespace {

constexpr std::size_t kMostNuls = 65536;  // behind the text: some programs write their whole buffer

/// Whether a line ends in a backslash.
bool continues(std::string_view line) {
  while (!line.empty() && isBlank(line.back())) line.remove_suffix(1);
  return !line.empty() && line.back() == '\\';
}

/// The texture coordinates, as its lines come.
class ObjTexture {
 public:
  explicit ObjTexture(FileTexture& to) : to_(to) {}

  /// False where there are too many.
  bool addPoint(const std::vector<std::string>& vt) {
    std::array<double, 2> at{};
    for (std::size_t k = 1; k < std::min<std::size_t>(vt.size(), 3); ++k)
      at[k - 1] = numberOf(vt[k]).value_or(std::nan(""));
    points_.push_back({static_cast<float>(at[0]), static_cast<float>(at[1])});
    return points_.size() <= kMaxCorners;
  }
  /// `number`: what follows the vertex of a face's corner, as in 7/5/3.
  void addCorner(const char* number, std::size_t line) {
    long long point = *number == '/' ? std::strtoll(number + 1, nullptr, 10) : 0;  // 0 where there is none
    if (point < 0) point += static_cast<long long>(points_.size()) + 1;
    if (point > 0)
      corners_.push_back(static_cast<Index>(std::min(point, static_cast<long long>(kNoIndex))));
    else if (without_ == 0)
      without_ = line;
  }
  void finish() {
    if (corners_.empty()) return;
    if (without_ > 0) to_.fault = "a corner of the face in line " + std::to_string(without_) + " has none";
    for (const Index number : corners_) {
      if (number > points_.size() && to_.fault.empty())
        to_.fault = "a corner of a face has the number " + std::to_string(number) + "; accepted: 1 to " +
                    std::to_string(points_.size()) + ", the number of vt lines";
      if (!to_.fault.empty()) return to_.corners.clear();
      to_.corners.push_back(points_[number - 1]);
    }
  }

 private:
  FileTexture& to_;
  std::vector<TexturePoint> points_;
  std::vector<Index> corners_;  // numbers from 1 on
  std::size_t without_ = 0;     // the first line with a corner that has none
};

/// Corners of faces whose vertex had not come yet: it may come later.
class NamedVertices {
 public:
  /// Only those count that are beyond all before them: the first of these that does not come is the first of all.
  void add(Index vertex, const std::string& word, std::size_t face, std::size_t line) {
    if (named_.empty() || vertex > named_.back().vertex) named_.push_back({vertex, word, face, line});
  }
  std::string fault(std::size_t vertices) const {
    for (const Named& one : named_)
      if (one.vertex >= vertices)
        return "line " + std::to_string(one.line) + ": face " + std::to_string(one.face) + " has the corner '" +
               one.word + "'; accepted: 1 to " + std::to_string(vertices) + ", the number of vertices";
    return "";
  }

 private:
  struct Named {
    Index vertex;
    std::string word;
    std::size_t face, line;
  };
  std::vector<Named> named_;
};

}  // namespace

Result<CellsOfFile> readObjCells(const std::string& name, std::string_view text) {
  const std::size_t end = text.find_last_not_of('\0') + 1;  // 0: nothing else
  if (text.size() - end <= kMostNuls) text = text.substr(0, end);
  if (const std::string fault = notText(text); !fault.empty()) return unreadable(name, fault);
  CellsOfFile found;
  std::size_t corners = 0, line_number = 0;
  const auto bad = [&](const std::string& what) {
    return unreadable(name, "line " + std::to_string(line_number) + ": " + what);
  };
  std::string joined;
  ObjTexture texture(found.texture);
  NamedVertices named;
  std::string not_finite;  // the first vertex that is none, where
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
      Vec3 p;
      for (int k = 0; k < 3; ++k) {
        const std::optional<double> x = numberOf(w[static_cast<std::size_t>(k) + 1]);
        if (!x) return bad("'" + w[static_cast<std::size_t>(k) + 1].substr(0, 30) + "' is no number");
        p[k] = *x;
      }
      found.points.push_back(p);
      if (!p.allFinite() && not_finite.empty())
        not_finite = "line " + std::to_string(line_number) + ": vertex " + std::to_string(found.points.size()) +
                     " is not finite; accepted: finite numbers";
    } else if (w[0] == "f") {
      if (w.size() < 4) return bad("a face needs three corners, it has " + std::to_string(w.size() - 1));
      if (w.size() > kMaxPolygon + 1) return bad("a face has more than 1000 corners");
      found.polygons.push_back(static_cast<Index>(w.size() - 1));
      for (std::size_t k = 1; k < w.size(); ++k) {
        char* rest = nullptr;
        errno = 0;
        const long long corner = std::strtoll(w[k].c_str(), &rest, 10);
        if (rest == w[k].c_str() || (*rest != '\0' && *rest != '/') || errno != 0)
          return bad("'" + w[k].substr(0, 30) + "' is no vertex number");
        // Relative numbers become absolute ones.
        const long long absolute = corner < 0 ? static_cast<long long>(found.points.size()) + 1 + corner : corner;
        const bool possible = absolute > 0 && absolute <= static_cast<long long>(kMaxPoints);
        found.polygons.push_back(possible ? static_cast<Index>(absolute - 1) : kNoIndex);
        if (!possible || found.polygons.back() >= found.points.size())
          named.add(found.polygons.back(), w[k].substr(0, 30), found.polygon_count + 1, line_number);
        texture.addCorner(rest, line_number);
      }
      ++found.polygon_count;
      corners += w.size() - 1;
    } else {
      if (w[0] == "vt" && !texture.addPoint(w)) return bad("there are more than 32000000 vt lines");
      continue;
    }
    if (found.points.size() > kMaxPoints || found.polygon_count > kMaxFaces || corners > kMaxCorners) break;
  }
  if (Status status = checkCounts(name, static_cast<double>(found.points.size()),
                                  static_cast<double>(found.polygon_count), static_cast<double>(corners));
      !status)
    return status.error();
  // Of a cloud, points that are not finite are dropped.
  if (found.polygon_count > 0 && !not_finite.empty())
    return Error{ErrorCode::kUnsuitableShape, "'" + name + "' " + not_finite};
  if (const std::string fault = named.fault(found.points.size()); !fault.empty())
    return Error{ErrorCode::kUnsuitableShape, "'" + name + "' " + fault};
  texture.finish();
  return found;
}

}  // namespace meshless
