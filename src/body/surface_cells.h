// Which cells the vertices of a cut surface follow. The surface knows what holds together exactly, the samples of cells
// do not: two vertices that an edge joins follow cells whose maps agree on it.
#pragma once

#include "meshless_surgery/body/filled_cells.h"

namespace meshless {

/// Vertices that are `loose` take over cells of their neighbours until the maps jump as little as they can along the
/// edges. Labels are exchanged one vertex at a time, in their order (iterated conditional modes: Besag 1986). kNoIndex
/// in cell: not known; stays where no neighbour's is.
void agreeOnCells(const CellLattice& lattice, const TriangleMesh& rest, const std::vector<bool>& loose,
                  std::vector<Index>& cell);

/// The lattice opens a wound as far as its cells reach, and not where the blade ended. Where copies of the same corners
/// move apart, the ends of an edge follow both, so far that the map jumps by no more than the length of the edge, in
/// spacings: each edge is projected on this in turn (Mueller et al. 2007), until all of them comply.
std::vector<CellShares> easeAcrossTears(const CellLattice& lattice, const TriangleMesh& rest,
                                        const std::vector<Index>& cell);

}  // namespace meshless
