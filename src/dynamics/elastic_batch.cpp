#include "meshless_surgery/dynamics/elastic_batch.h"

#include <algorithm>
#include <cmath>

#include "elastic_batch_sets.h"
#include "elastic_law.h"
#include "meshless_surgery/base/bytes.h"
#include "meshless_surgery/base/compressed_rows.h"

namespace meshless {
namespace {

using elastic_sets::kBlock;
using elastic_sets::kCorners;

constexpr double kHourglass = 0.3;       // as in elastic.cpp
constexpr double kWhole = 1e-10;         // in half edges: of a whole cell's centroid and variance
constexpr std::size_t kSumChunk = 1024;  // particles at a time

elastic_sets::BlockResult accelerateBlock(const elastic_sets::Block& block, InstructionSet set) {
#if MESHLESS_ROTATION_X86
  if (set == InstructionSet::kAvx512 && instructionSetAvailable(set)) return elastic_sets::avx512::accelerate(block);
  if (set == InstructionSet::kAvx2 && instructionSetAvailable(set)) return elastic_sets::avx2::accelerate(block);
#endif
  return elastic_sets::baseline::accelerate(block);
}

}  // namespace

ElasticBatch::ElasticBatch(const MatchInput& in, const std::vector<ElasticRest>& elastic) {
  std::vector<Index> small_clusters;
  others_.offsets.push_back(0);
  for (Index c = 0; c < in.clusters.size(); ++c) {
    const ClusterRest& rest = in.shape.clusters[c];
    const Index begin = in.clusters.offsets[c], end = in.clusters.offsets[c + 1];
    if (!(elastic[c].spread > 0.0)) continue;  // one point: nothing to deform
    if (rest.linear_rank && end - begin <= kCorners) {
      small_clusters.push_back(c);
      continue;
    }
    other_clusters_.push_back(c);
    others_.members.insert(others_.members.end(), in.clusters.members.begin() + begin,
                           in.clusters.members.begin() + end);
    others_.weights.insert(others_.weights.end(), in.clusters.weights.begin() + begin,
                           in.clusters.weights.begin() + end);
    others_.offsets.push_back(static_cast<Index>(others_.members.size()));
    other_shape_.clusters.push_back(rest);
    other_elastic_.push_back(elastic[c]);
  }
  makeBlocks(0, small_clusters.size());
  shapes_.assign(blocks_ * kBlock * elastic_sets::kShapeRows, 0.0);
  addLanes(in, elastic, small_clusters);

  findForces(
      in.rest.size(), [&](Index c) { return in.clusters.offsets[c + 1] - in.clusters.offsets[c]; }, in.masses);
}

ElasticBatch::ElasticBatch(const ElasticCells& body) {
  others_.offsets.push_back(0);
  half_edge_ = body.half_edge;
  std::vector<Index> whole, partial;
  for (Index c = 0; c < body.cells.size(); ++c) {
    const ElasticCell& cell = body.cells[c];
    const bool is_whole = cell.centroid.cwiseAbs().maxCoeff() < kWhole &&
                          (cell.variance - Vec3::Constant(1.0 / 3.0)).cwiseAbs().maxCoeff() < kWhole &&
                          cell.mix.isOwn();
    (is_whole ? whole : partial).push_back(c);
  }
  makeBlocks(whole.size(), partial.size());
  cells_.assign((blocks_ - whole_blocks_) * kBlock * elastic_sets::kCellRows, 0.0);
  if (std::any_of(body.cells.begin(), body.cells.end(), [](const ElasticCell& cell) { return !cell.mix.isOwn(); }))
    mixes_.assign((blocks_ - whole_blocks_) * kBlock * elastic_sets::kMixRows, 0.0);
  if (std::any_of(body.cells.begin(), body.cells.end(), [](const ElasticCell& cell) { return !cell.fibre.isZero(0.0); }))
    fibres_.assign(blocks_ * 3 * kBlock, 0.0);
  const auto add = [&](const std::vector<Index>& cells, std::size_t first) {
    for (std::size_t n = 0; n < (cells.size() + kBlock - 1) / kBlock * kBlock; ++n) {
      const std::size_t block = first + n / kBlock, i = n % kBlock;
      const Index c = cells[std::min(n, cells.size() - 1)];
      const ElasticCell& cell = body.cells[c];
      if (n < cells.size()) clusters_[block * kBlock + i] = c;
      masses_[block * kBlock + i] = cell.mass;
      for (int axis = 0; axis < 3 && !fibres_.empty(); ++axis)
        fibres_[(block * 3 + static_cast<std::size_t>(axis)) * kBlock + i] = cell.fibre[axis];
      for (int k = 0; k < kCorners; ++k) particles_[(block * kCorners + k) * kBlock + i] = cell.corners[k];
      if (block < whole_blocks_) continue;
      double* const rows = cells_.data() + (block - whole_blocks_) * kBlock * elastic_sets::kCellRows + i;
      for (int axis = 0; axis < 3; ++axis) rows[(elastic_sets::kCentroidRow + axis) * kBlock] = cell.centroid[axis];
      for (int axis = 0; axis < 3; ++axis) rows[(elastic_sets::kVarianceRow + axis) * kBlock] = cell.variance[axis];
      if (mixes_.empty()) continue;
      double* const mix = mixes_.data() + (block - whole_blocks_) * kBlock * elastic_sets::kMixRows + i;
      mix[elastic_sets::kOwnRow * kBlock] = cell.mix.own;
      mix[elastic_sets::kShearRow * kBlock] = 2.0 * cell.mix.mu;
      mix[elastic_sets::kPressureRow * kBlock] = cell.mix.lambda;
      mix[elastic_sets::kStiffeningRow * kBlock] = cell.mix.stiffening;
      mix[elastic_sets::kAsymmetryRow * kBlock] = cell.mix.asymmetry;
      mix_stiffens_ = mix_stiffens_ || cell.mix.stiffens();
    }
  };
  add(whole, 0);
  add(partial, whole_blocks_);
  findForces(
      body.masses.size(), [](Index) { return Index{kCorners}; }, body.masses);
}

void ElasticBatch::makeBlocks(std::size_t whole, std::size_t others) {
  whole_ = static_cast<Index>(whole);
  small_ = static_cast<Index>(others);
  whole_blocks_ = (whole + kBlock - 1) / kBlock;
  blocks_ = whole_blocks_ + (others + kBlock - 1) / kBlock;
  clusters_.assign(blocks_ * kBlock, kNoIndex);
  particles_.assign(blocks_ * kBlock * kCorners, 0);
  masses_.assign(blocks_ * kBlock, 0.0);
}

void ElasticBatch::findForces(std::size_t particles, const std::function<Index(Index)>& members,
                              const std::vector<double>& masses) {
  // Cluster order of lanes: a particle's forces are added in the same order whatever the threads and the vectors are.
  const auto forEachPlace = [&](const auto& visit) {
    for (std::size_t lane = 0; lane < clusters_.size(); ++lane) {
      if (clusters_[lane] == kNoIndex) continue;
      const std::size_t block = lane / kBlock, i = lane % kBlock;
      for (Index k = 0; k < members(clusters_[lane]); ++k)
        visit(particles_[(block * kCorners + k) * kBlock + i],
              static_cast<Index>((block * kCorners + k) * 3 * kBlock + i));
    }
  };
  compressRows(particles, forEachPlace, force_offsets_, force_places_);
  for (double m : masses) inverse_masses_.push_back(1.0 / m);
}

void ElasticBatch::addLanes(const MatchInput& in, const std::vector<ElasticRest>& elastic,
                            const std::vector<Index>& clusters) {
  if (clusters.empty()) return;
  for (std::size_t n = 0; n < blocks_ * kBlock; ++n) {
    const std::size_t block = n / kBlock, i = n % kBlock;
    const Index c = clusters[std::min(n, clusters.size() - 1)];
    if (n < clusters.size()) clusters_[n] = c;
    const ClusterRest& rest = in.shape.clusters[c];
    masses_[n] = rest.mass;
    const Index begin = in.clusters.offsets[c], members = in.clusters.offsets[c + 1] - begin;
    std::uint32_t* const particles = particles_.data() + block * kCorners * kBlock + i;
    double* const shape = shapes_.data() + block * kBlock * elastic_sets::kShapeRows + i;
    for (Index k = 0; k < kCorners; ++k) {
      // A corner that is missing has no mass and lies on another.
      const Index particle = in.clusters.members[begin + (k < members ? k : 0)];
      particles[k * kBlock] = particle;
      if (k >= members) continue;
      const Vec3 q = in.rest[particle] - rest.centre;
      for (Index axis = 0; axis < 3; ++axis) shape[(elastic_sets::kRestRow + 3 * k + axis) * kBlock] = q[axis];
      shape[(elastic_sets::kShareRow + k) * kBlock] = in.masses[particle] * in.clusters.weights[begin + k] / rest.mass;
    }
    const Mat3& s = elastic[c].spread_inverse;
    const double upper[6] = {s(0, 0), s(0, 1), s(0, 2), s(1, 1), s(1, 2), s(2, 2)};
    for (int k = 0; k < 6; ++k) shape[(elastic_sets::kInverseRow + k) * kBlock] = upper[k];
    shape[elastic_sets::kSoftnessRow * kBlock] = 1.0 / elastic[c].spread;
  }
}

void ElasticBatch::setRotations(const std::vector<ClusterPose>& poses, ElasticBatchState& state) const {
  state.rotations.resize(blocks_ * 4 * kBlock);
  state.forces.resize(blocks_ * 3 * kCorners * kBlock);
  state.largest.resize(blocks_);
  state.cold.resize(blocks_);
  for (std::size_t lane = 0; lane < clusters_.size(); ++lane) {
    Quat q = Quat::Identity();
    if (clusters_[lane] != kNoIndex) q = poses[clusters_[lane]].rotation;
    const double squared = q.squaredNorm();
    // One that is unit but for rounding is kept to the bit.
    if (!(std::abs(squared - 1.0) < 2e-14)) {
      if (!(squared > 1e-20 && squared < 1e20)) q = Quat::Identity();
      q.normalize();
    }
    for (int k = 0; k < 4; ++k) state.rotations[(lane / kBlock * 4 + k) * kBlock + lane % kBlock] = q.coeffs()[k];
  }
  state.others.resize(other_clusters_.size());
  for (std::size_t n = 0; n < other_clusters_.size(); ++n)
    state.others[n].rotation = poses[other_clusters_[n]].rotation;
}

void ElasticBatch::getRotations(const ElasticBatchState& state, std::vector<ClusterPose>& poses) const {
  for (std::size_t lane = 0; lane < clusters_.size(); ++lane)
    if (clusters_[lane] != kNoIndex)
      for (int k = 0; k < 4; ++k)
        poses[clusters_[lane]].rotation.coeffs()[k] = state.rotations[(lane / kBlock * 4 + k) * kBlock + lane % kBlock];
  for (std::size_t n = 0; n < other_clusters_.size(); ++n)
    poses[other_clusters_[n]].rotation = state.others[n].rotation;
}

void ElasticBatch::setRelaxed(const std::vector<RelaxedStrain>& relaxed, int branches, ElasticBatchState& state) const {
  const std::size_t rows = elastic_sets::kStrainRows * static_cast<std::size_t>(branches);
  state.relaxed.assign(blocks_ * rows * kBlock, 0.0);
  for (std::size_t lane = 0; lane < clusters_.size(); ++lane)
    if (clusters_[lane] != kNoIndex)
      for (std::size_t row = 0; row < rows; ++row)
        state.relaxed[(lane / kBlock * rows + row) * kBlock + lane % kBlock] =
            relaxed[clusters_[lane]].of[row / elastic_sets::kStrainRows][row % elastic_sets::kStrainRows];
}

void ElasticBatch::getRelaxed(const ElasticBatchState& state, std::vector<RelaxedStrain>& relaxed) const {
  const std::size_t rows = blocks_ > 0 ? state.relaxed.size() / (blocks_ * kBlock) : 0;
  std::fill(relaxed.begin(), relaxed.end(), RelaxedStrain());
  for (std::size_t lane = 0; lane < clusters_.size(); ++lane)
    if (clusters_[lane] != kNoIndex)
      for (std::size_t row = 0; row < rows; ++row)
        relaxed[clusters_[lane]].of[row / elastic_sets::kStrainRows][row % elastic_sets::kStrainRows] =
            state.relaxed[(lane / kBlock * rows + row) * kBlock + lane % kBlock];
}

void ElasticBatch::setUnstressed(const std::vector<PlasticShape>& shapes, ElasticBatchState& state) const {
  state.unstressed.clear();
  if (shapes.empty()) return;
  state.unstressed.assign(blocks_ * elastic_sets::kUnstressedRows * kBlock, 0.0);
  for (std::size_t lane = 0; lane < clusters_.size(); ++lane) {
    if (clusters_[lane] == kNoIndex) continue;
    const PlasticShape& shape = shapes[clusters_[lane]];
    const Mat3& s = shape.inverse;
    const double rows[] = {s(0, 0), s(0, 1), s(0, 2), s(1, 1), s(1, 2), s(2, 2), shape.stiffening * shape.stiffening};
    for (int row = 0; row < elastic_sets::kUnstressedRows; ++row)
      state.unstressed[(lane / kBlock * elastic_sets::kUnstressedRows + row) * kBlock + lane % kBlock] = rows[row];
  }
}

void ElasticBatch::sumForces(std::size_t first, std::size_t last, const double* forces, Points& accelerations) const {
  for (std::size_t i = first; i < last; ++i) {
    double x = 0.0, y = 0.0, z = 0.0;
    for (std::uint32_t n = force_offsets_[i]; n < force_offsets_[i + 1]; ++n) {
      const double* const f = forces + force_places_[n];
      x += f[0];
      y += f[kBlock];
      z += f[2 * kBlock];
    }
    const Vec3 mine = inverse_masses_[i] * Vec3(x, y, z);
    accelerations[i] = other_clusters_.empty() ? Vec3(-mine) : Vec3(accelerations[i] - mine);
  }
}

double ElasticBatch::accelerate(const MatchInput& in, const ElasticParameters& material, const Points& y,
                                ElasticBatchState& state, Points& accelerations, MatchCounters& counters,
                                double swelling, InstructionSet set, const ForEach& for_each) const {
  double stretch = 1.0;
  if (other_clusters_.empty())
    accelerations.resize(y.size());
  else
    stretch = elasticAccelerations({in.rest, in.masses, others_, other_shape_}, other_elastic_, material, y,
                                   state.others, accelerations, counters, swelling);
  const auto solve = [&](std::size_t index) {
    elastic_sets::Block block;
    const std::size_t whole_lanes = whole_, small_lanes = small_;
    const bool whole = index < whole_blocks_;
    const std::size_t left = whole ? whole_lanes - index * kBlock : small_lanes - (index - whole_blocks_) * kBlock;
    block.count = static_cast<int>(std::min<std::size_t>(left, kBlock));
    block.positions = y.data()->data();
    block.particles = particles_.data() + index * kCorners * kBlock;
    block.masses = masses_.data() + index * kBlock;
    if (!shapes_.empty())
      block.shape = shapes_.data() + index * kBlock * elastic_sets::kShapeRows;
    else if (!whole)
      block.cells = cells_.data() + (index - whole_blocks_) * kBlock * elastic_sets::kCellRows;
    if (!whole && !mixes_.empty())
      block.mixes = mixes_.data() + (index - whole_blocks_) * kBlock * elastic_sets::kMixRows;
    if (!fibres_.empty()) {
      block.fibres = fibres_.data() + index * 3 * kBlock;
      block.fibre = material.fibres / material.density;
      block.fibre_stiffening = material.fibre_stiffening;
    }
    block.half_edge = half_edge_;
    block.shrink = 1.0 / swelling;
    block.shear = 2.0 * material.mu / material.density;
    block.pressure = material.lambda / material.density;
    block.hourglass = kHourglass * material.youngs / material.density;
    block.youngs = material.youngs / material.density;
    block.stiffens = material.stiffens() || (block.mixes && mix_stiffens_);
    block.stiffening = material.stiffening;
    block.asymmetry = material.asymmetry;
    if (!state.relaxed.empty()) {
      block.branches = material.relaxation.branches;
      block.shares = material.relaxation.shares.data();
      block.taken = material.relaxation.taken.data();
      block.share = material.relaxation.all;
      block.relaxed = state.relaxed.data() + index * elastic_sets::kStrainRows *
                                                 static_cast<std::size_t>(material.relaxation.branches) * kBlock;
    }
    if (!state.unstressed.empty())
      block.unstressed = state.unstressed.data() + index * elastic_sets::kUnstressedRows * kBlock;
    block.rotations = state.rotations.data() + index * 4 * kBlock;
    block.forces = state.forces.data() + index * 3 * kCorners * kBlock;
    const elastic_sets::BlockResult result = accelerateBlock(block, set);
    state.largest[index] = result.most;
    state.cold[index] = result.cold;
  };
  const auto sum = [&](std::size_t chunk) {
    sumForces(chunk * kSumChunk, std::min(y.size(), (chunk + 1) * kSumChunk), state.forces.data(), accelerations);
  };
  const std::size_t chunks = (y.size() + kSumChunk - 1) / kSumChunk;
  if (for_each) {
    for_each(blocks_, std::cref(solve));
    for_each(chunks, std::cref(sum));
  } else {
    for (std::size_t b = 0; b < blocks_; ++b) solve(b);
    for (std::size_t c = 0; c < chunks; ++c) sum(c);
  }
  double most = 3.0;
  for (std::size_t b = 0; b < blocks_; ++b) {
    most = std::max(most, state.largest[b]);
    counters.cold_rotations += state.cold[b];
  }
  counters.clusters += whole_ + small_;
  counters.rotations += whole_ + small_;
  counters.linear_fits += whole_ + small_;
  return std::max(stretch, std::sqrt(most / 3.0));
}

std::size_t ElasticBatch::bytes() const {
  return sizeof *this + bytesOf(clusters_, particles_, masses_, shapes_, cells_, mixes_, fibres_) +
         bytesOf(force_offsets_, force_places_, inverse_masses_) +
         bytesOf(others_.offsets, others_.members, others_.weights) +
         bytesOf(other_clusters_, other_shape_.clusters, other_shape_.quadratic, other_elastic_);
}

}  // namespace meshless
