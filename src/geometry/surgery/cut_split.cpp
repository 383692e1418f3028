// Heights, sides, and the triangles that the plane crosses.
#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

#include "cut_parts.h"
#include "mesh/edge_balance.h"
#include "mesh/edge_table.h"
#include "mesh/exact.h"
#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace cutting {
namespace {

double heightOf(const Workpiece& work, Index vertex) {
  return work.normal.dot(work.mesh->vertices[vertex] - work.center);
}

/// Finds or makes the vertex where the plane crosses a mesh edge.
class EdgeVertices {
 public:
  EdgeVertices(Workpiece& work, std::size_t most_edges) : work_(work), vertices_(2 * most_edges, kNoIndex) {}

  Index at(Index a, Index b) {
    Index& vertex = vertices_.at(a, b);
    if (vertex == kNoIndex) {
      // From the upper end to the lower whoever asks, so that every triangle at the edge gets the same bits.
      const Index upper = work_.states[a] > 0 ? a : b;
      const Index lower = upper == a ? b : a;
      const double above = heightOf(work_, upper), below = heightOf(work_, lower);
      vertex = work_.addBetween(upper, lower, above / (above - below));
    }
    return vertex;
  }

 private:
  Workpiece& work_;
  EdgeTable<Index> vertices_;
};

void addConvex(const Workpiece& work, const std::array<Index, 4>& corners, int count, std::uint32_t patch,
               SideSurface& surface) {
  if (count == 3) return surface.add({corners[0], corners[1], corners[2]}, patch);
  const double diagonal_02 = (work.position(corners[2]) - work.position(corners[0])).squaredNorm();
  const double diagonal_13 = (work.position(corners[3]) - work.position(corners[1])).squaredNorm();
  const int first = diagonal_02 <= diagonal_13 ? 0 : 1;
  for (int half = 0; half < 2; ++half) {
    const int k = first + 2 * half;
    surface.add({corners[k % 4], corners[(k + 1) % 4], corners[(k + 2) % 4]}, patch);
  }
}

/// A triangle that lies on the plane bounds the solid below it where it faces up. The test is the one that the cap's
/// triangulation uses, on the same points, so that the two never disagree.
Side sideOfCoplanar(const Workpiece& work, const Triangle& t) {
  return exact::turn(work.flat(t[0]), work.flat(t[1]), work.flat(t[2])) > 0 ? kLower : kUpper;
}

/// Sorts the mesh's triangles into untouched and touched ones. False where it is not closed and oriented.
Status sortTriangles(Workpiece& work) {
  const TriangleMesh& mesh = *work.mesh;
  const signed char* states = work.states.data();
  std::array<Index, 2> untouched{0, 0};
  std::uint64_t balance = 0;
  UnionFind sets(mesh.vertices.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle triangle = mesh.triangles[t];
    const std::uint64_t share = edgeBalance(triangle);
    balance += share;
    const int state = states[triangle[0]];
    if (state == 0 || state != states[triangle[1]] || state != states[triangle[2]]) {
      work.touched.push_back(static_cast<Index>(t));
      continue;
    }
    if (share == 0 && namesAVertexTwice(triangle))
      return Error{ErrorCode::kUnsuitableShape, "the surface has a triangle that names a vertex twice"};
    ++untouched[state > 0 ? kUpper : kLower];
    sets.join(triangle);
  }
  if (balance != 0)
    return Error{ErrorCode::kUnsuitableShape,
                 "the surface is open or not oriented: it has edges with more triangles in one direction than in the "
                 "other"};

  Untouched& parts = work.untouched;
  parts.part_of_vertex.assign(mesh.vertices.size(), kNoIndex);
  const std::vector<Index>& roots = sets.flatten();
  std::array<Index, 2> parts_on_side{0, 0};
  for (Index v = 0; v < roots.size(); ++v) {
    const Index root = roots[v];
    if (root == v) continue;
    Index& part = parts.part_of_vertex[root];
    if (part == kNoIndex) {
      part = static_cast<Index>(parts.sides.size());
      parts.sides.push_back(states[root] > 0 ? kUpper : kLower);
      ++parts_on_side[parts.sides.back()];
    }
    parts.part_of_vertex[v] = part;
  }
  parts.triangles.assign(parts.sides.size(), 0);
  if (parts_on_side[kUpper] <= 1 && parts_on_side[kLower] <= 1) {
    for (std::size_t p = 0; p < parts.sides.size(); ++p) parts.triangles[p] = untouched[parts.sides[p]];
    return Done{};
  }
  std::size_t next_touched = 0;
  for (Index t = 0; t < mesh.triangles.size(); ++t) {
    if (next_touched < work.touched.size() && work.touched[next_touched] == t) {
      ++next_touched;
    } else {
      ++parts.triangles[parts.part_of_vertex[mesh.triangles[t][0]]];
    }
  }
  return Done{};
}

/// Gives the mesh's vertices on the plane their other numbers.
void renumberOnPlane(Workpiece& work, std::vector<Triangle>& triangles) {
  std::vector<Index> on_plane;
  for (const Triangle& t : triangles)
    for (const Index v : t)
      if (work.states[v] == 0) on_plane.push_back(v);
  if (on_plane.empty()) return;
  std::sort(on_plane.begin(), on_plane.end());
  on_plane.erase(std::unique(on_plane.begin(), on_plane.end()), on_plane.end());
  for (const Index v : on_plane) work.addVertex(work.mesh->vertices[v], work.originOf(v));
  for (Triangle& t : triangles)
    for (Index& v : t)
      if (work.states[v] == 0)
        v = work.mesh_vertices +
            static_cast<Index>(std::lower_bound(on_plane.begin(), on_plane.end(), v) - on_plane.begin());
}

}  // namespace

