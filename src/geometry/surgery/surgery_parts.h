// What the stages of a cut hand to each other. Private to this folder.
#pragma once

#include <algorithm>
#include <cstdint>
#include <unordered_map>
#include <utility>

#include "mesh/split_edges.h"
#include "meshless_surgery/geometry/surgery/incise.h"

namespace meshless {
namespace surgery {

/// An order of positions that does not depend on how a mesh is numbered.
inline bool comesFirst(const Vec3& a, const Vec3& b) {
  return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

/// The blade's coordinates, and its rectangle cut down to where the section is.
struct Frame {
  Vec3 origin, x_axis, y_axis, normal;
  Vec2 low, high;        // [m] of the rectangle
  bool bounded = false;  // false: the rectangle holds the whole section
  double band = 0.0;     // [m] what is closer to the plane or to the rectangle's border lies on it

  double height(const Vec3& p) const { return normal.dot(p - origin); }
  Vec2 flat(const Vec3& p) const { return {x_axis.dot(p - origin), y_axis.dot(p - origin)}; }
  Vec3 lifted(const Vec2& p) const { return origin + p.x() * x_axis + p.y() * y_axis; }
};

/// An edge of the surface in the plane: the winding number of the solid's section is `weight` higher on its left.
struct SectionEdge {
  Index from, to;  // vertices
  int weight;
};

/// The surface, its triangles split where the rectangle crosses them: the same points of space, more triangles.
struct SplitSurface {
  Frame frame;
  Points positions;  // the mesh's, then new ones; not all of them are used
  Index mesh_vertices = 0;
  std::vector<VertexOrigin> new_origins;  // of the vertices from mesh_vertices on
  std::vector<Vec2> places;        // [m] in the frame; of vertices in the plane, on the border exactly if near it
  std::vector<signed char> sides;  // of vertices: +1 above the plane, -1 below, 0 on it
  std::vector<char> within;        // vertices on the plane within the rectangle, its border too
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> patches;
  std::vector<SectionEdge> section;                  // of the whole plane, before the rectangle's border splits it
  std::unordered_map<Index, Index> section_of_made;  // a vertex of the section next to one that the border made
  double spacing = 0.0;                              // [m] mean edge of the triangles at the rim, by length
  bool lies_in_surface = false;                      // triangles of the mesh lie in the rectangle

  VertexOrigin originOf(Index vertex) const;
  /// A vertex at (1 - s) a + s b, both of them in the plane or on either side of it. Its place is still to be set.
  Index addBetween(Index a, Index b, double s);
  /// True where a triangle is above the plane, or lies in it and bounds the solid above.
  bool isUpper(const Triangle& triangle) const;
};

/// Refuses kMissed where the plane or its rectangle is beside the mesh. `follow`: see InciseOptions.
Result<SplitSurface> splitAtBlade(const TriangleMesh& mesh, const Frame& frame, double follow);

/// An edge within the rectangle, where the surface meets the plane. `weight`: how often the surface above runs it from
/// `from` to `to`, less the times that it runs back; 0 where it only touches the plane there.
struct RimEdge {
  Index from, to;  // from < to
  int weight;
};

/// In a fixed order; edges inside of coplanar parts of the surface are left out.
std::vector<RimEdge> rimOf(const SplitSurface& surface);

/// Rim vertices by their places in the plane. Those at the same place share a node.
struct Nodes {
  std::vector<Vec2> places;
  std::unordered_map<Index, Index> of_vertex;
};
Nodes nodesOf(const SplitSurface& surface, const std::vector<RimEdge>& rim);

/// Splits the rim where it meets itself, so that its edges have common points at nodes alone, and makes one vertex of
/// the ends of edges without length. False where rounding does not let it.
bool splitRim(SplitSurface& surface, std::vector<RimEdge>& rim, Nodes& nodes);

/// A point of the wound faces.
struct WoundNode {
  Vec2 place;
  Index vertex = kNoIndex;  // of the rim: the lowest one here; kNoIndex inside the solid
  double height = 0.0;      // [m] off the plane, inside
};

/// A triangle of the section, seen along the normal from above. Both wound faces have it as often as the section counts
/// there, with opposite directions.
struct WoundTriangle {
  std::array<Index, 3> nodes;  // counter-clockwise
  int winding;  // never 0: 1, or more where tissue lies in itself; negative where it is turned inside out
};

struct Wound {
  std::vector<WoundNode> nodes;
  std::vector<WoundTriangle> triangles;
  std::unordered_map<Index, Index> node_of_vertex;
  std::vector<RimEdge> rim;

  Vec3 position(const SplitSurface& surface, Index node) const {
    const WoundNode& n = nodes[node];
    return n.vertex != kNoIndex ? surface.positions[n.vertex]
                                : Vec3(surface.frame.lifted(n.place) + n.height * surface.frame.normal);
  }
};

/// Fills the part of the solid's section that lies in the rectangle and hangs together with the rim. The surface is
/// split further where its rim meets itself.
Result<Wound> fillWound(SplitSurface& surface, const InciseOptions& options);

/// The opened surface: the wound faces are joined to it at the rim. It is not yet taken apart into pieces.
struct OpenedSurface {
  TriangleMesh mesh;  // vertices that no triangle uses are left out later
  VertexOrigins origins;
  std::vector<std::int8_t> facing;
};

/// Joins triangles at their edges, then splits the vertices of the rim by umbrella.
Result<OpenedSurface> join(SplitSurface surface, const Wound& wound, std::uint32_t patch);

/// Takes the surface apart into its connected solids, hollows with the solid around them; largest first.
/// `volumes` [m^3]: of all shells, signed and without.
std::vector<IncisedPiece> separate(const OpenedSurface& opened, const Frame& frame, std::array<double, 2>& volumes);

}  // namespace surgery
}  // namespace meshless
