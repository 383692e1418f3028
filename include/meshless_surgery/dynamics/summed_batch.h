// Shape matching on a regular lattice whose clusters are all neighbourhoods of one width: summed neighbourhoods (Rivers
// and James 2007, sec. 4).
#pragma once

#include "meshless_surgery/dynamics/match_batch.h"

namespace meshless {

/// As OverlapBatch, for clusters that are neighbourhoods of particles in a lattice. The 12 numbers of every particle
/// are summed along x, y and z in turn, and so are the maps: the cost along x and y does not depend on the width, along
/// z it is one row of 12 numbers a layer. Sums are made by additions alone, never by taking off what leaves a running
/// sum: nothing drifts, and a result is rounded less often than a sum over pairs. Particles come in any order, sites
/// may be empty.
class SummedBatch {
 public:
  /// True for what the batch can hold: particles on an even lattice along the axes of the rest shape, at most 7 of 8
  /// sites empty; cluster i of all particles at most some number of sites (the same for all) from particle i along each
  /// axis; a particle's weight the same in all its clusters; none has flowed (no plastic shapes). Takes a look at
  /// every pair: asked once, not every step.
  static bool holds(const MatchInput& body);

  /// Only for what holds() is true for.
  explicit SummedBatch(const MatchInput& body);
  ~SummedBatch();
  SummedBatch(SummedBatch&&) noexcept;
  SummedBatch& operator=(SummedBatch&&) noexcept;

  /// rotations: one a cluster.
  void setState(const Points& positions, const Points& velocities, const std::vector<Quat>& rotations);
  void getState(Points& positions, Points& velocities, std::vector<Quat>& rotations) const;

  void step(const BatchStep& step, MatchCounters& counters, const ForEach& for_each = oneAfterAnother);

  /// As OverlapBatch::match().
  void match(const Points& y, MatchMode mode, double beta, std::vector<ClusterPose>& poses, Points& goals,
             MatchCounters& counters, const ForEach& for_each = oneAfterAnother);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace meshless
