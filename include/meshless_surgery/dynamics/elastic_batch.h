// elasticAccelerations() vectorised for the widest instructions that the machine has.
#pragma once

#include <functional>

#include "meshless_surgery/base/for_each.h"
#include "meshless_surgery/dynamics/elastic_cells.h"
#include "meshless_surgery/dynamics/rotation_batch.h"

namespace meshless {

/// What changes from call to call: rotations are read and written, the rest is scratch. Of one batch at a time.
struct ElasticBatchState {
  std::vector<double> rotations;
  std::vector<double> relaxed;      // of lanes; empty where the material does not relax
  std::vector<double> unstressed;   // likewise; empty where nothing has flowed
  std::vector<ClusterPose> others;  // of clusters that the reference computes
  std::vector<double> forces;
  std::vector<double> largest;  // of each block
  std::vector<std::size_t> cold;
};

/// A body's rest shape as structures of arrays. Clusters of at most eight members that span space are lanes of vectors;
/// cells that are whole need no constants of their own. The reference computes the others. Constant: one object may
/// serve many bodies of the same shape, on many threads.
class ElasticBatch {
 public:
  /// `elastic` is makeElasticRest() of input.shape. Keeps no reference.
  ElasticBatch(const MatchInput& input, const std::vector<ElasticRest>& elastic);
  /// Of cells that are filled in part or whole. Keeps no reference.
  explicit ElasticBatch(const ElasticCells& body);

  /// The rotations of poses into a state, made to fit this batch, and back. Nothing else of a pose is read or written.
  void setRotations(const std::vector<ClusterPose>& poses, ElasticBatchState& state) const;
  void getRotations(const ElasticBatchState& state, std::vector<ClusterPose>& poses) const;

  /// Likewise what cells have relaxed by, in `branches` of a relaxation; 0: nothing relaxes.
  void setRelaxed(const std::vector<RelaxedStrain>& relaxed, int branches, ElasticBatchState& state) const;
  void getRelaxed(const ElasticBatchState& state, std::vector<RelaxedStrain>& relaxed) const;

  /// The shapes that cells have without stress, one a cell; empty: those at rest. Of cells alone.
  void setUnstressed(const std::vector<PlasticShape>& shapes, ElasticBatchState& state) const;

  /// As elasticAccelerations() for the input or the cells that this was made from (then input is not read), in double:
  /// what differs is rounding, and a rotation is found to 1e-12 rad. A particle that is not finite spoils its clusters'
  /// particles and no others. Allocates nothing once state and accelerations have their sizes (but where the reference
  /// does). Results do not depend on for_each to the bit; without it all runs on the calling thread. They differ in the
  /// last bits between instruction sets.
  double accelerate(const MatchInput& input, const ElasticParameters& material, const Points& y,
                    ElasticBatchState& state, Points& accelerations, MatchCounters& counters, double swelling = 1.0,
                    InstructionSet set = widestInstructionSet(), const ForEach& for_each = nullptr) const;

  Index whole() const { return whole_; }           // cells on the fastest path
  std::size_t bytes() const;                       // that it holds
  Index others() const { return others_.size(); }  // clusters on the slowest

 private:
  void addLanes(const MatchInput& input, const std::vector<ElasticRest>& elastic, const std::vector<Index>& clusters);
  void makeBlocks(std::size_t whole, std::size_t others);
  void findForces(std::size_t particles, const std::function<Index(Index cluster)>& members,
                  const std::vector<double>& masses);
  void sumForces(std::size_t first, std::size_t last, const double* forces, Points& accelerations) const;

  // Blocks of lanes: first those of whole cells alone. `clusters_` names a lane's cluster, kNoIndex where a block is
  // padded.
  std::size_t blocks_ = 0, whole_blocks_ = 0;
  Index whole_ = 0, small_ = 0;
  std::vector<Index> clusters_;
  std::vector<std::uint32_t> particles_;
  std::vector<double> masses_;
  std::vector<double> shapes_;  // of clusters
  std::vector<double> cells_;   // of blocks of cells that are filled in part
  std::vector<double> mixes_;   // of these, where there are several materials
  std::vector<double> fibres_;  // directions in all cells, where some have one
  bool mix_stiffens_ = false;   // one of them
  double half_edge_ = 1.0;
  // Where the forces on a particle lie, in the order of its clusters' lanes.
  std::vector<std::uint32_t> force_offsets_;
  std::vector<std::uint32_t> force_places_;
  std::vector<double> inverse_masses_;
  // What the reference computes.
  ClusterSet others_;
  std::vector<Index> other_clusters_;
  RestShape other_shape_;
  std::vector<ElasticRest> other_elastic_;
};

}  // namespace meshless
