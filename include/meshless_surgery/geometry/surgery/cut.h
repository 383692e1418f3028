// Cutting a closed surface by a plane into closed pieces. A pure function: it knows no time, mass or body.
#pragma once

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/query/plane.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"
#include "meshless_surgery/geometry/mesh/vertex_origins.h"

namespace meshless {

/// One connected piece of the solid: closed, oriented, on one side of the plane.
struct CutPiece {
  TriangleMesh mesh;                // patches filled; the cap's is the patch asked for
  VertexOrigins origins;            // one a vertex
  std::vector<Index> cap_interior;  // its vertices inside the cap; without parents
  int side = 0;                     // +1: where the normal points; -1: the other
};

struct CutSurface {
  std::vector<CutPiece> pieces;  // largest volume first; at least two
  double cap_area = 0.0;         // [m^2] of one side
};

/// A number of points in the cap that suits most cuts.
constexpr std::size_t kUsualCapPoints = 4000;

struct CutOptions {
  double band = 1e-7;           // vertices closer to the plane than this times the bounds' diagonal lie on it
  std::uint32_t cap_patch = 1;  // the patch id of the new faces

  // Vertices that the plane meets within this [m] along one of their edges are moved to where it does, if that leaves
  // the surface's shape as it is: cuts then make no edges that are shorter. The pieces' volumes add up to that of the
  // surface with its vertices moved. A cut that fails with it is done without.
  double snap = 0.0;

  // Points inside the cap, at most so many, as far from each other as the vertices of the surface that is cut, or
  // farther where that would be more. None by default: who asks for them must know where to put vertices without
  // parents.
  std::size_t cap_points = 0;

  // The points inside the cap are up to this far from the plane [m], by fractal noise that the seed chooses, the same
  // on both sides; less near the rim and wherever the cap would meet the rest of the surface. Needs cap_points.
  double roughness = 0.0;
  std::uint32_t seed = 0;

  // Where the vertices are at rest [m], if they are told. Curves of the section's outline that cross now, and are
  // farther than `apart` [m] from each other at rest, are of different parts of soft tissue that lies in itself: each
  // is capped by itself, and nothing is joined. Without, and where parts overlap at rest too, caps go over all that
  // overlaps.
  const Points* rest = nullptr;
  double apart = 0.0;

  bool check_pieces = false;  // look at every edge and volume of the pieces again, for tests: doubles the time
};

/// Refuses: kInvalidArgument for a plane or options out of range; kMissed where no piece would be on one of the sides,
/// or one would be no thicker than the band; kUnsuitableShape where the surface is open or crosses itself in a way that
/// no closed pieces can be made of. `mesh` need not be embedded. Every edge of a piece that came from the plane has
/// exactly two triangles; parts of the mesh that share a vertex away from the plane stay one piece. The volumes of the
/// pieces add up to that of the mesh (1e-9 of it, checked). A cut that fails with this band is tried again with
/// narrower ones.
Result<CutSurface> cutByPlane(const TriangleMesh& mesh, const Plane& plane, const CutOptions& options = {});

/// The rectangle of a pair of scissors' blades, in the plane of the cut: origin + s * x_axis + t * y_axis with 0 <= s
/// <= length, |t| <= width / 2.
struct ScissorBlades {
  Vec3 origin = Vec3::Zero();
  Vec3 x_axis = Vec3::UnitX();  // unit
  Vec3 y_axis = Vec3::UnitY();  // unit, normal to x_axis
  double length = 0.0;          // [m]; 0: unbounded
  double width = 0.0;           // [m]; 0: unbounded

  Plane plane() const { return {x_axis.cross(y_axis), origin}; }
};

/// True where the rectangle meets the surface or lies inside the solid.
bool bladesMeet(const TriangleMesh& mesh, const ScissorBlades& blades);

}  // namespace meshless