VertexOrigin Workpiece::originOf(Index vertex) const {
  if (vertex >= mesh_vertices) return new_origins[vertex - mesh_vertices];
  const auto at = std::lower_bound(snapped->begin(), snapped->end(), vertex,
                                   [](const SnappedVertex& s, Index v) { return s.vertex < v; });
  return at != snapped->end() && at->vertex == vertex ? at->origin : VertexOrigin::of(vertex);
}

Index Workpiece::addVertex(const Vec3& position, const VertexOrigin& origin) {
  new_positions.push_back(position);
  new_origins.push_back(origin);
  return endVertex() - 1;
}

Index Workpiece::addBetween(Index a, Index b, double s) {
  VertexOrigin origin;
  // Both ends lie in one triangle of the mesh: three parents at the most.
  const bool fits = mixOrigins(originOf(a), originOf(b), s, origin);
  assert(fits);
  (void)fits;
  return addVertex(position(a) + s * (position(b) - position(a)), origin);
}

Result<Workpiece> splitAtPlane(const TriangleMesh& mesh, const std::vector<SnappedVertex>& snapped, const Plane& plane,
                               double relative_band, const Box& box) {
  Workpiece work;
  // Never below what rounding makes of a height: crumbs may lie far from the origin.
  const double farthest = box.empty() ? 0.0 : std::max(box.min.cwiseAbs().maxCoeff(), box.max.cwiseAbs().maxCoeff());
  const double band = std::max(relative_band * box.diagonal(), 1e-14 * farthest);
  const Vec3 middle = 0.5 * (box.min + box.max);
  work.mesh = &mesh;
  work.snapped = &snapped;
  work.normal = plane.normal.normalized();
  // A plane given by a far point would cost digits at every vertex.
  work.center = middle - work.normal.dot(middle - plane.point) * work.normal;
  work.axis_u = work.normal.unitOrthogonal();
  work.axis_v = work.normal.cross(work.axis_u);
  work.mesh_vertices = static_cast<Index>(mesh.vertices.size());

  work.states.resize(mesh.vertices.size());
  // Copies: a state could be a byte of anything else, for all that the compiler knows.
  const Vec3 normal = work.normal, center = work.center;
  const Vec3* points = mesh.vertices.data();
  signed char* states = work.states.data();
  for (Index v = 0, end = work.mesh_vertices; v < end; ++v) {
    const double height = normal.dot(points[v] - center);  // as heightOf()
    states[v] = static_cast<signed char>((height > band) - (height < -band));
  }
  const Status sorted = sortTriangles(work);
  if (!sorted) return sorted.error();

  bool any_above = false, any_below = false;
  for (const Side side : work.untouched.sides) (side == kUpper ? any_above : any_below) = true;
  std::vector<Triangle> touched;
  touched.reserve(work.touched.size());
  for (const Index t : work.touched) touched.push_back(mesh.triangles[t]);
  renumberOnPlane(work, touched);
  EdgeVertices edge_vertices(work, touched.size());  // two at most a triangle, each shared by two
  double length = 0.0;
  for (std::size_t i = 0; i < touched.size(); ++i) {
    const Triangle& triangle = touched[i];
    const std::uint32_t patch = mesh.patchOf(work.touched[i]);
    std::array<int, 3> s;
    for (int k = 0; k < 3; ++k) s[k] = triangle[k] < work.mesh_vertices ? work.states[triangle[k]] : 0;
    const bool above = s[0] > 0 || s[1] > 0 || s[2] > 0, below = s[0] < 0 || s[1] < 0 || s[2] < 0;
    any_above |= above;
    any_below |= below;
    for (int k = 0; k < 3; ++k) length += (work.position(triangle[(k + 1) % 3]) - work.position(triangle[k])).norm();
    if (!above || !below) {
      work.sides[above ? kUpper : below ? kLower : sideOfCoplanar(work, triangle)].add(triangle, patch);
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
  if (!touched.empty()) work.spacing = length / (3.0 * static_cast<double>(touched.size()));
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
    for (const Triangle& t : work.sides[side].triangles) {
      const std::array<bool, 3> on{work.onRim(t[0]), work.onRim(t[1]), work.onRim(t[2])};
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
  // By the lower end, then by the higher: few share one.
  std::vector<Index> ends(work.new_positions.size() + 1, 0);
  for (const HalfEdge& e : found) ++ends[e.low - work.mesh_vertices + 1];
  std::partial_sum(ends.begin(), ends.end(), ends.begin());
  std::vector<HalfEdge> sorted(found.size());
  for (const HalfEdge& e : found) sorted[ends[e.low - work.mesh_vertices]++] = e;
  found.swap(sorted);
  for (std::size_t v = 0, begin = 0; begin < found.size(); begin = ends[v++])
    std::sort(found.begin() + static_cast<std::ptrdiff_t>(begin), found.begin() + ends[v],
              [](const HalfEdge& a, const HalfEdge& b) { return a.high < b.high; });

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
