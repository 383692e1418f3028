// A solid divided into the cells of a cubic lattice, with corners that only connected cells share.
#pragma once

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/inside.h"

namespace meshless {

/// Where the solid comes apart inside a lattice cell (two fingers, the walls of a slit), each part has a copy of the
/// cell with corners of its own, shared with the cells that it continues into (Nesme et al. 2009). Gaps thinner than a
/// quarter of the spacing are not seen.
struct CellLattice {
  struct Cell {
    std::array<Index, 8> corners;  // bit 0, 1, 2 of the position: upper end along x, y, z
    double fraction = 0.0;         // of the cell's volume that this part fills, 0 < fraction <= 1
  };
  double spacing = 0.0;     // [m]
  Points corners;           // [m] inside the solid or less than a cell away from it
  std::vector<Cell> cells;  // in lattice order
};

/// The lattice is centred on the bounds; a box whose edges are whole multiples of the spacing is filled exactly.
/// Refuses (kInvalidArgument) a spacing with more than max_cells cells in the bounds, (kUnsuitableShape) a solid so
/// thin that no sample of a quarter of the spacing lies in it.
Result<CellLattice> divideIntoCells(const TriangleMesh& mesh, const SolidQuery& solid, double spacing,
                                    std::size_t max_cells = 4000000);

}  // namespace meshless
