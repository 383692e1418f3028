#include "meshless_surgery/body/filled_cells.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "meshless_surgery/base/compressed_rows.h"
#include "meshless_surgery/geometry/lattice/cell_regions.h"
#include "meshless_surgery/geometry/lattice/cut_lattice.h"

namespace meshless {
namespace {

constexpr double kFarthestCentroid = 0.9;  // [half edges] a fit nearer to a face would need weights near zero

// What a cell weighs goes to its corners.
void addMass(const BodyModel& model, const LatticeCell& cell, std::vector<double>& masses) {
  SampleSet samples = cell.filled;
  const auto add = [&](SampleSet part, double density) {
    if (!part) return;
    const FilledMoments moments = momentsOf(part);
    for (Index k = 0; k < 8; ++k)
      masses[cell.corners[k]] +=
          density * model.cell_mass * moments.fraction * cell.mass_share * moments.corner_shares[k];
  };
  if (model.lattice->regions)
    for (const CellRegions::Part& part : model.lattice->regions->at(cell.place)) {
      add(samples & part.samples, model.regions[part.region].density);
      samples &= ~part.samples;
    }
  add(samples, 1.0);
}

// What resists in a cell is made of.
ElasticMix mixOf(const BodyModel& model, const LatticeCell& cell) {
  ElasticMix mix;
  if (!model.lattice->regions) return mix;
  SampleSet own = cell.filled;
  const double all = countSamples(own);
  for (const CellRegions::Part& part : model.lattice->regions->at(cell.place)) {
    const RegionTissue& tissue = model.regions[part.region];
    const double share = countSamples(own & part.samples) / all;
    mix.mu += share * tissue.mu;
    mix.lambda += share * tissue.lambda;
    mix.youngs += share * tissue.youngs;
    mix.stiffening += share * tissue.material.stiffening;
    mix.asymmetry += share * tissue.material.asymmetry;
    own &= ~part.samples;
  }
  mix.own = countSamples(own) / all;
  return mix;
}

// Links along the edges of cells: makeGraph() of them, found corner by corner.
ParticleGraph alongEdges(const CellLattice& lattice, const Points& rest) {
  std::vector<Index> offsets, ends;
  const auto each = [&](const auto& visit) {
    for (const LatticeCell& cell : lattice.cells)
      for (Index k = 0; k < 8; ++k)
        for (const Index bit : {1u, 2u, 4u}) visit(cell.corners[k], cell.corners[k ^ bit]);
  };
  compressRows(lattice.corners, each, offsets, ends);
  ParticleGraph graph;
  graph.offsets.push_back(0);
  for (Index i = 0; i < lattice.corners; ++i) {
    const auto row = ends.begin() + offsets[i], end = ends.begin() + offsets[i + 1];
    std::sort(row, end);
    for (auto j = row; j != end; ++j)
      if (*j != i && (j == row || *j != *(j - 1))) {
        graph.neighbours.push_back(*j);
        graph.lengths.push_back((rest[i] - rest[*j]).norm());
      }
    graph.offsets.push_back(static_cast<Index>(graph.neighbours.size()));
  }
  return graph;
}

Vec3 centroidOf(const Resistance& resists) {
  return resists.centroid.cwiseMax(-kFarthestCentroid).cwiseMin(kFarthestCentroid);
}

// What fills a cell hardly does not hold its far corners, and what touches the surface throws them: it is as stiff
// against bending as what fills a cell.
Vec3 varianceOf(const Resistance& resists) {
  constexpr double kHardlyFilled = 0.26;
  return resists.fraction < kHardlyFilled ? resists.variance.cwiseMax(Resistance().variance) : resists.variance;
}

}  // namespace

double squaredToSamples(SampleSet samples, const Vec3& at) {
  if (!samples) return std::numeric_limits<double>::infinity();
  return (samplePlace(nearestSample(samples, at)) - at).squaredNorm();
}

void makeParticlesOfCells(BodyModel& model) {
  const CellLattice& lattice = *model.lattice;
  model.rest = cornerPlaces(lattice);
  model.masses.assign(lattice.corners, 0.0);
  model.tissue = cornersWithTissue(lattice);
  for (const LatticeCell& cell : lattice.cells) addMass(model, cell, model.masses);
  model.graph = alongEdges(lattice, model.rest);
}

void holdCorners(BodyModel& model) {
  model.fixed.assign(model.lattice->corners, false);
  for (const LatticeCell& cell : model.lattice->cells)
    if (cell.held)
      for (const Index corner : cell.corners) model.fixed[corner] = model.any_fixed = true;
}

std::vector<double> stiffnessOfParticles(const BodyModel& model) {
  if (!model.lattice || !model.lattice->regions) return {};
  std::vector<double> sums(model.lattice->corners, 0.0), counts(sums);
  for (const LatticeCell& cell : model.lattice->cells) {
    const ElasticMix mix = mixOf(model, cell);
    for (const Index corner : cell.corners) {
      sums[corner] += mix.own + mix.youngs;
      counts[corner] += 1.0;
    }
  }
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] = counts[i] > 0.0 ? sums[i] / counts[i] : 1.0;
  return sums;
}

