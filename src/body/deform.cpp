#include "meshless_surgery/body/deform.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <Eigen/Eigenvalues>

#include "meshless_surgery/body/cavities.h"
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

constexpr std::size_t kChunk = 512;  // particles; sums are made of those of chunks, on however many threads

// work(from, to) for each chunk.
template <class Work>
void inChunks(const ForEach& for_each, std::size_t count, const Work& work) {
  const std::size_t chunks = (count + kChunk - 1) / kChunk;
  const auto chunk = [&](std::size_t n) { work(n * kChunk, std::min(count, (n + 1) * kChunk)); };
  if (chunks < 2 || !for_each) {
    for (std::size_t n = 0; n < chunks; ++n) chunk(n);
  } else {
    runEach(for_each, chunks, chunk);
  }
}

// The sum over all chunks, in their order.
template <std::size_t kTerms, class Work>
std::array<double, kTerms> sumOverChunks(const ForEach& for_each, std::size_t count, const Work& work) {
  static thread_local std::vector<std::array<double, kTerms>> parts;
  std::vector<std::array<double, kTerms>>& mine = parts;  // of the thread that calls
  mine.resize((count + kChunk - 1) / kChunk);
  inChunks(for_each, count, [&](std::size_t from, std::size_t to) { mine[from / kChunk] = work(from, to); });
  std::array<double, kTerms> sum{};
  for (const auto& part : mine)
    for (std::size_t k = 0; k < kTerms; ++k) sum[k] += part[k];
  return sum;
}

