#include "cut_snap.h"

#include <algorithm>
#include <tuple>

namespace meshless {
namespace cutting {
namespace {

constexpr double kOutOfFace = 0.05;  // [reach of snapping] how far a vertex may leave the planes of its triangles
constexpr double kLeastArea = 0.1;   // of what a triangle had

/// An edge that the plane meets near its end `vertex`, at (1 - s) vertex + s other.
struct Crossing {
  double distance, s;
  Index vertex, other;

  bool operator<(const Crossing& b) const {
    return std::tie(distance, vertex, other) < std::tie(b.distance, b.vertex, b.other);
  }
};

std::vector<Crossing> crossingsNearEnds(const TriangleMesh& mesh, const std::vector<double>& heights, double within) {
  std::vector<Crossing> crossings;
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) {
      const Index a = t[k], b = t[(k + 1) % 3];
      if (a > b || !(heights[a] * heights[b] < 0.0)) continue;  // once for both directions of an edge
      const double length = (mesh.vertices[b] - mesh.vertices[a]).norm();
      const double s = heights[a] / (heights[a] - heights[b]);
      if (s <= 0.5 && s * length < within) crossings.push_back({s * length, s, a, b});
      if (s > 0.5 && (1.0 - s) * length < within) crossings.push_back({(1.0 - s) * length, 1.0 - s, b, a});
    }
  std::sort(crossings.begin(), crossings.end());
  return crossings;
}

Vec3 areaOf(const TriangleMesh& mesh, const Triangle& t) {
  return (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
}

}  // namespace

std::vector<SnappedVertex> snapToPlane(TriangleMesh& mesh, const Plane& plane, double within) {
  std::vector<double> heights;
  for (const Vec3& p : mesh.vertices) heights.push_back(plane.height(p));
  const std::vector<Crossing> crossings = crossingsNearEnds(mesh, heights, within);

  std::vector<bool> near(mesh.vertices.size(), false);
  for (const Crossing& c : crossings) near[c.vertex] = true;
  std::vector<std::pair<Index, Index>> triangles_at;  // vertex, triangle
  for (Index t = 0; t < mesh.triangles.size(); ++t)
    for (const Index v : mesh.triangles[t])
      if (near[v]) triangles_at.emplace_back(v, t);
  std::sort(triangles_at.begin(), triangles_at.end());

  std::vector<SnappedVertex> snapped;
  for (const Crossing& c : crossings) {
    if (!(heights[c.vertex] * heights[c.other] < 0.0)) continue;  // one of them moved onto the plane
    const Vec3 before = mesh.vertices[c.vertex];
    const Vec3 way = c.s * (mesh.vertices[c.other] - before);
    bool fits = true;
    for (auto at = std::lower_bound(triangles_at.begin(), triangles_at.end(), std::make_pair(c.vertex, Index{0}));
         fits && at != triangles_at.end() && at->first == c.vertex; ++at) {
      const Vec3 old_area = areaOf(mesh, mesh.triangles[at->second]);
      mesh.vertices[c.vertex] = before + way;
      const Vec3 new_area = areaOf(mesh, mesh.triangles[at->second]);
      mesh.vertices[c.vertex] = before;
      fits = std::abs(old_area.dot(way)) <= kOutOfFace * within * old_area.norm() &&
             old_area.dot(new_area) >= kLeastArea * old_area.squaredNorm();
    }
    if (!fits) continue;
    mesh.vertices[c.vertex] = before + way;
    heights[c.vertex] = 0.0;
    SnappedVertex moved{c.vertex, VertexOrigin::of(c.vertex)};
    moved.origin.weights[0] = 1.0 - c.s;
    moved.origin.parents[1] = c.other;
    moved.origin.weights[1] = c.s;
    snapped.push_back(moved);
  }
  std::sort(snapped.begin(), snapped.end(),
            [](const SnappedVertex& a, const SnappedVertex& b) { return a.vertex < b.vertex; });
  return snapped;
}

}  // namespace cutting
}  // namespace meshless
