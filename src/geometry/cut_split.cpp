// Heights, sides, and the triangles that the plane crosses.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <unordered_map>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

#include "cut_parts.h"
#include "meshless_surgery/geometry/measures.h"

namespace meshless {
namespace cutting {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;

std::uint64_t edgeKey(Index a, Index b) {
  return (static_cast<std::uint64_t>(std::min(a, b)) << 32) | std::max(a, b);
}

/// Finds or makes the vertex where the plane crosses a mesh edge.
class EdgeVertices {
 public:
  EdgeVertices(Workpiece& work, const std::vector<double>& heights) : work_(work), heights_(heights) {}

  Index at(Index a, Index b) {
    const auto [entry, fresh] = made_.try_emplace(edgeKey(a, b), kNoIndex);
    if (fresh) {
      // From the upper end to the lower whoever asks, so that every triangle at the edge gets the same bits.
      const Index upper = heights_[a] > 0.0 ? a : b;
      const Index lower = upper == a ? b : a;
      entry->second = work_.addBetween(upper, lower, heights_[upper] / (heights_[upper] - heights_[lower]));
    }
    return entry->second;
  }

 private:
  Workpiece& work_;
  const std::vector<double>& heights_;
  std::unordered_map<std::uint64_t, Index> made_;
};

void addConvex(const Workpiece& work, const std::array<Index, 4>& corners, int count, std::uint32_t patch,
               SideSurface& surface) {
  if (count == 3) return surface.addNear({corners[0], corners[1], corners[2]}, patch);
  const Points& p = work.positions;
  const double diagonal_02 = (p[corners[2]] - p[corners[0]]).squaredNorm();
  const double diagonal_13 = (p[corners[3]] - p[corners[1]]).squaredNorm();
  const int first = diagonal_02 <= diagonal_13 ? 0 : 1;
  for (int half = 0; half < 2; ++half) {
    const int k = first + 2 * half;
    surface.addNear({corners[k % 4], corners[(k + 1) % 4], corners[(k + 2) % 4]}, patch);
  }
}

/// A triangle that lies on the plane bounds the solid below it where it faces up. The test is the one that the cap's
/// triangulation uses, on the same points, so that the two never disagree.
Side sideOfCoplanar(const Workpiece& work, const Triangle& t) {
  const Vec2 a = work.flat(t[0]), b = work.flat(t[1]), c = work.flat(t[2]);
  const auto turn = CGAL::orientation(Kernel::Point_2(a.x(), a.y()), Kernel::Point_2(b.x(), b.y()),
                                      Kernel::Point_2(c.x(), c.y()));
  return turn == CGAL::LEFT_TURN ? kLower : kUpper;
}

}  // namespace

VertexOrigin Workpiece::originOf(Index vertex) const {
  if (vertex >= mesh_vertices) return new_origins[vertex - mesh_vertices];
  VertexOrigin origin;
  origin.parents[0] = vertex;
  origin.weights[0] = 1.0;
  return origin;
}

Index Workpiece::addVertex(const Vec3& position, const VertexOrigin& origin) {
  positions.push_back(position);
  states.push_back(0);
  new_origins.push_back(origin);
  return static_cast<Index>(positions.size() - 1);
}

bool mixOrigins(const VertexOrigin& a, const VertexOrigin& b, double s, VertexOrigin& mixed) {
  mixed = VertexOrigin();
  std::size_t used = 0;
  const auto add = [&](const VertexOrigin& end, double share) {
    for (std::size_t k = 0; k < 4 && end.parents[k] != kNoIndex; ++k) {
      std::size_t slot = 0;
      while (slot < used && mixed.parents[slot] != end.parents[k]) ++slot;
      if (slot == 4) return false;
      if (slot == used) mixed.parents[used++] = end.parents[k];
      mixed.weights[slot] += share * end.weights[k];
    }
    return true;
  };
  return add(a, 1.0 - s) && add(b, s);
}

Index Workpiece::addBetween(Index a, Index b, double s) {
  VertexOrigin origin;
  // Both ends lie in one triangle of the mesh: three parents at the most.
  const bool fits = mixOrigins(originOf(a), originOf(b), s, origin);
  assert(fits);
  (void)fits;
  return addVertex(positions[a] + s * (positions[b] - positions[a]), origin);
}

Result<Workpiece> splitAtPlane(const TriangleMesh& mesh, const Plane& plane, const CutOptions& options) {
  Workpiece work;
  const Box box = boundsOf(mesh.vertices);
  // Never below what rounding makes of a height: crumbs may lie far from the origin.
  const double farthest = box.empty() ? 0.0 : std::max(box.min.cwiseAbs().maxCoeff(), box.max.cwiseAbs().maxCoeff());
  const double band = std::max(options.band * box.diagonal(), 1e-14 * farthest);
  const Vec3 middle = 0.5 * (box.min + box.max);
  work.normal = plane.normal.normalized();
  // A plane given by a far point would cost digits at every vertex.
  work.center = middle - work.normal.dot(middle - plane.point) * work.normal;
  work.axis_u = work.normal.unitOrthogonal();
  work.axis_v = work.normal.cross(work.axis_u);
  work.positions = mesh.vertices;
  work.mesh_vertices = static_cast<Index>(mesh.vertices.size());

  std::vector<double> heights(mesh.vertices.size());
  work.states.resize(mesh.vertices.size());
  for (std::size_t v = 0; v < heights.size(); ++v) {
    heights[v] = work.normal.dot(mesh.vertices[v] - work.center);
    work.states[v] = static_cast<signed char>((heights[v] > band) - (heights[v] < -band));
  }

  for (SideSurface& side : work.sides) {
    side.triangles.reserve(mesh.triangles.size());
    side.patches.reserve(mesh.triangles.size());
  }
  bool any_above = false, any_below = false;
  EdgeVertices edge_vertices(work, heights);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& triangle = mesh.triangles[t];
    const std::uint32_t patch = mesh.patchOf(t);
    const std::array<int, 3> s{work.states[triangle[0]], work.states[triangle[1]], work.states[triangle[2]]};
    const bool above = s[0] > 0 || s[1] > 0 || s[2] > 0, below = s[0] < 0 || s[1] < 0 || s[2] < 0;
    any_above |= above;
    any_below |= below;
    if (!above || !below) {
      const Side side = above ? kUpper : below ? kLower : sideOfCoplanar(work, triangle);
      if (s[0] != 0 && s[1] != 0 && s[2] != 0) {
        work.sides[side].addFar(triangle, patch);
      } else {
        work.sides[side].addNear(triangle, patch);
      }
      continue;
    }
    std::array<std::array<Index, 4>, 2> polygons;
    std::array<int, 2> counts{0, 0};
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3;
      if (s[k] >= 0) polygons[kUpper][counts[kUpper]++] = triangle[k];
      if (s[k] <= 0) polygons[kLower][counts[kLower]++] = triangle[k];
      if (s[k] * s[next] >= 0) continue;
      const Index x = edge_vertices.at(triangle[k], triangle[next]);
      for (int side = 0; side < 2; ++side) polygons[side][counts[side]++] = x;
    }
    for (int side = 0; side < 2; ++side) addConvex(work, polygons[side], counts[side], patch, work.sides[side]);
  }
  if (!any_above || !any_below)
    return Error{ErrorCode::kMissed, std::string("the plane misses the surface: nothing of it is ") +
                                         (any_above ? "below" : "above") + " the plane by more than " +
                                         std::to_string(1e3 * band) + " mm"};
  return work;
}

