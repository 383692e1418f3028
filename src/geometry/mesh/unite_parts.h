// Parts of a surface that overlap made into one, as segmentations need it that give a lobe with its organ.
#pragma once

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// What uniteParts gives. Without anything to do, the mesh is empty and all counts are 0.
struct UnitedParts {
  TriangleMesh mesh;            // closed, oriented outwards
  std::size_t overlapping = 0;  // parts that crossed or touched another one
  std::size_t solids = 0;       // what they have become
  double volume = 0.0;          // [m^3] of what they have become
  std::size_t swallowed = 0;    // parts inside of another that were turned as it is, and so bound nothing
  std::size_t turned = 0;       // parts inside of none that were inside out
  std::size_t filled = 0;       // parts that were turned against a larger one that they cross, and are tissue now

  bool changed() const { return overlapping > 0 || swallowed > 0; }
};

/// The solid that closed parts make together: all that lies in at least one of them. A part inside of another and
/// turned against it is a cavity, and stays one as far as no third part fills it; one that is turned as the other is
/// vanishes in it. Parts that cross nothing keep their vertices. CGAL's corefinement (Polygon Mesh Processing), with
/// exact numbers up to the end.
///
/// Of a closed surface without vertices that parts share, as repairMesh gives it without turning. Refuses with
/// kUnsuitableShape where a part that overlaps another crosses itself, or parts meet in edges alone, so that what they
/// make is not manifold.
Result<UnitedParts> uniteParts(const TriangleMesh& mesh);

}  // namespace meshless
