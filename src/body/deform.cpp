#include "meshless_surgery/body/deform.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Eigenvalues>

#include "meshless_surgery/body/cavities.h"
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

// A body as a whole: how it moves, and how hard it is to turn about its centre. Axis by axis: as one matrix, of a body
// drawn out to a line, the rounding of the axis that turns easily would be a torque about the others.
class Whole {
 public:
  Whole() = default;  // of a body that is held: it has no motion of its own
  Whole(const BodyModel& model, const Points& positions, const Points& velocities) {
    // From the first particle, so that little cancels; numbers of their own instead of matrices: four times as fast.
    const Vec3 origin = positions[0], drift = velocities[0];
    double x = 0.0, y = 0.0, z = 0.0, xx = 0.0, yy = 0.0, zz = 0.0, xy = 0.0, xz = 0.0, yz = 0.0;
    double vx = 0.0, vy = 0.0, vz = 0.0, lx = 0.0, ly = 0.0, lz = 0.0;
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const double m = model.masses[i];
      const double rx = positions[i].x() - origin.x(), ry = positions[i].y() - origin.y();
      const double rz = positions[i].z() - origin.z();
      const double px = m * (velocities[i].x() - drift.x()), py = m * (velocities[i].y() - drift.y());
      const double pz = m * (velocities[i].z() - drift.z());
      const double mx = m * rx, my = m * ry, mz = m * rz;
      x += mx, y += my, z += mz;
      xx += mx * rx, yy += my * ry, zz += mz * rz, xy += mx * ry, xz += mx * rz, yz += my * rz;
      vx += px, vy += py, vz += pz;
      lx += ry * pz - rz * py, ly += rz * px - rx * pz, lz += rx * py - ry * px;
    }
    const Vec3 centre = Vec3(x, y, z) / model.mass, velocity = Vec3(vx, vy, vz) / model.mass;
    rigid.centre = origin + centre;
    rigid.velocity = drift + velocity;
    rigid.angular_momentum = Vec3(lx, ly, lz) - model.mass * centre.cross(velocity);
    Mat3 moment;
    moment << xx, xy, xz, xy, yy, yz, xz, yz, zz;
    moment -= model.mass * centre * centre.transpose();
    const double scale = 2.0 * moment.trace();
    if (!(scale > 0.0)) return;
    const Eigen::SelfAdjointEigenSolver<Mat3> solver((0.5 * scale * Mat3::Identity() - moment) / scale);
    axes_ = solver.eigenvectors();
    for (int k = 0; k < 3; ++k)
      if (solver.eigenvalues()[k] > 1e-12) inverse_[k] = 1.0 / (solver.eigenvalues()[k] * scale);
    rigid.spin = spinFor(rigid.angular_momentum);
  }

  // The spin that carries the angular momentum, the least one where the points are collinear or fewer.
  Vec3 spinFor(const Vec3& momentum) const {
    Vec3 spin = Vec3::Zero();
    for (int k = 0; k < 3; ++k) spin += axes_.col(k) * (axes_.col(k).dot(momentum) * inverse_[k]);
    return spin;
  }

  RigidMotion rigid;

 private:
  Mat3 axes_ = Mat3::Identity();
  Vec3 inverse_ = Vec3::Zero();  // [1/(kg m^2)], 0 where nothing turns
};

Vec3 torqueOf(const BodyModel& model, const Points& positions, const Vec3& centre, const Points& pull) {
  double x = 0.0, y = 0.0, z = 0.0;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const double rx = positions[i].x() - centre.x(), ry = positions[i].y() - centre.y();
    const double rz = positions[i].z() - centre.z();
    const double fx = model.masses[i] * pull[i].x(), fy = model.masses[i] * pull[i].y();
    const double fz = model.masses[i] * pull[i].z();
    x += ry * fz - rz * fy, y += rz * fx - rx * fz, z += rx * fy - ry * fx;
  }
  return Vec3(x, y, z);
}

// r times it is spin cross r.
Mat3 turning(const Vec3& spin) {
  Mat3 by;
  by << 0.0, -spin.z(), spin.y(), spin.z(), 0.0, -spin.x(), -spin.y(), spin.x(), 0.0;
  return by;
}

// [m/s] of the velocity, what is rolling about a place. No more than there is: who slides as well does not gain from
// it.
Vec3 rollingOf(const RigidMotion& rigid, const Vec3& about) {
  const Vec3 rolling = rigid.spin.cross(rigid.centre - about);
  const double squared = rolling.squaredNorm();
  return squared > 0.0 ? Vec3(std::clamp(rigid.velocity.dot(rolling) / squared, 0.0, 1.0) * rolling) : rolling;
}

}  // namespace

RigidMotion rigidMotionOf(const BodyModel& model, const Points& positions, const Points& velocities) {
  return Whole(model, positions, velocities).rigid;
}

