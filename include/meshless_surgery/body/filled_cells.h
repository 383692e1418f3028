// Solids: particles are the corners of the cells of a lattice, masses and stiffness those of what fills them, and the
// surface is embedded in them.
#pragma once

#include <functional>

#include "meshless_surgery/body/body.h"
#include "meshless_surgery/geometry/lattice/cell_lattice.h"

namespace meshless {

/// Rest positions, masses and graph of model.lattice; needs cell_mass.
void makeParticlesOfCells(BodyModel& model);

/// fixed and any_fixed, of the corners of cells that are held.
void holdCorners(BodyModel& model);

/// What an elastic step needs of model.lattice.
ElasticCells elasticCellsOf(const BodyModel& model);

/// Which cell a place in the rest shape belongs to: the one with the nearest sample.
class CellFinder {
 public:
  /// The samples of a cell that count; kNoSample where it does not.
  using Allowed = std::function<SampleSet(Index cell)>;

  /// Keeps a reference.
  explicit CellFinder(const CellLattice& lattice);

  /// Of the allowed cells that have samples and are no bridges; kNoIndex where none is within two cells of it.
  Index nearest(const Vec3& rest, const Allowed& allowed = nullptr) const;
  /// Cells at a place of the lattice; bridges too.
  const std::vector<Index>& at(const std::array<std::int32_t, 3>& place) const;

 private:
  const CellLattice& lattice_;
  std::array<std::int32_t, 3> lower_{}, size_{};
  std::vector<std::vector<Index>> cells_;
};

/// [spacing^2] from a place in a cell to the nearest of the samples; infinite where there are none.
double squaredToSamples(SampleSet samples, const Vec3& at);

}  // namespace meshless
