// Complete substeps of shape matching in float, vectorised for the widest instructions that the machine has, of many
// bodies of one cluster each. The same laws as matchAndMove() (body/deform.h), which stays the reference; for free
// bodies with an appearance material that does not flow.
#pragma once

#include <limits>
#include <memory>

#include "meshless_surgery/base/for_each.h"
#include "meshless_surgery/dynamics/rotation_batch.h"
#include "meshless_surgery/dynamics/shape_matching.h"

namespace meshless {

/// What all bodies of a batch share in a substep. h, ahead and gain belong together: batchStep() sets them.
struct BatchStep {
  double h = 1.0 / 60.0;                                    // [s] > 0
  double ahead = std::numeric_limits<double>::quiet_NaN();  // [s] >= 0, h and the lead of goalPull(); to be set
  MatchMode mode = MatchMode::kLinear;
  double gain = 0.9;     // 0..1, share of the way to the goal in h; see goalPull()
  double beta = 0.2;     // 0..1, see actingBeta()
  double damping = 0.0;  // [1/s]
  Vec3 gravity = Vec3(0.0, 0.0, -9.81);
  InstructionSet set = widestInstructionSet();
};
BatchStep batchStep(const Material& material, double h);

/// Where a body of a batch has its state, particle by particle.
struct BatchBody {
  Vec3* positions = nullptr;   // [m]
  Vec3* velocities = nullptr;  // [m/s]
  Quat* rotation = nullptr;
};

/// Bodies of equally many particles, each in one cluster with all of its particles. Masses and rest shapes may differ.
/// Positions are kept relative to an origin that follows the body, so that float does not lose them far from the
/// world's. A body's result depends neither on its place nor on its neighbours, be they NaN.
class BodyBatch {
 public:
  /// True for what the batch can hold: one cluster, of all particles in order and with their full weight, that has not
  /// flowed (no plastic shape).
  static bool holds(const MatchInput& body);

  /// quadratic: a step may ask for the quadratic mode; the shapes have had addQuadraticRest().
  BodyBatch(const std::vector<MatchInput>& bodies, bool quadratic);
  ~BodyBatch();
  BodyBatch(BodyBatch&&) noexcept;
  BodyBatch& operator=(BodyBatch&&) noexcept;

  std::size_t bytes() const;  // that it holds

  /// Another body's rest shape and masses in the place of this one's. Of as many particles, that it holds().
  void refit(std::size_t body, const MatchInput& in);

  /// Damps, predicts, matches, restores angular momentum, adds gravity and moves: the first states.size() bodies, which
  /// may be fewer than all.
  void step(const std::vector<BatchBody>& states, const BatchStep& step, MatchCounters& counters,
            const ForEach& for_each = oneAfterAnother);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace meshless
