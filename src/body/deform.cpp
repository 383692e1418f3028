#include "meshless_surgery/body/deform.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Eigenvalues>

#include "meshless_surgery/body/ease.h"
#include "meshless_surgery/dynamics/plastic.h"

namespace meshless {
namespace {

// [1/s] Tissue that was made stiffer becomes so by a factor of e in a tenth of a second, at most: what gives way under
// its weight by up to g / rate^2, a decimetre, rises without a leap.
constexpr double kStiffening = 10.0;

// Substep times highest frequency, a, and the lag of the viscosity in units of the substep, both where the substep is
// the longest. A mode is stable while a^2 (1 + 2 lag) < 4; of that, 1.4 and a quarter take 2.9. Without the margin: the
// frequency was found from below, and the stretch is that of the last substep. The shortest waves are halved within two
// substeps; a longer lag costs substeps, a shorter one leaves them ringing.
constexpr double kMostGain = 1.4;
constexpr double kMargin = 1.1;
constexpr double kLag = 0.25;

// How hard a body is to turn about a point. Axis by axis: as one matrix, of a body drawn out to a line, the rounding of
// the axis that turns easily would be a torque about the others.
class Inertia {
 public:
  Inertia(const BodyModel& model, const Points& positions, const Vec3& centre) {
    // Sums of their own instead of a matrix: four times as fast.
    double xx = 0.0, yy = 0.0, zz = 0.0, xy = 0.0, xz = 0.0, yz = 0.0;
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const Vec3 r = positions[i] - centre;
      const double x = model.masses[i] * r.x(), y = model.masses[i] * r.y(), z = model.masses[i] * r.z();
      xx += x * r.x();
      yy += y * r.y();
      zz += z * r.z();
      xy += x * r.y();
      xz += x * r.z();
      yz += y * r.z();
    }
    const double scale = 2.0 * (xx + yy + zz);
    if (!(scale > 0.0)) return;
    Mat3 inertia;
    inertia << yy + zz, -xy, -xz, -xy, xx + zz, -yz, -xz, -yz, xx + yy;
    const Eigen::SelfAdjointEigenSolver<Mat3> solver(inertia / scale);
    axes_ = solver.eigenvectors();
    for (int k = 0; k < 3; ++k)
      if (solver.eigenvalues()[k] > 1e-12) inverse_[k] = 1.0 / (solver.eigenvalues()[k] * scale);
  }

  // The spin that carries the angular momentum, the least one where the points are collinear or fewer.
  Vec3 spinFor(const Vec3& momentum) const {
    Vec3 spin = Vec3::Zero();
    for (int k = 0; k < 3; ++k) spin += axes_.col(k) * (axes_.col(k).dot(momentum) * inverse_[k]);
    return spin;
  }

 private:
  Mat3 axes_ = Mat3::Identity();
  Vec3 inverse_ = Vec3::Zero();  // [1/(kg m^2)], 0 where nothing turns
};

struct MassMoments {
  Vec3 centre;  // [m]
  Inertia inertia;
};

MassMoments momentsOf(const BodyModel& model, const Points& positions) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < positions.size(); ++i) sum += model.masses[i] * (positions[i] - positions[0]);
  const Vec3 centre = positions[0] + sum / model.mass;
  return {centre, Inertia(model, positions, centre)};
}

RigidMotion rigidMotionOf(const BodyModel& model, const MassMoments& moments, const Points& positions,
                          const Points& velocities) {
  RigidMotion motion;
  motion.centre = moments.centre;
  for (std::size_t i = 0; i < positions.size(); ++i) motion.velocity += model.masses[i] * velocities[i];
  motion.velocity /= model.mass;
  Vec3 momentum = Vec3::Zero();
  for (std::size_t i = 0; i < positions.size(); ++i)
    momentum += model.masses[i] * (positions[i] - motion.centre).cross(velocities[i] - motion.velocity);
  motion.angular_momentum = momentum;
  motion.spin = moments.inertia.spinFor(momentum);
  return motion;
}

}  // namespace

RigidMotion rigidMotionOf(const BodyModel& model, const Points& positions, const Points& velocities) {
  return rigidMotionOf(model, momentsOf(model, positions), positions, velocities);
}

