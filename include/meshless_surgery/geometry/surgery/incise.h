// Opening a closed surface along a blade that need not go all the way through. A pure function: it knows no time, mass
// or body.
#pragma once

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"
#include "meshless_surgery/geometry/query/plane.h"
#include "meshless_surgery/geometry/surgery/cut.h"

namespace meshless {

/// The rectangle of an incision: origin + s * x_axis + t * y_axis with 0 <= s <= length, -depth <= t <= 0. A cut has
/// ScissorBlades (geometry/surgery/cut.h).
struct Blade {
  Vec3 origin = Vec3::Zero();   // [m]
  Vec3 x_axis = Vec3::UnitX();  // unit, along the edge that stays outside
  Vec3 y_axis = Vec3::UnitY();  // unit, normal to x_axis, out of the tissue
  double length = 0.0;          // [m] > 0
  double depth = 0.0;           // [m] > 0

  Plane plane() const { return {x_axis.cross(y_axis), origin}; }
};

struct InciseOptions {
  double band = 1e-7;  // what is closer to the blade's plane or border than this times the bounds' diagonal is on it
  // [m] Earlier wound faces (isCutPatch) that run along the blade's plane no farther beside it than this are on it: the
  // blade follows them, and leaves no sheet between.
  double follow = 0.0;
  std::uint32_t patch = 1;        // the patch id of the wound faces
  double spacing = 0.0;           // [m] between the inner points; 0: the mean edge of the crossed triangles
  std::size_t max_points = 4000;  // inner points of one wound face; the spacing is widened to keep to it
};

/// A connected solid, closed and oriented. What was there before keeps its order, new vertices follow. Where wound
/// faces met at a point, one of the vertices there may stand for another at the same place.
struct IncisedPiece {
  TriangleMesh mesh;                // patches filled
  VertexOrigins origins;            // one a vertex, on the parent; none (weights 0) for those inside the wound faces
  std::vector<std::int8_t> facing;  // one a triangle: +1 where it is of the new wound face that faces along the blade's
                                    // normal, -1 of the one that faces against it, 0 of neither
};

struct Incision {
  std::vector<IncisedPiece> pieces;  // largest volume first; one, or several where the body came apart
  double opened_area = 0.0;          // [m^2] of one wound face
};

/// Opens the solid where the blade's rectangle is. The surface is split along the blade, and two wound faces of the
/// same points and triangles close it, facing each other. The vertices of the wound rim are doubled except at its ends,
/// those of the buried front are not. Wound faces of earlier incisions are surface like any other, whether they lie on
/// each other or have opened: they are extended, crossed and started from. What is already open in the blade's plane is
/// not opened again.
///
/// Refuses, and says why: kInvalidArgument for a blade or options out of range; kMissed where the blade meets no
/// tissue, lies wholly inside ("does not reach the surface") or where all is "already open there"; kUnsuitableShape
/// where the surface is open, or crosses itself within the blade (wound faces that press into each other). Where it
/// fails only because wound faces nearly lie in the blade's plane, it is done up to five bands beside that plane.
///
/// A blade that leaves the solid on all sides is a full cut. Pieces of one parent: each connected solid, with the
/// hollows inside of it; what still shares a vertex away from the blade stays one. Their volumes add up to the parent's
/// within 1e-9 (checked).
Result<Incision> incise(const TriangleMesh& mesh, const Blade& blade, const InciseOptions& options = {});

}  // namespace meshless
