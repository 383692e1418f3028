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
constexpr double kSameBox = 1e-10;       // relative to the edge
constexpr std::size_t kSumChunk = 1024;  // particles at a time

// The corner of a box at q by the signs of its coordinates.
int cornerAt(const Vec3& q) { return (q.x() > 0.0 ? 1 : 0) + (q.y() > 0.0 ? 2 : 0) + (q.z() > 0.0 ? 4 : 0); }

// Half the edges of an axis-aligned box with equal masses at its corners; zero for another cluster.
Vec3 boxOf(const MatchInput& in, Index c) {
  const Index begin = in.clusters.offsets[c];
  if (in.clusters.offsets[c + 1] - begin != kCorners) return Vec3::Zero();
  const ClusterRest& rest = in.shape.clusters[c];
  const Vec3 half = (in.rest[in.clusters.members[begin]] - rest.centre).cwiseAbs();
  int seen = 0;
  for (Index k = begin; k < begin + kCorners; ++k) {
    const Index i = in.clusters.members[k];
    const Vec3 q = in.rest[i] - rest.centre;
    seen |= 1 << cornerAt(q);
    if (!((q.cwiseAbs() - half).cwiseAbs().maxCoeff() <= kSameBox * half.minCoeff())) return Vec3::Zero();
    const double share = in.masses[i] * in.clusters.weights[k] / rest.mass;
    if (!(std::abs(share - 0.125) < 1e-12)) return Vec3::Zero();
  }
  return seen == 0xff ? half : Vec3::Zero();
}

elastic_sets::BlockResult accelerateBlock(const elastic_sets::Block& block, InstructionSet set) {
#if MESHLESS_ROTATION_X86
  if (set == InstructionSet::kAvx512 && instructionSetAvailable(set)) return elastic_sets::avx512::accelerate(block);
  if (set == InstructionSet::kAvx2 && instructionSetAvailable(set)) return elastic_sets::avx2::accelerate(block);
#endif
  return elastic_sets::baseline::accelerate(block);
}

}  // namespace

