// Bodies whose lattice knows how far each cell is filled: particles are its corners, masses and stiffness those of what
// fills the cells, and the surface is embedded in them.
#pragma once

#include <functional>

#include "meshless_surgery/body/body.h"
#include "meshless_surgery/geometry/lattice/cell_lattice.h"

namespace meshless {

/// Rest places, masses, graph and clusters (one a cell, corner by corner) of model.lattice; needs cell_mass. Weights of
/// clusters are made by weighCells().
void makeParticlesOfCells(BodyModel& model);

/// fixed and any_fixed, of the corners of cells that are held.
void holdCorners(BodyModel& model);

/// Weights of the clusters of model.lattice. Elastic: those that make a cell's affine fit the trilinear map's gradient
/// at the centroid of what fills it, and its mass what it resists with; they need not add up to 1. Else every particle
/// is shared out to its cells, in proportion to what they have of it.
void weighCells(BodyModel& model, bool elastic);

/// What an elastic step needs of model.lattice, for its clusters' masses.
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
