#include "meshless_surgery/drive/fold_law.h"

#include <algorithm>

#include "meshless_surgery/geometry/measures.h"
#include "words.h"

namespace meshless {
namespace {

constexpr double kFlat = 0.5;       // cosine of 60 degrees
constexpr double kFolded = -0.707;  // of 135
constexpr double kSliver = 0.02;    // of the mean edge

struct Side {
  Index low, high, triangle;
  bool operator<(const Side& o) const {
    return low != o.low ? low < o.low : high != o.high ? high < o.high : triangle < o.triangle;
  }
};

/// Unit; zero for a triangle whose height over its longest edge is less than `flattest`.
Vec3 normalOf(const Points& p, const Triangle& t, double flattest) {
  const Vec3 normal = (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]);
  const double longest = std::max({(p[t[1]] - p[t[0]]).norm(), (p[t[2]] - p[t[1]]).norm(), (p[t[0]] - p[t[2]]).norm()});
  if (!(normal.norm() > flattest * longest)) return Vec3::Zero();
  return normal.normalized();
}

}  // namespace

Finding foldLaw(const Seen& seen) {
  std::size_t sum = 0, most = 0;
  std::string where;
  for (const SeenBody& body : seen.bodies) {
    const std::vector<Triangle>& triangles = body.surface.triangles;
    TriangleMesh rest{body.rest, triangles, {}};
    const double flattest = kSliver * meanEdgeLength(rest);
    std::vector<Side> sides;
    std::vector<Vec3> was(triangles.size()), is(triangles.size());
    for (Index f = 0; f < triangles.size(); ++f) {
      const Triangle& t = triangles[f];
      was[f] = normalOf(body.rest, t, flattest);
      is[f] = normalOf(body.surface.vertices, t, flattest);
      for (int k = 0; k < 3; ++k) sides.push_back({std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3]), f});
    }
    std::sort(sides.begin(), sides.end());
    std::size_t folded = 0;
    for (std::size_t s = 0; s + 1 < sides.size(); ++s) {
      const Side &a = sides[s], &b = sides[s + 1];
      if (a.low != b.low || a.high != b.high) continue;
      folded += was[a.triangle].dot(was[b.triangle]) > kFlat && is[a.triangle].dot(is[b.triangle]) < kFolded;
    }
    sum += folded;
    if (folded <= most) continue;
    most = folded;
    where = body.name;
  }
  Finding worst;
  if (sum > 0) worst.take(1.0 + static_cast<double>(sum), words(sum, " edges are folded over, most of ", where));
  return worst;
}

}  // namespace meshless