ElasticCells elasticCellsOf(const BodyModel& model) {
  const CellLattice& lattice = *model.lattice;
  ElasticCells elastic;
  elastic.half_edge = 0.5 * lattice.spacing;
  elastic.masses = model.masses;
  for (const LatticeCell& cell : lattice.cells) {
    const Vec3 fibre = model.specific_fibres > 0.0 ? model.fibres[elastic.cells.size()] : Vec3(Vec3::Zero());
    elastic.cells.push_back({cell.corners, model.cell_mass * cell.stiffness_share * cell.resists.fraction,
                             centroidOf(cell.resists), varianceOf(cell.resists), mixOf(model, cell), fibre});
  }
  return elastic;
}

CellFinder::CellFinder(const CellLattice& lattice) : lattice_(lattice) {
  std::array<std::int32_t, 3> upper = lattice.cells[0].place;
  lower_ = upper;
  for (const LatticeCell& cell : lattice.cells)
    for (int k = 0; k < 3; ++k) {
      lower_[k] = std::min(lower_[k], cell.place[k]);
      upper[k] = std::max(upper[k], cell.place[k]);
    }
  std::size_t count = 1;
  for (int k = 0; k < 3; ++k) {
    size_[k] = upper[k] - lower_[k] + 1;
    count *= static_cast<std::size_t>(size_[k]);
  }
  cells_.resize(count + 1);  // the last is that of no place
  for (Index c = 0; c < lattice.cells.size(); ++c) {
    const auto& p = lattice.cells[c].place;
    cells_[static_cast<std::size_t>(p[0] - lower_[0]) +
           static_cast<std::size_t>(size_[0]) *
               (static_cast<std::size_t>(p[1] - lower_[1]) +
                static_cast<std::size_t>(size_[1]) * static_cast<std::size_t>(p[2] - lower_[2]))]
        .push_back(c);
  }
}

const std::vector<Index>& CellFinder::at(const std::array<std::int32_t, 3>& place) const {
  std::size_t index = 0;
  for (int k = 2; k >= 0; --k) {
    if (place[k] < lower_[k] || place[k] >= lower_[k] + size_[k]) return cells_.back();
    index = index * static_cast<std::size_t>(size_[k]) + static_cast<std::size_t>(place[k] - lower_[k]);
  }
  return cells_[index];
}

Index CellFinder::nearest(const Vec3& rest, const Allowed& allowed) const {
  const Vec3 place = (rest - lattice_.origin) / lattice_.spacing;
  std::array<std::int32_t, 3> own;
  for (int k = 0; k < 3; ++k) {
    if (!(std::abs(place[k]) < 1e9)) return kNoIndex;
    own[k] = static_cast<std::int32_t>(std::floor(place[k]));
  }
  Index best = kNoIndex;
  double least = std::numeric_limits<double>::infinity();
  for (std::int32_t reach = 0; reach <= 2; ++reach) {
    for (std::int32_t z = -reach; z <= reach; ++z)
      for (std::int32_t y = -reach; y <= reach; ++y)
        for (std::int32_t x = -reach; x <= reach; ++x) {
          if (std::max({std::abs(x), std::abs(y), std::abs(z)}) != reach) continue;
          for (const Index c : at({own[0] + x, own[1] + y, own[2] + z})) {
            const LatticeCell& cell = lattice_.cells[c];
            if (cell.isBridge(c) || !cell.samples) continue;
            const Vec3 in = place - Vec3(cell.place[0], cell.place[1], cell.place[2]);
            if ((in - in.cwiseMax(0.0).cwiseMin(1.0)).squaredNorm() >= least) continue;
            const double squared = squaredToSamples(allowed ? allowed(c) : cell.samples, in);
            if (squared < least) {
              least = squared;
              best = c;
            }
          }
        }
    // What is farther away by whole cells is not nearer.
    if (best != kNoIndex && least <= static_cast<double>(reach) * reach + 0.02) break;
  }
  return best;
}

}  // namespace meshless
