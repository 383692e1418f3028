// The axes along which a lattice fits a body best.
#pragma once

#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// Right-handed, as columns: those that the surface's faces lie along and across most, by the largest sum of
/// area (nx^4 + ny^4 + nz^4). Boxes, bars and what is put together of them have theirs; where none are clearly better
/// than the mesh's own (a ball), these. Turns with the mesh, but for the order and signs of the axes.
Mat3 mainAxes(const TriangleMesh& mesh);

/// That mean of nx^4 + ny^4 + nz^4 over the surface: 1 where all faces lie along and across the axes of coordinates,
/// and never below 1/3. 0 without area.
double alongAxes(const TriangleMesh& mesh);

}  // namespace meshless
