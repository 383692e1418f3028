// What the stages of a cut hand to each other. Private to geometry's cut_*.cpp.
#pragma once

#include "cut_snap.h"
#include "meshless_surgery/geometry/query/union_find.h"
#include "meshless_surgery/geometry/surgery/cut.h"
#include "mesh/split_edges.h"

namespace meshless {
namespace cutting {

enum Side : int { kUpper = 0, kLower = 1 };

/// Triangles of one side of the plane with a corner on it. Corners are vertices of a Workpiece.
struct SideSurface {
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> patches;
  std::vector<std::int32_t> cap_layers;  // of the last triangles: which layer of the cap, never 0, negative where the
                                         // winding is negative

  void add(const Triangle& triangle, std::uint32_t patch) {
    triangles.push_back(triangle);
    patches.push_back(patch);
  }
  void addCap(const Triangle& triangle, std::uint32_t patch, std::int32_t layer) {
    add(triangle, patch);
    cap_layers.push_back(layer);
  }
  /// 0 for triangles of the mesh.
  std::int32_t layerOf(Index triangle) const {
    const std::size_t first = triangles.size() - cap_layers.size();
    return triangle < first ? 0 : cap_layers[triangle - first];
  }
};

/// What the plane leaves of a mesh as it is: triangles with all corners on one side, and how they hang together.
struct Untouched {
  std::vector<Index> part_of_vertex;  // kNoIndex: on the plane, or in none of these triangles
  std::vector<Side> sides;            // of each part; parts in the order of their lowest vertices
  std::vector<Index> triangles;       // of each part: how many
};

/// A mesh on its way from one surface to the surfaces of its pieces. Vertices below mesh_vertices are the mesh's own
/// off the plane. Those from there on are on the plane: first the mesh's own by another number, ascending, then those
/// that the cut makes. From first_inner on they lie inside the cap, off the rim.
struct Workpiece {
  const TriangleMesh* mesh = nullptr;
  const std::vector<SnappedVertex>* snapped = nullptr;  // those of its vertices that are not where they were
  Vec3 normal, center;                                  // the plane, its point near the mesh's middle
  Vec3 axis_u, axis_v;                                  // orthonormal with the normal, right-handed
  double spacing = 0.0;             // [m] mean edge length of the triangles that the plane crosses or touches
  std::vector<signed char> states;  // of the mesh's vertices: +1 above, -1 below, 0 on the plane
  std::vector<Index> touched;       // the mesh's triangles that are in no part, ascending
  Untouched untouched;
  Index mesh_vertices = 0, first_inner = kNoIndex;
  Points new_positions;                   // [m] of the vertices from mesh_vertices on
  std::vector<VertexOrigin> new_origins;  // of the same
  std::array<SideSurface, 2> sides;

  const Vec3& position(Index vertex) const {
    return vertex < mesh_vertices ? mesh->vertices[vertex] : new_positions[vertex - mesh_vertices];
  }
  Vec2 flat(Index vertex) const {
    const Vec3 r = position(vertex) - center;
    return {axis_u.dot(r), axis_v.dot(r)};
  }
  Vec3 solid(const Vec2& place) const { return center + place.x() * axis_u + place.y() * axis_v; }
  /// False for vertices inside the cap: nothing but the cap meets there.
  bool onRim(Index vertex) const { return vertex >= mesh_vertices && vertex < first_inner; }
  Index endVertex() const { return mesh_vertices + static_cast<Index>(new_positions.size()); }
  VertexOrigin originOf(Index vertex) const;
  Index addVertex(const Vec3& position, const VertexOrigin& origin);
  /// A vertex at (1 - s) a + s b.
  Index addBetween(Index a, Index b, double s);
};

/// Rebases the plane, takes heights once and puts every triangle, whole or in parts, on its side.
/// Refuses kMissed where no vertex is above or none below, kUnsuitableShape where the mesh is not closed and oriented.
Result<Workpiece> splitAtPlane(const TriangleMesh& mesh, const std::vector<SnappedVertex>& snapped, const Plane& plane,
                               double relative_band, const Box& box);

/// An edge with both ends on the plane. `net`: how often the upper surface runs it from `from` to `to`, less the times
/// that it runs back; 0 where the surface only touches the plane there.
struct RimEdge {
  Index from, to;  // from < to
  int net;
};

/// Rim edges in a fixed order; edges inside coplanar parts of the surface are left out. Fails on an open surface.
Result<std::vector<RimEdge>> rimOf(const Workpiece& work);

}  // namespace cutting
}  // namespace meshless