Vec3 spinWith(const BodyModel& model, const Points& positions, const Vec3& centre, const Vec3& momentum) {
  return Inertia(model, positions, centre).spinFor(momentum);
}

double longestSubstep(const BodyModel& model, const BodyState& state) {
  return kMostGain / (kMargin * state.stretch * model.highest_frequency);
}

double substepsNeeded(const BodyModel& model, const BodyState& state, double time) {
  const double needed = std::ceil(time / longestSubstep(model, state));
  return needed < 1.0 ? 1.0 : needed;
}

double stiffnessFactor(const BodyModel& model, const BodyState& state, double h) {
  const double share = longestSubstep(model, state) / h;
  return share < 1.0 ? share * share : 1.0;
}

double viscosityTime(const BodyModel& model, const BodyState& state, double h) {
  const double longest = std::max(h, longestSubstep(model, state));
  return std::isfinite(longest) ? kLag * longest / std::sqrt(state.stiffened) : h;
}

namespace {

// Particle velocities after what the material does, by accelerations taken at y; x is where momentum is counted.
// `known`: moments of x, where they are known.
template <class Acceleration>
void accelerate(const BodyModel& model, double h, const Points& x, const std::optional<MassMoments>& known, Points& v,
                const Acceleration& at) {
  if (model.any_fixed) {
    for (std::size_t i = 0; i < v.size(); ++i) v[i] += h * at(i);
    return;
  }
  // The pull is free of torque about y, but it acts on x: the difference is given back as a spin of the body.
  Vec3 leaked = Vec3::Zero();
  const MassMoments moments = known ? *known : momentsOf(model, x);
  const Vec3 centre = moments.centre;
  for (std::size_t i = 0; i < v.size(); ++i) {
    const Vec3 dv = h * at(i);
    v[i] += dv;
    leaked += model.masses[i] * (x[i] - centre).cross(dv);
  }
  const Vec3 spin = moments.inertia.spinFor(leaked);
  for (std::size_t i = 0; i < v.size(); ++i) v[i] -= spin.cross(x[i] - centre);
}

// Damps what deforms and predicts: y = x + h v, but what deforms goes `ahead` instead of h. How long that takes decides
// on the viscosity, and must not change how a body spins. A body that is held has no rigid motion of its own, and one
// that lies on something no spin: rolling, tissue is kneaded. Damping
// comes before the pull: after it, it would weaken the material. quicker: where what deforms is slowed otherwise than
// before, its energy stays, and so do velocities over the pace. Returns the moments of x where it needed them.
std::optional<MassMoments> dampAndPredict(const BodyModel& model, double h, double ahead, double damping,
                                          double quicker, bool lies, const Points& x, Points& v, Points& y) {
  const double damped = std::exp(-damping * h), kept = quicker * damped;
  y.resize(x.size());
  if (model.any_fixed || (ahead == h && kept == 1.0)) {
    for (std::size_t i = 0; i < x.size(); ++i) {
      v[i] *= kept;
      y[i] = model.fixed[i] ? x[i] : Vec3(x[i] + ahead * v[i]);
    }
    return std::nullopt;
  }
  const MassMoments moments = momentsOf(model, x);
  const RigidMotion rigid = rigidMotionOf(model, moments, x, v);
  const double spin_kept = lies ? damped : 1.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Vec3 turning = rigid.spin.cross(x[i] - rigid.centre);
    const Vec3 deforming = kept * (v[i] - rigid.velocity - turning), together = rigid.velocity + spin_kept * turning;
    v[i] = together + deforming;
    y[i] = x[i] + h * together + ahead * deforming;
  }
  return moments;
}

}  // namespace

