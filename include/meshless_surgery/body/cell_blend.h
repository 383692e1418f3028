// How a place in the tissue follows the cells around it.
#pragma once

#include "meshless_surgery/body/body.h"
#include "meshless_surgery/geometry/lattice/cell_lattice.h"

namespace meshless {

/// Which vertices of a piece keep the rows that they had in its parent: all that is two places around theirs, and what
/// joins it to more, is as it was. Those that followed a particle that the piece has not, or has copies of, get new
/// ones.
struct KeptRows {
  const SurfaceBinding* parent = nullptr;  // null: none
  std::vector<Index> vertex{};             // of each, the parent's; kNoIndex: its row is made
  std::vector<Index> particle{};           // of each of the parent's, the piece's
};

/// Binds places to the cells around them: every one follows the blend of the cells' affine maps,
///   u(X) = sum_c w_c [x_c + F_c (X - X_c)] / sum_c w_c,   w_c = (1 - d_c^2 / r^2)^2 * what fills c
/// with x_c and F_c place and gradient of a cell at the centroid X_c of what fills it. d_c is the way from X to X_c in
/// spacings. Where tissue is in the way of nothing, that is the distance. Where a wound or a gap lies between, it is
/// longer by the detour through the tissue, so that cells beyond it fade around its front and are gone where there is
/// no way (Belytschko et al. 1996; Organ et al. 1996). Affine motion is followed exactly, weights add up to 1.
///
/// rest: [m]; cell: of each, the copy of a cell whose tissue it belongs to (CellFinder). It is kept in `cells`.
///
/// kept: rows that are as they were.
SurfaceBinding bindToCells(const CellLattice& lattice, const Points& rest, const std::vector<Index>& cell,
                           const KeptRows& kept = {});

}  // namespace meshless
