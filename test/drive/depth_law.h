// Nothing is inside another.
#pragma once

#include "drive/finding.h"
#include "drive/seen.h"

namespace meshless {

/// [m] that a vertex may be inside another body: 1 mm, or a hundredth of the smaller body's diagonal where that is
/// more.
double allowedDepth(double smaller_diagonal);

/// No vertex of a body is deeper than that inside another one, an obstacle or the ground, and none of an obstacle
/// inside a body. Inside is where the other surface winds around the vertex (geometry/query/inside.h); the depth is the
/// distance to that surface. Surfaces are those that contact takes. Knows nothing of how contacts are found.
Finding depthLaw(const Seen& seen);

}  // namespace meshless
