// How fibres lie in a body of cells.
#pragma once

#include <vector>

#include "meshless_surgery/geometry/lattice/cell_lattice.h"

namespace meshless {

/// A unit vector for each cell, in the frame of rest places. `direction`: the same for all, of any length. Zero: along
/// the body, whatever its bends: up the slope of the slowest mode by which heat would spread in its cells (the Fiedler
/// vector of those that share faces; each part that hangs together has its own). Of a body without a longest way, as a
/// ball, any.
std::vector<Vec3> fibreDirections(const CellLattice& lattice, const Vec3& direction);

}  // namespace meshless
