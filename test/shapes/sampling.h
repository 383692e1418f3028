// Points inside a solid.
#pragma once

#include "meshless_surgery/geometry/query/inside.h"

namespace meshless {

/// Points of a cubic lattice of edge `spacing` [m] that lie inside and at least `clearance` [m] from the surface. The
/// lattice has a point at the centre of the bounding box, so that symmetric bodies get symmetric particles.
/// At most max_points; beyond that the spacing is widened until they fit, and spacing_used says to what.
struct LatticeSample {
  Points points;
  double spacing_used = 0.0;
};
LatticeSample sampleInterior(const TriangleMesh& mesh, const SolidQuery& query, double spacing, double clearance,
                             std::size_t max_points = 200000);

}  // namespace meshless
