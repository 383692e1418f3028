// What the stages of an incision hand to each other. Private to geometry's incise*.cpp.
#pragma once

#include <algorithm>
#include <unordered_map>

#include "mesh/split_edges.h"
#include "meshless_surgery/geometry/surgery/incise.h"

namespace meshless {
namespace incising {

/// An order of places that does not depend on how a mesh is numbered.
inline bool comesFirst(const Vec3& a, const Vec3& b) {
  return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

/// The blade's coordinates, and its rectangle cut down to where the section is.
struct Frame {
  Vec3 origin, x_axis, y_axis, normal;
  Vec2 low, high;     // [m] of the rectangle
  double band = 0.0;  // [m] what is closer to the plane or to the rectangle's border lies on it

  Vec2 flat(const Vec3& p) const { return {x_axis.dot(p - origin), y_axis.dot(p - origin)}; }
  Vec3 lifted(const Vec2& p) const { return origin + p.x() * x_axis + p.y() * y_axis; }
};

/// An edge of the split surface that lies in the plane, within the rectangle.
struct RimEdge {
  enum Kind : char {
    kCrossed,       // the surface goes through the plane: the triangle above runs from -> to, the solid is to the left
    kTouchedAbove,  // it touches the plane from above, as the front of an incision can: the solid may be on both sides
    kTouchedBelow
  };
  Index from, to;
  Kind kind = kCrossed;
};

/// The surface, its triangles split where the rectangle crosses them: the same points of space, more triangles.
struct SplitSurface {
  Frame frame;
  Points positions;  // the mesh's, then new ones; not all of them are used
  Index mesh_vertices = 0;
  std::vector<VertexOrigin> new_origins;  // of the vertices from mesh_vertices on
  std::vector<Vec2> places;  // [m] in the frame; of vertices in the plane, on the border exactly if near it
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> patches;
  std::vector<RimEdge> rim;
  std::vector<std::array<Vec2, 2>> section;  // the whole plane's, directed, solid to the left
  double spacing = 0.0;                      // [m] mean edge of the triangles at the rim
  bool along_edges = false;                  // edges of the mesh are rim
  bool lies_in_surface = false;              // triangles of the mesh lie in the rectangle

  VertexOrigin originOf(Index vertex) const;
  /// A vertex at (1 - s) a + s b, its place still to be set.
  Index addBetween(Index a, Index b, double s);
};

/// Splits rim edges that pass through vertices of others. There are such edges where wound faces that lie on each other
/// are split in different places. False where there are none.
bool splitRimAtVertices(SplitSurface& surface);

/// Refuses kMissed where the plane or its rectangle is beside the mesh, kUnsuitableShape where the surface is open.
Result<SplitSurface> splitAtBlade(const TriangleMesh& mesh, const Blade& blade, double band, double follow);

struct WoundNode {
  Vec2 place;
  Index vertex = kNoIndex;  // of the rim: the lowest one here; kNoIndex inside the solid
};

/// A triangle of the section, seen along the normal from above. Edge k runs from node k to the next.
struct WoundTriangle {
  std::array<Index, 3> nodes;                                      // counter-clockwise
  std::array<Index, 3> neighbors{{kNoIndex, kNoIndex, kNoIndex}};  // across the edges, of the same wound face
  std::array<Index, 3> rim{{kNoIndex, kNoIndex, kNoIndex}};        // rim edges; neither: the buried front
  std::array<bool, 3> against{{false, false, false}};              // the rim edge runs the other way
  Index component = 0;
};

/// Both wound faces have these triangles, with opposite directions.
struct WoundFaces {
  std::vector<WoundNode> nodes;
  std::vector<WoundTriangle> triangles;
  Index components = 0;
};

/// Fills the part of the solid's section that lies in the rectangle and hangs together with the rim. `touched`: edges
/// where the surface only touches the plane are rim too.
Result<WoundFaces> fillWoundFaces(const SplitSurface& surface, const InciseOptions& options, bool touched);

/// The opened surface: the wound faces are joined to it at the rim. It is not yet taken apart into pieces.
struct OpenedSurface {
  TriangleMesh mesh;  // vertices that no triangle uses are left out later
  VertexOrigins origins;
  std::vector<std::int8_t> facing;
  std::size_t first_new_triangle = 0;
};

/// Joins triangles at their edges side by side, then splits the vertices of the rim by umbrella.
Result<OpenedSurface> seal(const SplitSurface& surface, const WoundFaces& wound, std::uint32_t patch);

/// Takes the surface apart into its connected solids, hollows with the solid around them.
Result<std::vector<IncisedPiece>> separate(const OpenedSurface& opened);

}  // namespace incising
}  // namespace meshless
