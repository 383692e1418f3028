// One substep of a body, in the stages that the world runs for all bodies in turn.
#pragma once

#include "meshless_surgery/body/body.h"

namespace meshless {

/// A particle of what presses on something, and which way is out of that.
struct TouchedParticle {
  Index particle = 0;
  Vec3 normal = Vec3::UnitZ();
};

/// Arrays that a body's substep needs and nothing outlives; kept between steps so that stepping allocates nothing.
struct StepScratch {
  Points previous;  // [m] positions at the start of the substep
  Points predicted;
  Points goals, matched;
  ClampStep clamp;
  Points moved;  // [kg m] see ClampStep::hold
  ElasticBatchState elastic;
  Points cavity, cavity_pull;            // of its vertices, and of the particles
  std::vector<TouchedParticle> touched;  // of a body that preserves its size
  /// Of a row of substeps in which nobody else reads or writes poses: whether this is the last one, and then they are
  /// written. Until then rotations stay in `elastic`.
  bool last = true;
  bool under_way = false;
  double factor = 1.0;          // stiffnessFactor() of the substep
  double load = 0.0;            // [N] that presses a body which lies on what does not move
  Vec3 load_at = Vec3::Zero();  // [m] the middle of it
};

/// Reads positions and velocities; writes positions, velocities, poses and scratch.previous. The body accelerates by
/// its cells' stress at y = x + v viscosityTime, whatever h is: a viscosity that calms the shortest waves and does not
/// change with the step. Where the material is one of appearance, particles are then drawn to the goals of their
/// clusters, from where all else would have them. The angular momentum that evaluating elsewhere would leak is restored
/// (not where particles are fixed), and damping of the motion that deforms and gravity are added. Fixed particles stay.
/// beta acts up to 0.95: without any rigid share energy could grow.
/// Where h is more than longestSubstep, what deforms is slowed: it has 1 / stiffnessFactor of the inertia, and all that
/// acts on a body moves it as a whole as ever. So every step is stable, and equilibria are the material's (Olovsson et
/// al. 2005, "Selective mass scaling for explicit finite element analyses"). What else acts on particles has to do
/// likewise: it moves them by scratch.factor of what their masses say, and a body that is free as a whole by the rest.
/// Another factor than the one of the substep would change where it rests with how it is stretched, and that feeds a
/// swing.
/// for_each: spreads cells and particles over threads; what comes out does not depend on it.
void matchAndMove(const BodyModel& model, const Material& material, const Vec3& gravity, double h, BodyState& state,
                  StepScratch& scratch, MatchCounters& counters, const ForEach& for_each = nullptr);

/// [s] in which a body, as it is stretched now, deforms as fast as its cells do; infinity where there are none.
double longestSubstep(const BodyModel& model, const BodyState& state);
/// How many of them, at least one, take that time [s].
double substepsNeeded(const BodyModel& model, const BodyState& state, double time);
/// 0..1: mass over inertia of what deforms at substeps of h [s].
double stiffnessFactor(const BodyModel& model, const BodyState& state, double h);
/// [s] by which the stress of cells is ahead in substeps of h [s].
double viscosityTime(const BodyModel& model, const BodyState& state, double h);

/// [1/s] A spring of a clamp that weighs m pulls by m times its square: a step of one over it is the longest at rest.
double clampRate(const BodyModel& model);

/// v = (x - x_old) / h, after springs and contacts have moved positions.
void velocitiesFromPositions(double h, BodyState& state, const StepScratch& scratch,
                             const ForEach& for_each = nullptr);

/// [m/s] angular velocity times lever of a body that turns as its particles do on the whole; 0 where it has no extent.
struct RigidMotion {
  Vec3 centre = Vec3::Zero();
  Vec3 velocity = Vec3::Zero();
  Vec3 spin = Vec3::Zero();              // [rad/s]
  Vec3 angular_momentum = Vec3::Zero();  // [kg m^2/s] about the centre
};
RigidMotion rigidMotionOf(const BodyModel& model, const Points& positions, const Points& velocities);
/// [rad/s] with which the particles, turning together about their centre, have an angular momentum [kg m^2/s].
Vec3 spinWith(const BodyModel& model, const Points& positions, const Vec3& momentum);

}  // namespace meshless
