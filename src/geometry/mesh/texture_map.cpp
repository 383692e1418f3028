#include "meshless_surgery/geometry/mesh/texture_map.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/base/bytes.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "meshless_surgery/geometry/query/nearest_on_triangle.h"

namespace meshless {
namespace {

std::vector<Triangle> neighboursOf(const TriangleMesh& surface, const std::vector<TexturePoint>& points) {
  struct Edge {
    Index low, high;  // vertices; at one place there is one
    const TexturePoint *at_low, *at_high;
    Index corner;  // where it begins
    bool sameVertices(const Edge& o) const { return low == o.low && high == o.high; }
    bool goesOn(const Edge& o) const { return sameVertices(o) && *at_low == *o.at_low && *at_high == *o.at_high; }
  };
  const TriangleMesh merged = withMergedVertices(surface);
  std::vector<Edge> edges;
  edges.reserve(points.size());
  for (Index t = 0; t < merged.triangles.size(); ++t)
    for (Index k = 0; k < 3; ++k) {
      const Index next = (k + 1) % 3;
      Edge edge{merged.triangles[t][k], merged.triangles[t][next], &points[3 * t + k], &points[3 * t + next],
                3 * t + k};
      if (edge.low > edge.high) {
        std::swap(edge.low, edge.high);
        std::swap(edge.at_low, edge.at_high);
      }
      edges.push_back(edge);
    }
  std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
    return std::array<Index, 3>{a.low, a.high, a.corner} < std::array<Index, 3>{b.low, b.high, b.corner};
  });
  std::vector<Triangle> neighbours(surface.triangles.size(), Triangle{kNoIndex, kNoIndex, kNoIndex});
  for (std::size_t e = 1; e < edges.size(); ++e) {
    const Edge &one = edges[e - 1], &other = edges[e];
    if (!one.goesOn(other)) continue;
    neighbours[one.corner / 3][one.corner % 3] = other.corner / 3;
    neighbours[other.corner / 3][other.corner % 3] = one.corner / 3;
    ++e;  // a third triangle at an edge has no other side
  }
  return neighbours;
}

}  // namespace

TextureMap::TextureMap(TriangleMesh surface, std::vector<TexturePoint> points)
    : surface_(std::move(surface)),
      points_(std::move(points)),
      neighbours_(neighboursOf(surface_, points_)),
      places_(surface_) {}

Result<TextureMapPtr> TextureMap::make(TriangleMesh surface, std::vector<TexturePoint> points) {
  const auto fault = [](const std::string& what) { return Error{ErrorCode::kUnsuitableShape, what}; };
  const double size = boundsOf(surface.vertices).diagonal();
  if (surface.triangles.empty() || !(size > 1e-12 && size < 1e50)) return fault("there is no surface");
  if (points.size() != 3 * surface.triangles.size())
    return fault("there are " + std::to_string(points.size()) + " for " + std::to_string(surface.triangles.size()) +
                 " triangles; accepted: three each");
  for (const Vec3& v : surface.vertices)
    if (!v.allFinite()) return fault("a vertex is not finite");
  for (const Triangle& t : surface.triangles)
    for (const Index v : t)
      if (v >= surface.vertices.size()) return fault("a triangle has a corner that is not there");
  for (const TexturePoint& p : points)
    if (!std::isfinite(p[0]) || !std::isfinite(p[1])) return fault("one is not finite");
  return TextureMapPtr(new TextureMap(std::move(surface), std::move(points)));
}

std::array<TexturePoint, 3> TextureMap::of(const std::array<Vec3, 3>& corners) const {
  struct Place {
    Index triangle;
    Vec3 weights;
    double squared;  // [m^2] away
  };
  const auto nearestIn = [this](Index triangle, const Vec3& p) {
    const Triangle& t = surface_.triangles[triangle];
    const Vec3 &a = surface_.vertices[t[0]], &b = surface_.vertices[t[1]], &c = surface_.vertices[t[2]];
    const Vec3 w = nearestWeights(p, a, b, c);
    return Place{triangle, w, (w[0] * a + w[1] * b + w[2] * c - p).squaredNorm()};
  };
  const Index middle = places_.nearestTriangle((corners[0] + corners[1] + corners[2]) / 3.0);
  std::vector<Index> as_near;
  std::array<TexturePoint, 3> found;
  for (int k = 0; k < 3; ++k) {
    Place place = nearestIn(middle, corners[k]);
    for (bool nearer = true; nearer;) {
      nearer = false;
      // Around a vertex that is nearest all triangles are as near, and the way on may be behind some of them. They come
      // by their steps from the first: whether one is known, those one step nearer to it and later tell.
      as_near.assign(1, place.triangle);
      std::size_t known = 0, step = 0, next_step = 1;  // where they begin
      for (std::size_t n = 0; n < as_near.size() && !nearer; ++n) {
        if (n == next_step) known = step, step = next_step, next_step = as_near.size();
        for (const Index next : neighbours_[as_near[n]]) {
          if (next == kNoIndex || std::find(as_near.begin() + known, as_near.end(), next) != as_near.end()) continue;
          const Place there = nearestIn(next, corners[k]);
          if (!(there.squared <= place.squared)) continue;
          nearer = there.squared < place.squared;
          if (nearer) {
            place = there;
            break;
          }
          as_near.push_back(next);
        }
      }
    }
    for (int axis = 0; axis < 2; ++axis) {
      double sum = 0.0;
      for (int c = 0; c < 3; ++c) sum += place.weights[c] * points_[3 * place.triangle + c][axis];
      found[k][axis] = static_cast<float>(sum);
    }
  }
  return found;
}

std::size_t TextureMap::bytes() const {
  return sizeof *this + bytesOf(surface_.vertices, surface_.triangles, points_, neighbours_) + places_.bytes();
}

}  // namespace meshless