// A body as a whole: how it moves, and how hard it is to turn about its centre. Axis by axis: as one matrix, of a body
// drawn out to a line, the rounding of the axis that turns easily would be a torque about the others.
class Whole {
 public:
  Whole() = default;  // of a body that is held: it has no motion of its own
  Whole(const BodyModel& model, const Points& positions, const Points& velocities, const ForEach& for_each) {
    // From the first particle, so that little cancels; numbers of their own instead of matrices: four times as fast.
    const Vec3 origin = positions[0], drift = velocities[0];
    const auto sums = sumOverChunks<15>(for_each, positions.size(), [&](std::size_t from, std::size_t to) {
      double x = 0.0, y = 0.0, z = 0.0, xx = 0.0, yy = 0.0, zz = 0.0, xy = 0.0, xz = 0.0, yz = 0.0;
      double vx = 0.0, vy = 0.0, vz = 0.0, lx = 0.0, ly = 0.0, lz = 0.0;
      for (std::size_t i = from; i < to; ++i) {
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
      return std::array<double, 15>{x, y, z, xx, yy, zz, xy, xz, yz, vx, vy, vz, lx, ly, lz};
    });
    const auto [x, y, z, xx, yy, zz, xy, xz, yz, vx, vy, vz, lx, ly, lz] = sums;
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

Vec3 torqueOf(const BodyModel& model, const Points& positions, const Vec3& centre, const Points& pull,
              const ForEach& for_each) {
  const auto sums = sumOverChunks<3>(for_each, positions.size(), [&](std::size_t from, std::size_t to) {
    double x = 0.0, y = 0.0, z = 0.0;
    for (std::size_t i = from; i < to; ++i) {
      const double rx = positions[i].x() - centre.x(), ry = positions[i].y() - centre.y();
      const double rz = positions[i].z() - centre.z();
      const double fx = model.masses[i] * pull[i].x(), fy = model.masses[i] * pull[i].y();
      const double fz = model.masses[i] * pull[i].z();
      x += ry * fz - rz * fy, y += rz * fx - rx * fz, z += rx * fy - ry * fx;
    }
    return std::array<double, 3>{x, y, z};
  });
  return Vec3(sums[0], sums[1], sums[2]);
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
  return Whole(model, positions, velocities, nullptr).rigid;
}

Vec3 spinWith(const BodyModel& model, const Points& positions, const Vec3& momentum) {
  return Whole(model, positions, positions, nullptr).spinFor(momentum);
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

double clampRate(const BodyModel& model) { return kMargin * model.highest_frequency / kMostGain; }

double viscosityTime(const BodyModel& model, const BodyState& state, double h) {
  const double longest = std::max(h, longestSubstep(model, state));
  return std::isfinite(longest) ? kLag * longest / std::sqrt(state.stiffened) : h;
}

namespace {

// What the stages of a substep share.
struct Substep {
  const BodyModel& model;
  const Material& material;
  Vec3 gravity;
  double h;  // [s]
  BodyState& state;
  StepScratch& scratch;
  MatchCounters& counters;
  const ForEach& for_each;
  double factor = 1.0;     // stiffnessFactor()
  double stiffened = 1.0;  // of the stiffness, in this substep
  Whole whole{};           // at its start
  RigidMotion rigid{};     // as damping leaves it

  Vec3 weight() const {
    return (model.isHeld() ? factor : 1.0) * gravity;
  }                                               // it moves what is held but by deforming it
  Points& pull() const { return scratch.goals; }  // [m/s^2] of all that the body does to itself
};

void becomeStiffer(Substep& s) {
  s.stiffened = s.state.stiffened;
  s.state.stiffened = std::min(1.0, s.stiffened * std::exp(kStiffening * s.h));
}

// Before the pull: after it, it would weaken the material. A body that is held has no rigid motion of its own. One that
// lies on something kneads its tissue where it rolls or rocks: about that place.
void damp(Substep& s) {
  Points &x = s.state.positions, &v = s.state.velocities;
  // What vibrates is given at most half of that share of its energy by becoming stiffer.
  const double damped = std::exp(-s.h * (s.material.damping + (s.stiffened < 1.0 ? 2.0 * kStiffening : 0.0)));
  // Where what deforms is slowed otherwise than before, its energy stays, and so do velocities over the pace.
  const double pace = std::sqrt(s.factor), kept = s.state.pace > 0.0 ? damped * pace / s.state.pace : damped;
  s.state.pace = pace;
  if (!s.model.any_fixed) s.whole = Whole(s.model, x, v, s.for_each);
  const RigidMotion before = s.rigid = s.whole.rigid;
  const double spin_kept = s.scratch.load > 0.0 ? damped : 1.0;
  if (s.scratch.load > 0.0) s.rigid.velocity -= (1.0 - spin_kept) * rollingOf(before, s.scratch.load_at);
  s.rigid.spin *= spin_kept;
  const Mat3 undamped = turning(s.rigid.spin - kept * before.spin);
  const Vec3 drift = s.rigid.velocity - kept * before.velocity;
  inChunks(s.for_each, x.size(), [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) v[i] = kept * v[i] + drift + undamped * (x[i] - before.centre);
  });
}

// By the stress where velocities will have it in the lag: a viscosity.
void stress(Substep& s) {
  const BodyModel& model = s.model;
  if (!model.elastic_batch) {
    s.pull().assign(s.state.positions.size(), Vec3::Zero());
    s.state.relaxed.clear();
    return;
  }
  const double lag = viscosityTime(model, s.state, s.h);
  Points& y = s.scratch.predicted;
  y.resize(s.state.positions.size());
  inChunks(s.for_each, y.size(), [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) y[i] = s.state.positions[i] + lag * s.state.velocities[i];
  });
  ElasticParameters parameters = ownElasticity(model, s.material, s.factor * s.stiffened);
  const MatchInput input = matchInput(model, s.state);
  std::vector<ClusterPose>& poses = model.cells ? s.state.cells : s.state.poses;
  std::vector<RelaxedStrain>* relaxed = nullptr;
  if (model.cells && s.material.relaxes()) {
    parameters.relaxation = relaxationStep(s.material.relaxation, s.h);
    s.state.relaxed.resize(model.cells->cells.size());
    relaxed = &s.state.relaxed;
  } else {
    s.state.relaxed.clear();
  }
  if (model.cells && s.material.plastic()) {
    s.state.stretch = elasticAccelerations(*model.cells, parameters, y, poses, s.pull(), s.counters, s.state.swelling,
                                           &s.state.plastic_cells, relaxed);
  } else if (!model.cells && (s.material.plastic() || !s.state.plastic.empty())) {
    s.state.stretch =
        elasticAccelerations(input, model.elastic, parameters, y, poses, s.pull(), s.counters, s.state.swelling);
  } else {
    if (!s.scratch.under_way) {
      model.elastic_batch->setRotations(poses, s.scratch.elastic);
      model.elastic_batch->setRelaxed(s.state.relaxed, parameters.relaxation.branches, s.scratch.elastic);
      model.elastic_batch->setUnstressed(s.state.plastic_cells, s.scratch.elastic);
    }
    s.state.stretch = model.elastic_batch->accelerate(input, parameters, y, s.scratch.elastic, s.pull(), s.counters,
                                                      s.state.swelling, widestInstructionSet(), s.for_each);
    if (s.scratch.last) {
      model.elastic_batch->getRotations(s.scratch.elastic, poses);
      model.elastic_batch->getRelaxed(s.scratch.elastic, s.state.relaxed);
    }
  }
  s.scratch.under_way = !s.scratch.last;
}

// To the goals of clusters, from where all else would have the particles. How far that is ahead of them must not change
// how a body spins.
void match(Substep& s) {
  if (s.material.elastic()) return;
  const double h = s.h;
  GoalPull goal = goalPull(s.material.alpha, h * std::sqrt(s.factor));
  goal.gain *= s.stiffened;
  if (!(goal.gain > 0.0)) return;
  const Points &x = s.state.positions, &v = s.state.velocities;
  const Mat3 turn = turning(s.rigid.spin);
  const Vec3 weight = s.weight(), falling = s.rigid.velocity + h * weight;
  Points &y = s.scratch.predicted, &goals = s.scratch.matched;
  y.resize(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Vec3 faster = v[i] + h * (s.pull()[i] + weight);
    y[i] = x[i] + h * faster;
    y[i] += goal.lead * (s.model.any_fixed ? faster : Vec3(faster - falling - turn * (x[i] - s.rigid.centre)));
  }
  matchShapes(matchInput(s.model, s.state), y, s.material.mode, actingBeta(s.material.beta, h), s.state.poses, goals,
              s.counters, s.state.swelling, s.material.plastic());
  for (std::size_t i = 0; i < x.size(); ++i) s.pull()[i] += goal.gain / (h * h) * (goals[i] - y[i]);
}

void flowPlastically(Substep& s) {
  if (!s.material.plastic()) return;
  const Plasticity& plasticity = s.material.plasticity;
  if (s.model.cells) s.counters.plastic_flows += flow(plasticity, s.h, nullptr, s.state.cells, s.state.plastic_cells);
  if (!s.model.cells || !s.material.elastic())
    s.counters.plastic_flows += flow(plasticity, s.h, &s.model.shape, s.state.poses, s.state.plastic);
}

// The pull is free of torque where it was computed, but it acts where particles are: what it turns the body by is taken
// back.
void move(Substep& s) {
  Points &x = s.state.positions, &v = s.state.velocities;
  Mat3 leaked = Mat3::Zero();
  const Vec3 centre = s.rigid.centre, weight = s.weight();
  if (!s.model.any_fixed) leaked = s.h * turning(s.whole.spinFor(torqueOf(s.model, x, centre, s.pull(), s.for_each)));
  s.scratch.previous.resize(x.size());
  inChunks(s.for_each, x.size(), [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) {
      const Vec3 at = x[i], faster = v[i] + s.h * (s.pull()[i] + weight) - leaked * (at - centre);
      s.scratch.previous[i] = at;
      v[i] = faster;
      x[i] = at + s.h * faster;
    }
  });
}

// The springs of entries that were moved, times how far.
void moveClampPoints(const BodyModel& model, const BodyState& state, Points& moved) {
  moved.clear();
  if (state.held.empty()) return;
  moved.assign(state.positions.size(), Vec3::Zero());
  const CellLattice& lattice = *model.lattice;
  const double density = model.cell_mass / std::pow(lattice.spacing, 3.0);
  for (const ClampPoint& point : model.clamp_points) {
    if (point.region >= state.held.size()) continue;
    const LatticeCell& cell = lattice.cells[point.cell];
    const Vec3 put = state.placed * lattice.restPlace(cell, point.at);
    const Vec3 way = springMass(lattice, point, density) * (state.held[point.region](put) - put);
    for (int k = 0; k < 8; ++k) moved[cell.corners[k]] += trilinearWeight(k, point.at) * way;
  }
}

void hold(Substep& s) {
  Points& x = s.state.positions;
  for (HeldMotion& motion : s.state.held) motion.advance(s.h);
  if (s.model.any_fixed)
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (!s.model.fixed[i]) continue;
      s.state.velocities[i].setZero();
      const std::uint32_t by = s.model.holderOf(static_cast<Index>(i));
      x[i] = by < s.state.held.size() ? s.state.held[by](s.state.placed * s.model.rest[i]) : s.scratch.previous[i];
    }
  if (!s.model.clamp) return;
  moveClampPoints(s.model, s.state, s.scratch.moved);
  // As stiff as ever, whatever the body's stretch and substep: springs that stiffen and soften in turns give energy.
  const double part = s.h * clampRate(s.model);
  s.scratch.clamp.hold(s.model.clamp, part > 0.0 ? part * part : 1.0, s.model.rest, s.state.placed, s.scratch.moved, x);
}

}  // namespace

void matchAndMove(const BodyModel& model, const Material& material, const Vec3& gravity, double h, BodyState& state,
                  StepScratch& scratch, MatchCounters& counters, const ForEach& for_each) {
  Substep substep{model, material, gravity, h, state, scratch, counters, for_each};
  substep.factor = scratch.factor = stiffnessFactor(model, state, h);
  becomeStiffer(substep);
  damp(substep);
  stress(substep);
  match(substep);
  flowPlastically(substep);
  move(substep);
  if (!state.cavities.empty()) pressCavities(model, substep.factor, h, state, scratch);
  hold(substep);
}

void velocitiesFromPositions(double h, BodyState& state, const StepScratch& scratch, const ForEach& for_each) {
  const double rate = 1.0 / h;
  inChunks(for_each, state.positions.size(), [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from; i < to; ++i) state.velocities[i] = rate * (state.positions[i] - scratch.previous[i]);
  });
}

}  // namespace meshless
