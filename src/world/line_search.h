// Where parallel lines go into tissue and come out.
#pragma once

#include <algorithm>
#include <vector>

#include "shown_surface.h"

namespace meshless {

/// Lines go along z of these axes.
struct LineFrame {
  Vec3 centre;
  Vec3 axes[3];  // unit, right-handed

  Vec3 of(const Vec3& p) const {
    const Vec3 way = p - centre;
    return {way.dot(axes[0]), way.dot(axes[1]), way.dot(axes[2])};
  }
};

/// Where a line goes into tissue, or comes out.
struct Crossing {
  double at = 0.0;  // [m] along it
  bool in = false;
  NearestFace face;
};

class LineSearch {
 public:
  /// Faces that lines within so far of the middle can cross.
  LineSearch(const ShownSurface& shown, const LineFrame& frame, double half_x, double half_y)
      : triangles_(shown.surface->triangles) {
    places_.reserve(shown.vertices.size());
    for (const Vec3& p : shown.vertices) places_.push_back(frame.of(p));
    for (Index face = 0; face < triangles_.size(); ++face) {
      Box box;
      for (const Index v : triangles_[face]) box.extend(places_[v]);
      if (box.min.x() <= half_x && box.max.x() >= -half_x && box.min.y() <= half_y && box.max.y() >= -half_y)
        near_.push_back(face);
    }
  }

  /// In their order along the line through (x, y).
  const std::vector<Crossing>& through(double x, double y) {
    found_.clear();
    for (const Index face : near_) {
      const Triangle& t = triangles_[face];
      Vec3 sides;
      bool in = false;
      if (!covers(t, x, y, sides, in)) continue;
      Crossing crossing;
      crossing.in = in;
      crossing.face.face = face;
      crossing.face.shares = sides / sides.sum();
      for (int k = 0; k < 3; ++k) crossing.at += crossing.face.shares[k] * places_[t[k]].z();
      found_.push_back(crossing);
    }
    std::sort(found_.begin(), found_.end(), [](const Crossing& a, const Crossing& b) { return a.at < b.at; });
    return found_;
  }

 private:
  // Faces that share an edge agree on which side of it the line is, so that none is missed and none is met twice.
  bool covers(const Triangle& t, double x, double y, Vec3& sides, bool& in) const {
    bool left[3];
    for (int k = 0; k < 3; ++k) {
      const Index a = t[(k + 1) % 3], b = t[(k + 2) % 3];
      const Vec3 &p = places_[std::min(a, b)], &q = places_[std::max(a, b)];
      const double side = (p.x() - x) * (q.y() - y) - (p.y() - y) * (q.x() - x);
      left[k] = (side >= 0.0) == (a < b);
      sides[k] = a < b ? side : -side;
    }
    in = !left[0];  // its normal faces against z
    return left[0] == left[1] && left[1] == left[2] && sides.sum() != 0.0;
  }

  const std::vector<Triangle>& triangles_;
  Points places_;  // [m] in the axes
  std::vector<Index> near_;
  std::vector<Crossing> found_;
};

}  // namespace meshless
