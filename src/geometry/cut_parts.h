// What the stages of a cut hand to each other. Private to geometry's cut_*.cpp.
#pragma once

#include "meshless_surgery/geometry/cut.h"

namespace meshless {
namespace cutting {

enum Side : int { kUpper = 0, kLower = 1 };

/// Triangles of one side of the plane. Corners are vertices of a Workpiece.
struct SideSurface {
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> patches;
  std::vector<Index> near;                // triangles with a corner on the plane, ascending
  std::vector<std::int32_t> cap_layers;   // of the last triangles: which layer of the cap, never 0, negative where the
                                          // winding is negative

  void addFar(const Triangle& triangle, std::uint32_t patch) {
    triangles.push_back(triangle);
    patches.push_back(patch);
  }
  void addNear(const Triangle& triangle, std::uint32_t patch) {
    near.push_back(static_cast<Index>(triangles.size()));
    addFar(triangle, patch);
  }
  void addCap(const Triangle& triangle, std::uint32_t patch, std::int32_t layer) {
    addNear(triangle, patch);
    cap_layers.push_back(layer);
  }
  /// 0 for triangles of the mesh.
  std::int32_t layerOf(Index triangle) const {
    const std::size_t first = triangles.size() - cap_layers.size();
    return triangle < first ? 0 : cap_layers[triangle - first];
  }
};

/// A mesh on its way from one surface to the surfaces of its pieces. The first vertices are the mesh's own; those that
/// the cut makes follow, all of them on the plane.
struct Workpiece {
  Vec3 normal, center;        // the plane, its point near the mesh's middle
  Vec3 axis_u, axis_v;        // orthonormal with the normal, right-handed
  Points positions;           // [m]
  std::vector<signed char> states;  // +1 above, -1 below, 0 on the plane
  Index mesh_vertices = 0;
  std::vector<VertexOrigin> new_origins;  // of the vertices from mesh_vertices on
  std::array<SideSurface, 2> sides;

  Vec2 flat(Index vertex) const {
    const Vec3 r = positions[vertex] - center;
    return {axis_u.dot(r), axis_v.dot(r)};
  }
  bool onPlane(Index vertex) const { return states[vertex] == 0; }
  VertexOrigin originOf(Index vertex) const;
  Index addVertex(const Vec3& position, const VertexOrigin& origin);
  /// A vertex at (1 - s) a + s b.
  Index addBetween(Index a, Index b, double s);
};

/// (1 - s) a + s b. False where that has more than four parents.
bool mixOrigins(const VertexOrigin& a, const VertexOrigin& b, double s, VertexOrigin& mixed);

/// Rebases the plane, takes heights once and puts every triangle, whole or in parts, on its side.
/// Refuses kMissed where no vertex is above or none below.
Result<Workpiece> splitAtPlane(const TriangleMesh& mesh, const Plane& plane, const CutOptions& options);

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
