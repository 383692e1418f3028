// Cutting a lattice of cells: each part that a blade leaves of a cell becomes a copy of it (virtual nodes: Molino et
// al. 2004; Sifakis et al. 2007). A pure function.
#pragma once

#include "meshless_surgery/geometry/lattice/cell_lattice.h"
#include "meshless_surgery/geometry/query/blade.h"

namespace meshless {

struct CutLattice {
  CellLattice lattice;               // of all pieces; places as before
  std::vector<Index> parent_cell;    // one a cell: what it was, or was a part of
  std::vector<Index> parent_corner;  // one a corner
  std::vector<bool> changed;         // one a cell: a link of its cell was cut
  std::vector<SampleSet> above;      // one a cell: its samples on the side of the blade's normal
};

/// `corners` [m] are where the corners are at present. Links between samples that pass through the blade are cut; parts
/// that no link joins get corners of their own. Where the blade ends in a cell, its two sides are parted altogether and
/// a bridge holds them together: with f the share of the links that are cut, the parts have 1 - (1-f)^2 of their
/// stiffness and the bridge (1-f)^2; it has no mass. A face between cells that a blade covers in part is parted
/// altogether, and the cell below it has a bridge to the one above, likewise. The masses of a corner's copies add up to
/// what it had.
CutLattice cutLattice(const CellLattice& lattice, const Points& corners, const Blade& blade);

/// Which corners have a sample of one of their cells in the eighth of it that is nearest to them.
std::vector<bool> cornersWithTissue(const CellLattice& lattice);

}  // namespace meshless