Result<std::vector<RimEdge>> rimOf(const Workpiece& work) {
  struct HalfEdge {
    Index low, high;
    signed char direction;  // +1: from low to high
    bool upper, coplanar;
  };
  std::vector<HalfEdge> found;
  for (int side = 0; side < 2; ++side) {
    for (const Index near : work.sides[side].near) {
      const Triangle& t = work.sides[side].triangles[near];
      const std::array<bool, 3> on{work.onPlane(t[0]), work.onPlane(t[1]), work.onPlane(t[2])};
      if (on[0] + on[1] + on[2] < 2) continue;
      for (int k = 0; k < 3; ++k) {
        const int next = (k + 1) % 3;
        if (!on[k] || !on[next]) continue;
        const bool ascending = t[k] < t[next];
        found.push_back({std::min(t[k], t[next]), std::max(t[k], t[next]), static_cast<signed char>(ascending ? 1 : -1),
                         side == kUpper, on[0] && on[1] && on[2]});
      }
    }
  }
  std::sort(found.begin(), found.end(),
            [](const HalfEdge& a, const HalfEdge& b) { return a.low != b.low ? a.low < b.low : a.high < b.high; });

  std::vector<RimEdge> rim;
  for (std::size_t begin = 0, end = 0; begin < found.size(); begin = end) {
    int net = 0, balance = 0;
    bool all_coplanar = true;
    for (; end < found.size() && found[end].low == found[begin].low && found[end].high == found[begin].high; ++end) {
      balance += found[end].direction;
      if (found[end].upper) net += found[end].direction;
      all_coplanar &= found[end].coplanar;
    }
    if (balance != 0)
      return Error{ErrorCode::kUnsuitableShape, "the surface is open or not oriented where the plane meets it"};
    // Without a net of its own an edge still parts what only touches along it.
    if (net != 0 || !all_coplanar) rim.push_back({found[begin].low, found[begin].high, net});
  }
  return rim;
}

}  // namespace cutting
}  // namespace meshless
