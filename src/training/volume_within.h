// How much of a solid lies in a region.
#pragma once

#include "meshless_surgery/geometry/query/region.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// [m^3] of a closed surface's inside that lies in a box, a sphere or below a plane: lengths along z, exact, over a
/// lattice of 16,384 columns; within about a thousandth of the solid's volume. 0 for a region of a mesh.
double volumeWithin(const TriangleMesh& solid, const Region& region);

}  // namespace meshless