ElasticBatch::ElasticBatch(const MatchInput& in, const std::vector<ElasticRest>& elastic) {
  std::vector<Index> box_clusters, small_clusters;
  others_.offsets.push_back(0);
  for (Index c = 0; c < in.clusters.size(); ++c) {
    const ClusterRest& rest = in.shape.clusters[c];
    const Index begin = in.clusters.offsets[c], end = in.clusters.offsets[c + 1];
    if (!(elastic[c].spread > 0.0)) continue;  // one point: nothing to deform
    if (rest.linear_rank && end - begin <= kCorners) {
      const Vec3 half = boxOf(in, c);
      if (half.minCoeff() > 0.0 && box_clusters.empty()) {
        half_edges_ = half;
        softness_ = 3.0 / half.squaredNorm();
      }
      const bool same = (half - half_edges_).cwiseAbs().maxCoeff() <= kSameBox * half_edges_.minCoeff();
      (!box_clusters.empty() || half.minCoeff() > 0.0) && same ? box_clusters.push_back(c)
                                                               : small_clusters.push_back(c);
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
  makeBlocks(box_clusters.size(), small_clusters.size());
  shapes_.assign((blocks_ - box_blocks_) * kBlock * elastic_sets::kShapeRows, 0.0);
  addLanes(in, elastic, box_clusters, true);
  addLanes(in, elastic, small_clusters, false);

  findForces(
      in.rest.size(), [&](Index c) { return in.clusters.offsets[c + 1] - in.clusters.offsets[c]; }, in.masses);
}

ElasticBatch::ElasticBatch(const ElasticCells& body) {
  others_.offsets.push_back(0);
  half_edges_ = Vec3::Constant(body.half_edge);
  softness_ = 1.0 / (body.half_edge * body.half_edge);
  std::vector<Index> whole, partial;
  for (Index c = 0; c < body.cells.size(); ++c) {
    const ElasticCell& cell = body.cells[c];
    const bool is_whole = cell.centroid.cwiseAbs().maxCoeff() < kSameBox &&
                          (cell.variance - Vec3::Constant(1.0 / 3.0)).cwiseAbs().maxCoeff() < kSameBox &&
                          cell.mix.isOwn();
    (is_whole ? whole : partial).push_back(c);
  }
  makeBlocks(whole.size(), partial.size());
  cells_.assign((blocks_ - box_blocks_) * kBlock * elastic_sets::kCellRows, 0.0);
  const auto add = [&](const std::vector<Index>& cells, std::size_t first) {
    for (std::size_t n = 0; n < (cells.size() + kBlock - 1) / kBlock * kBlock; ++n) {
      const std::size_t block = first + n / kBlock, i = n % kBlock;
      const Index c = cells[std::min(n, cells.size() - 1)];
      const ElasticCell& cell = body.cells[c];
      if (n < cells.size()) clusters_[block * kBlock + i] = c;
      masses_[block * kBlock + i] = cell.mass;
      for (int k = 0; k < kCorners; ++k) particles_[(block * kCorners + k) * kBlock + i] = cell.corners[k];
      if (block < box_blocks_) continue;
      double* const rows = cells_.data() + (block - box_blocks_) * kBlock * elastic_sets::kCellRows + i;
      for (int axis = 0; axis < 3; ++axis) rows[(elastic_sets::kCentroidRow + axis) * kBlock] = cell.centroid[axis];
      for (int m = 0; m < 4; ++m)
        rows[(elastic_sets::kModeRow + m) * kBlock] =
            (cell.mix.own + cell.mix.youngs) *
            elastic_law::hourglassStiffness(cell.variance, elastic_law::kHourglassModes[m]) / kHourglass;
      rows[elastic_sets::kOwnRow * kBlock] = cell.mix.own;
      rows[elastic_sets::kShearRow * kBlock] = 2.0 * cell.mix.mu;
      rows[elastic_sets::kPressureRow * kBlock] = cell.mix.lambda;
    }
  };
  add(whole, 0);
  add(partial, box_blocks_);
  findForces(
      body.masses.size(), [](Index) { return Index{kCorners}; }, body.masses);
}

void ElasticBatch::makeBlocks(std::size_t boxes, std::size_t others) {
  boxes_ = static_cast<Index>(boxes);
  small_ = static_cast<Index>(others);
  box_blocks_ = (boxes + kBlock - 1) / kBlock;
  blocks_ = box_blocks_ + (others + kBlock - 1) / kBlock;
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
                            const std::vector<Index>& clusters, bool boxes) {
  if (clusters.empty()) return;
  const std::size_t first = boxes ? 0 : box_blocks_;
  const std::size_t end = ((clusters.size() + kBlock - 1) / kBlock) * kBlock;
  for (std::size_t n = 0; n < end; ++n) {
    const std::size_t block = first + n / kBlock, i = n % kBlock;
    const Index c = clusters[std::min(n, clusters.size() - 1)];
    if (n < clusters.size()) clusters_[block * kBlock + i] = c;
    const ClusterRest& rest = in.shape.clusters[c];
    masses_[block * kBlock + i] = rest.mass;
    const Index begin = in.clusters.offsets[c], members = in.clusters.offsets[c + 1] - begin;
    std::uint32_t* const particles = particles_.data() + block * kCorners * kBlock + i;
    if (boxes) {
      for (Index k = begin; k < begin + members; ++k) {
        const Index particle = in.clusters.members[k];
        particles[cornerAt(in.rest[particle] - rest.centre) * kBlock] = particle;
      }
      continue;
    }
    double* const shape = shapes_.data() + (block - box_blocks_) * kBlock * elastic_sets::kShapeRows + i;
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
    const std::size_t box_lanes = boxes_, small_lanes = small_;
    const bool boxes = index < box_blocks_;
    const std::size_t left = boxes ? box_lanes - index * kBlock : small_lanes - (index - box_blocks_) * kBlock;
    block.count = static_cast<int>(std::min<std::size_t>(left, kBlock));
    block.positions = y.data()->data();
    block.particles = particles_.data() + index * kCorners * kBlock;
    block.masses = masses_.data() + index * kBlock;
    if (!boxes && cells_.empty())
      block.shape = shapes_.data() + (index - box_blocks_) * kBlock * elastic_sets::kShapeRows;
    else if (!boxes)
      block.cells = cells_.data() + (index - box_blocks_) * kBlock * elastic_sets::kCellRows;
    for (int k = 0; k < 3; ++k) block.half_edges[k] = half_edges_[k];
    block.softness = softness_;
    block.shrink = 1.0 / swelling;
    block.shear = 2.0 * material.mu / material.density;
    block.pressure = material.lambda / material.density;
    block.hourglass = kHourglass * material.youngs / material.density;
    block.youngs = material.youngs / material.density;
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
  counters.clusters += boxes_ + small_;
  counters.rotations += boxes_ + small_;
  counters.linear_fits += boxes_ + small_;
  return std::max(stretch, std::sqrt(most / 3.0));
}

std::size_t ElasticBatch::bytes() const {
  return sizeof *this + bytesOf(clusters_, particles_, masses_, shapes_, cells_) +
         bytesOf(force_offsets_, force_places_, inverse_masses_) +
         bytesOf(others_.offsets, others_.members, others_.weights, others_.seeds, others_.radii) +
         bytesOf(other_clusters_, other_shape_.clusters, other_shape_.quadratic, other_elastic_);
}

}  // namespace meshless
