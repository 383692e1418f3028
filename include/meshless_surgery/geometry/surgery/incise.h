// Opening a closed surface along a blade that need not go all the way through. A pure function: it knows no time, mass
// or body.
#pragma once

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/mesh/add_part.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"
#include "meshless_surgery/geometry/mesh/vertex_origins.h"
#include "meshless_surgery/geometry/query/blade.h"

namespace meshless {

/// True where the blade meets the surface or lies inside the solid.
bool meets(const TriangleMesh& mesh, const Blade& blade);

struct InciseOptions {
  double band = 1e-7;  // what is closer to the blade's plane or border than this times the bounds' diagonal is on it
  // [m] Earlier wound faces (isCutPatch) that run along the blade's plane no farther beside it than this are on it: the
  // blade follows them, and leaves no sheet between.
  double follow = 0.0;
  std::uint32_t patch = 1;        // the patch id of the wound faces
  double spacing = 0.0;           // [m] between the inner points; 0: the mean edge of the crossed triangles
  std::size_t max_points = 4000;  // inner points of one wound face; the spacing is widened to keep to it

  // [m] The points inside the wound faces are up to this far from the plane, by fractal noise that the seed chooses,
  // the same on both sides; less near the rim and wherever the faces would meet the rest of the surface.
  double roughness = 0.0;
  std::uint32_t seed = 0;

  // [m] Where the vertices are at rest, if they are told. Curves of the section's outline that cross now, and are
  // farther than `apart` [m] from each other at rest, are of different parts of soft tissue that lies in itself: each
  // is filled by itself, and nothing is joined. Without, and where parts overlap at rest too, wound faces go over all
  // that overlaps, layer by layer.
  const Points* rest = nullptr;
  double apart = 0.0;
};

constexpr double kSheet = 1e-15;  // of all volume: what has less has none

/// A connected solid, closed and oriented. What was there before keeps its order, new vertices follow. Where wound
/// faces met at a point, one of the vertices there may stand for another at the same place.
struct IncisedPiece {
  TriangleMesh mesh;                // patches filled
  VertexOrigins origins;            // one a vertex, on the parent; none (weights 0) for those inside the wound faces
  std::vector<std::int8_t> facing;  // one a triangle: +1 where it is of the new wound face that faces along the blade's
                                    // normal, -1 of the one that faces against it, 0 of neither

  /// Another, as a part of it.
  void append(const IncisedPiece& other) {
    addPart(other.mesh, mesh);
    origins.append(other.origins);
    facing.insert(facing.end(), other.facing.begin(), other.facing.end());
  }
};

struct Incision {
  std::vector<IncisedPiece> pieces;  // largest volume first; one, or several where the body came apart
  double opened_area = 0.0;          // [m^2] of one wound face
  bool layered = false;              // tissue lies in itself there: some of it is joined with what it lies in
};

/// Opens the solid where the blade's rectangle is. The surface is split along the blade, and two wound faces of the
/// same points and triangles close it, facing each other. The vertices of the wound rim are doubled except at its ends,
/// those of the buried front are not. Wound faces of earlier incisions are surface like any other, whether they lie on
/// each other or have opened: they are extended, crossed and started from. What is already open in the blade's plane is
/// not opened again. `mesh` need not be embedded.
///
/// Refuses, and says why: kInvalidArgument for a blade or options out of range; kMissed where the blade meets no
/// tissue, lies wholly inside ("does not reach the surface") or where all is "already open there"; kUnsuitableShape
/// where the surface is open, or crosses itself in a way that cannot be closed.
///
/// A blade that leaves the solid on all sides is a full cut. By one without bounds each piece lies on one side of the
/// plane, and it is refused (kMissed) where nothing thicker than the band would be on one of them, too. Pieces of one
/// parent: each connected solid, with the hollows inside of it; what still shares a vertex away from the blade stays
/// one. Their volumes add up to the parent's within 1e-9 (checked).
Result<Incision> incise(const TriangleMesh& mesh, const Blade& blade, const InciseOptions& options = {});

}  // namespace meshless