Vec3 spinWith(const BodyModel& model, const Points& positions, const Vec3& momentum) {
  return Whole(model, positions, positions).spinFor(momentum);
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

void matchAndMove(const BodyModel& model, const Material& material, const Vec3& gravity, double h, BodyState& state,
                  StepScratch& scratch, MatchCounters& counters, const ForEach& for_each) {
  Points& x = state.positions;
  Points& v = state.velocities;
  const std::size_t n = x.size();
  const double factor = stiffnessFactor(model, state, h);
  const double stiffened = state.stiffened;
  const double ahead = material.elastic() ? viscosityTime(model, state, h) : viscosityTime(material.alpha, h);
  // What vibrates is given at most half of that share of its energy by becoming stiffer.
  const double damped = std::exp(-h * (material.damping + (stiffened < 1.0 ? 2.0 * kStiffening : 0.0)));
  state.stiffened = std::min(1.0, stiffened * std::exp(kStiffening * h));
  double kept = damped;
  if (material.elastic()) {
    // Where what deforms is slowed otherwise than before, its energy stays, and so do velocities over the pace.
    const double pace = std::sqrt(factor);
    if (state.pace > 0.0) kept *= pace / state.pace;
    state.pace = pace;
  }

  // Damping comes before the pull: after it, it would weaken the material. A body that is held has no rigid motion of
  // its own. One that lies on something kneads its tissue where it rolls or rocks: about that place.
  const Whole whole = model.any_fixed ? Whole() : Whole(model, x, v);
  RigidMotion rigid = whole.rigid;
  const double spin_kept = scratch.load > 0.0 ? damped : 1.0;
  const Mat3 turn = turning(rigid.spin);
  if (scratch.load > 0.0) rigid.velocity -= (1.0 - spin_kept) * rollingOf(rigid, scratch.load_at);
  const Mat3 undamped = (spin_kept - kept) * turn;
  const Vec3 drift = rigid.velocity - kept * whole.rigid.velocity;
  Points& y = scratch.predicted;
  y.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3 kept_v = kept * v[i] + drift + undamped * (x[i] - rigid.centre);
    v[i] = kept_v;
    y[i] = x[i] + ahead * kept_v;
  }
  // How far ahead what deforms is decides on the viscosity, and must not change how a body spins.
  if (!material.elastic())
    for (std::size_t i = 0; i < n; ++i)
      y[i] += (h - ahead) * (rigid.velocity + spin_kept * (turn * (x[i] - rigid.centre)));

  const MatchInput input = matchInput(model, state);
  Points& pull = scratch.goals;  // [m/s^2]
  const double gain = material.elastic() ? 0.0 : stiffened * stiffnessGain(material.alpha, h);
  if (material.elastic()) {
    const ElasticParameters parameters =
        elasticParameters(factor * stiffened * material.youngs_modulus, material.poissons_ratio, material.density);
    if (material.plastic() || !state.plastic.empty()) {
      state.stretch = model.cells ? elasticAccelerations(*model.cells, parameters, y, state.poses, pull, counters,
                                                         state.swelling, &state.plastic)
                                  : elasticAccelerations(input, model.elastic, parameters, y, state.poses, pull,
                                                         counters, state.swelling);
    } else {
      if (!scratch.under_way) model.elastic_batch->setRotations(state.poses, scratch.elastic);
      state.stretch = model.elastic_batch->accelerate(input, parameters, y, scratch.elastic, pull, counters,
                                                      state.swelling, widestInstructionSet(), for_each);
      if (scratch.last) model.elastic_batch->getRotations(scratch.elastic, state.poses);
    }
  } else if (gain > 0.0) {
    matchShapes(input, y, material.mode, actingBeta(material.beta, h), state.poses, pull, counters, state.swelling,
                material.plastic());
    for (std::size_t i = 0; i < n; ++i) pull[i] = gain / (h * h) * (pull[i] - y[i]);
  } else {
    pull.assign(n, Vec3::Zero());
  }
  const double share = easedShare(state.eased_for);
  const auto ease = [&] {
    for (std::size_t i = 0; i < state.eased.size(); ++i) pull[i] += share * state.eased[i];
  };
  if (!state.eased_whole) ease();
  // The pull is free of torque about y, but it acts on x: what it turns the body by is taken back.
  Mat3 leaked = Mat3::Zero();
  if (!model.any_fixed) leaked = h * turning(whole.spinFor(torqueOf(model, x, rigid.centre, pull)));
  if (state.eased_whole) ease();
  if (!state.eased.empty()) {
    state.eased_for += h;
    if (!(easedShare(state.eased_for) > 0.0)) state.eased.clear();
  }
  if (material.plastic() && (material.elastic() || gain > 0.0))
    counters.plastic_flows += flow(input, material.plasticity, h, state.poses, state.plastic);

  // Of a body that is held gravity has nothing to move but what deforms.
  const Vec3 weight = (model.isHeld() ? factor : 1.0) * gravity;
  scratch.under_way = !scratch.last;
  scratch.previous.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Vec3 at = x[i], faster = v[i] + h * (pull[i] + weight) - leaked * (at - rigid.centre);
    scratch.previous[i] = at;
    v[i] = faster;
    x[i] = at + h * faster;
  }
  if (!state.cavities.empty()) pressCavities(model, factor, h, state, scratch);
  if (model.any_fixed)
    for (std::size_t i = 0; i < n; ++i) {
      if (!model.fixed[i]) continue;
      v[i].setZero();
      x[i] = scratch.previous[i];
    }
  if (model.clamp) {
    // As stiff as ever, whatever the body's stretch and substep: springs that stiffen and soften in turns give energy.
    const double part = h * kMargin * model.highest_frequency / kMostGain;
    scratch.clamp.hold(model.clamp, part > 0.0 ? part * part : 1.0, model.rest, state.placed, x);
  }
}

void velocitiesFromPositions(double h, BodyState& state, const StepScratch& scratch) {
  const double rate = 1.0 / h;
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    state.velocities[i] = rate * (state.positions[i] - scratch.previous[i]);
}

}  // namespace meshless
