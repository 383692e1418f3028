// Whether a blade meets a body.
#include <algorithm>
#include <cmath>

#include "meshless_surgery/geometry/surgery/incise.h"

namespace meshless {
namespace {

/// The blade's rectangle in its own coordinates.
struct Reach {
  Vec2 low, high;

  /// True where the segment a b has a point in common with the rectangle.
  bool meets(const Vec2& a, const Vec2& b) const {
    double from = 0.0, to = 1.0;
    const auto clip = [&](double start, double step, double low, double high) {
      if (step == 0.0) {
        if (start < low || start > high) to = -1.0;
        return;
      }
      const double first = (low - start) / step, second = (high - start) / step;
      from = std::max(from, std::min(first, second));
      to = std::min(to, std::max(first, second));
    };
    clip(a.x(), b.x() - a.x(), low.x(), high.x());
    clip(a.y(), b.y() - a.y(), low.y(), high.y());
    return from <= to;
  }
};

double cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace

bool meets(const TriangleMesh& mesh, const Blade& blade) {
  if (!blade.origin.allFinite() || !blade.x_axis.allFinite() || !blade.y_axis.allFinite()) return false;
  if (!(std::min({blade.length, blade.depth, blade.rise, blade.behind}) >= 0.0)) return false;
  const Reach reach{{-blade.behind, -blade.depth}, {blade.length, blade.rise}};
  const Plane plane = blade.plane();
  std::vector<double> heights(mesh.vertices.size());
  for (std::size_t v = 0; v < heights.size(); ++v) heights[v] = plane.height(mesh.vertices[v]);
  const auto flat = [&](const Vec3& p) {
    return Vec2(blade.x_axis.dot(p - blade.origin), blade.y_axis.dot(p - blade.origin));
  };

  int winding = 0;  // of the section around the origin
  for (const Triangle& t : mesh.triangles) {
    const std::array<double, 3> h{heights[t[0]], heights[t[1]], heights[t[2]]};
    const int above = (h[0] > 0.0) + (h[1] > 0.0) + (h[2] > 0.0), below = (h[0] < 0.0) + (h[1] < 0.0) + (h[2] < 0.0);
    if (above == 3 || below == 3) continue;
    if (above == 0 && below == 0) {
      const Vec2 a = flat(mesh.vertices[t[0]]), b = flat(mesh.vertices[t[1]]), c = flat(mesh.vertices[t[2]]);
      if (reach.meets(a, b) || reach.meets(b, c) || reach.meets(c, a)) return true;
      // No edge meets it: the rectangle is wholly within the triangle or wholly beside it.
      const double ab = cross(b - a, -a), bc = cross(c - b, -b), ca = cross(a - c, -c);
      if ((ab > 0.0) == (bc > 0.0) && (bc > 0.0) == (ca > 0.0)) return true;
      continue;
    }
    // Where the plane enters and leaves the triangle, always computed from the upper end of an edge.
    std::array<Vec2, 3> crossings;
    int count = 0;
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3;
      if (h[k] == 0.0) {
        crossings[count++] = flat(mesh.vertices[t[k]]);
      } else if (h[k] * h[next] < 0.0) {
        const int upper = h[k] > 0.0 ? k : next, lower = h[k] > 0.0 ? next : k;
        const double s = h[upper] / (h[upper] - h[lower]);
        crossings[count++] = flat(mesh.vertices[t[upper]] + s * (mesh.vertices[t[lower]] - mesh.vertices[t[upper]]));
      }
    }
    if (reach.meets(crossings[0], crossings[count - 1])) return true;

    // The winding number counts heights of 0 as above: then every mixed triangle gives one directed segment.
    Vec2 enters = Vec2::Zero(), leaves = Vec2::Zero();
    bool mixed = false;
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3;
      if ((h[k] >= 0.0) == (h[next] >= 0.0)) continue;
      mixed = true;
      const int upper = h[k] >= 0.0 ? k : next, lower = h[k] >= 0.0 ? next : k;
      const double s = h[upper] / (h[upper] - h[lower]);
      const Vec2 at = flat(mesh.vertices[t[upper]] + s * (mesh.vertices[t[lower]] - mesh.vertices[t[upper]]));
      (h[k] >= 0.0 ? leaves : enters) = at;
    }
    if (!mixed || (enters.y() > 0.0) == (leaves.y() > 0.0)) continue;
    const double x = enters.x() - enters.y() * (leaves.x() - enters.x()) / (leaves.y() - enters.y());
    if (x > 0.0) winding += leaves.y() > enters.y() ? 1 : -1;
  }
  // No part of the surface within reach: the rectangle is inside or outside as a whole.
  return winding != 0;
}

}  // namespace meshless