void matchAndMove(const BodyModel& model, const Material& material, const Vec3& gravity, double h, BodyState& state,
                  StepScratch& scratch, MatchCounters& counters) {
  Points& x = state.positions;
  Points& v = state.velocities;
  scratch.previous = x;
  const double factor = stiffnessFactor(model, state, h);
  const double stiffened = state.stiffened;
  const double ahead = material.elastic() ? viscosityTime(model, state, h) : viscosityTime(material.alpha, h);
  // What vibrates is given at most half of that share of its energy by becoming stiffer.
  const double damping = material.damping + (stiffened < 1.0 ? 2.0 * kStiffening : 0.0);
  state.stiffened = std::min(1.0, stiffened * std::exp(kStiffening * h));
  double quicker = 1.0;
  if (material.elastic()) {
    const double pace = std::sqrt(factor);
    if (state.pace > 0.0) quicker = pace / state.pace;
    state.pace = pace;
  }
  const std::optional<MassMoments> moments =
      dampAndPredict(model, h, ahead, damping, quicker, scratch.lies, x, v, scratch.predicted);
  const Points& y = scratch.predicted;
  const MatchInput input = matchInput(model, state);
  bool matched = true;
  // What has no force and no torque goes through accelerate(), which keeps it so.
  const bool eased = !state.eased.empty() && !state.eased_whole;
  const double share = easedShare(state.eased_for);

  if (material.elastic()) {
    const ElasticParameters parameters =
        elasticParameters(factor * stiffened * material.youngs_modulus, material.poissons_ratio, material.density);
    if (material.plastic() || !state.plastic.empty()) {
      state.stretch = model.cells ? elasticAccelerations(*model.cells, parameters, y, state.poses, scratch.goals,
                                                         counters, state.swelling, &state.plastic)
                                  : elasticAccelerations(input, model.elastic, parameters, y, state.poses,
                                                         scratch.goals, counters, state.swelling);
    } else {
      model.elastic_batch->setRotations(state.poses, scratch.elastic);
      state.stretch = model.elastic_batch->accelerate(input, parameters, y, scratch.elastic, scratch.goals, counters,
                                                      state.swelling);
      model.elastic_batch->getRotations(scratch.elastic, state.poses);
    }
    const Points& accelerations = scratch.goals;
    if (!eased)
      accelerate(model, h, x, moments, v, [&](std::size_t i) -> const Vec3& { return accelerations[i]; });
    else
      accelerate(model, h, x, moments, v,
                 [&](std::size_t i) -> Vec3 { return accelerations[i] + share * state.eased[i]; });
  } else if (const double gain = stiffened * stiffnessGain(material.alpha, h); gain > 0.0) {
    matchShapes(input, y, material.mode, actingBeta(material.beta, h), state.poses, scratch.goals, counters,
                state.swelling, material.plastic());
    const Points& goals = scratch.goals;
    const double pull = gain / (h * h);
    if (!eased)
      accelerate(model, h, x, moments, v, [&](std::size_t i) -> Vec3 { return pull * (goals[i] - y[i]); });
    else
      accelerate(model, h, x, moments, v,
                 [&](std::size_t i) -> Vec3 { return pull * (goals[i] - y[i]) + share * state.eased[i]; });
  } else {
    matched = false;
  }
  if (!state.eased.empty()) {
    if (state.eased_whole)
      for (std::size_t i = 0; i < v.size(); ++i) v[i] += h * share * state.eased[i];
    state.eased_for += h;
    if (!(easedShare(state.eased_for) > 0.0)) state.eased.clear();
  }
  if (material.plastic() && matched)
    counters.plastic_flows += flow(input, material.plasticity, h, state.poses, state.plastic);
  // Of a body that is held gravity has nothing to move but what deforms.
  const Vec3 pull = (model.isHeld() ? factor : 1.0) * gravity;
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (model.fixed[i]) {
      v[i].setZero();
    } else {
      v[i] += model.carried.empty() ? Vec3(h * pull) : Vec3(h * (1.0 - model.carried[i]) * pull);
      x[i] += h * v[i];
    }
  }
  if (model.clamp) {
    const double share = h / longestSubstep(model, state);
    scratch.clamp.hold(model.clamp, share > 0.0 ? share * share : 1.0, model.rest, state.placed, x);
  }
}

void velocitiesFromPositions(double h, BodyState& state, const StepScratch& scratch) {
  const double rate = 1.0 / h;
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    state.velocities[i] = rate * (state.positions[i] - scratch.previous[i]);
}

}  // namespace meshless
