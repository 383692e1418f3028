#include "laws.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/body/preserve.h"
#include "meshless_surgery/dynamics/match_batch.h"
#include "dynamics/rotation.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"

namespace meshless::bench {
namespace {

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_()) / 4294967295.0);
  }
  Vec3 vector(double size) {
    const double x = uniform(-size, size), y = uniform(-size, size), z = uniform(-size, size);
    return Vec3(x, y, z);
  }
  Quat rotation() { return Quat(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).normalized(); }

 private:
  std::mt19937 engine_;
};

// A cloud of random points of about unit size whose clusters are random and overlap.
BodyModel randomCloud(Random& random, const Kind& kind, double scale, Index particles, const Material& material) {
  BodyModel model;
  for (Index i = 0; i < particles; ++i) {
    model.rest.push_back(random.vector(0.5 * scale));
    model.masses.push_back(random.uniform(0.5, 2.0));
    model.mass += model.masses.back();
  }
  model.fixed.assign(particles, false);
  ClusterSet& set = model.clusters;
  set.offsets = {0};
  std::vector<double> total(particles, 0.0);
  for (int c = 0; c < kind.clusters; ++c) {
    for (Index i = 0; i < particles; ++i)
      if (kind.clusters == 1 || i % static_cast<Index>(kind.clusters) == static_cast<Index>(c) ||
          random.uniform(0.0, 1.0) < 0.3) {
        set.members.push_back(i);
        total[i] += 1.0;
      }
    set.offsets.push_back(static_cast<Index>(set.members.size()));
  }
  for (Index i : set.members) set.weights.push_back(1.0 / total[i]);
  makeTissue(model, material);
  return model;
}

Material materialOf(const Kind& kind) {
  Material material;
  material.damping = 0.0;
  material.mode = kind.mode;
  material.beta = 0.5;
  if (kind.elastic) {
    material.youngs_modulus = 5000.0;
    material.poissons_ratio = 0.4;
  }
  return material;
}

// Frames of h with the substeps that the material needs; watch(time) after each frame.
template <class Watch>
void simulate(const BodyModel& model, const Material& material, const Vec3& gravity, double h, double seconds,
              BodyState& state, const Watch& watch) {
  StepScratch scratch;
  MatchCounters counters;
  const auto steps = static_cast<int>(std::lround(seconds / h));
  for (int step = 1; step <= steps; ++step) {
    const int substeps = static_cast<int>(substepsNeeded(model, state, h));
    for (int k = 0; k < substeps; ++k) {
      matchAndMove(model, material, gravity, h / substeps, state, scratch, counters);
      // What clamps have taken back is no velocity.
      if (model.clamp) velocitiesFromPositions(h / substeps, state, scratch);
    }
    watch(step * h);
  }
}

// --- patch

Vec9 basis(const Vec3& q) {
  Vec9 b;
  b << q.x(), q.y(), q.z(), q.x() * q.x(), q.y() * q.y(), q.z() * q.z(), q.x() * q.y(), q.y() * q.z(), q.z() * q.x();
  return b;
}

Points fieldOf(Random& random, const Points& rest, MatchMode mode, double scale, double far) {
  Mat3 map = Mat3::Identity();
  for (int k = 0; k < 9; ++k) map(k) += random.uniform(-0.3, 0.3);
  map /= std::cbrt(map.determinant());
  if (mode == MatchMode::kRigid) map.setIdentity();
  Mat39 field = Mat39::Zero();
  field.leftCols<3>() = map;
  if (mode == MatchMode::kQuadratic)
    for (int k = 9; k < 27; ++k) field(k) = random.uniform(-0.1, 0.1);
  const Mat3 turn = random.rotation().toRotationMatrix();
  const Vec3 shift = far * random.vector(1.0).normalized() + random.vector(scale);
  Points y;
  for (const Vec3& q : rest) y.push_back(shift + scale * (turn * (field * basis(q / scale))));
  return y;
}

double largestDistance(const Points& a, const Points& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, (a[i] - b[i]).norm());
  return largest;
}

// One step of a body at rest with gain 1 moves it to its goals.
Points steppedToGoals(const BodyModel& model, const Material& material, const Points& y) {
  BatchStep step = batchStep(material, 1.0 / 60.0);
  step.gain = 1.0;
  step.gravity.setZero();
  MatchCounters counters;
  BodyBatch batch({matchInput(model)}, material.mode == MatchMode::kQuadratic);
  Points x = y, v(y.size(), Vec3::Zero());
  Quat rotation = Quat::Identity();
  batch.step({{x.data(), v.data(), &rotation}}, step, counters);
  return x;
}

// --- spin

struct RigidBody {
  Vec3 inertia;  // [kg m^2] principal
  Vec3 spin;     // [rad/s] in the body
  Quat rotation = Quat::Identity();
};

// Euler's equations by Runge-Kutta.
void integrate(RigidBody& body, double seconds) {
  constexpr double kStep = 2e-5;
  const auto steps = static_cast<int>(std::ceil(seconds / kStep));
  const double h = seconds / steps;
  const auto turning = [&](const Vec3& w) -> Vec3 {
    return Vec3((body.inertia.y() - body.inertia.z()) * w.y() * w.z() / body.inertia.x(),
                (body.inertia.z() - body.inertia.x()) * w.z() * w.x() / body.inertia.y(),
                (body.inertia.x() - body.inertia.y()) * w.x() * w.y() / body.inertia.z());
  };
  const auto rate = [](const Quat& q, const Vec3& w) {
    Eigen::Vector4d r = (q * Quat(0.0, w.x(), w.y(), w.z())).coeffs();
    return Eigen::Vector4d(0.5 * r);
  };
  const auto moved = [](const Quat& q, const Eigen::Vector4d& by) { return Quat(Eigen::Vector4d(q.coeffs() + by)); };
  for (int k = 0; k < steps; ++k) {
    const Vec3 w = body.spin;
    const Quat q = body.rotation;
    const Vec3 a1 = turning(w), a2 = turning(w + 0.5 * h * a1), a3 = turning(w + 0.5 * h * a2),
               a4 = turning(w + h * a3);
    const Eigen::Vector4d r1 = rate(q, w), r2 = rate(moved(q, 0.5 * h * r1), w + 0.5 * h * a1);
    const Eigen::Vector4d r3 = rate(moved(q, 0.5 * h * r2), w + 0.5 * h * a2), r4 = rate(moved(q, h * r3), w + h * a3);
    body.spin += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    body.rotation = moved(q, h / 6.0 * (r1 + 2.0 * r2 + 2.0 * r3 + r4)).normalized();
  }
}

struct Spinning {
  PreparedBody body;
  RigidBody exact;
};

Spinning spinning(const Kind& kind, bool tumbling) {
  BodyDef def;
  def.name = "block";
  def.mesh = boxMesh(Vec3(0.12, 0.08, 0.04), 6, 4, 2);
  def.material = materialOf(kind);
  def.material.alpha = 1.0;
  def.material.beta = 0.0;
  if (kind.elastic) {
    def.spacing = 0.02;
    def.material.youngs_modulus = 2e6;
  }
  def.clusters.kind = kind.elastic         ? ClusterOptions::Kind::kCells
                      : kind.clusters == 1 ? ClusterOptions::Kind::kOne
                                           : ClusterOptions::Kind::kCount;
  def.clusters.count = kind.clusters;
  Spinning s{*prepareBody(std::move(def)), {}};
  s.exact.spin = tumbling ? Vec3(0.5, 6.0, 0.3) : Vec3(0.0, 0.0, 6.0);
  const BodyModel& model = *s.body.model;
  s.exact.inertia.setZero();
  for (std::size_t i = 0; i < model.rest.size(); ++i) {
    const Vec3 q = s.body.state.positions[i], squared = q.cwiseProduct(q);
    s.exact.inertia +=
        model.masses[i] * Vec3(squared.y() + squared.z(), squared.z() + squared.x(), squared.x() + squared.y());
    s.body.state.velocities[i] = s.exact.spin.cross(q);
  }
  return s;
}

Vec3 angularMomentum(const BodyModel& model, const BodyState& state) {
  Vec3 centre = Vec3::Zero(), momentum = Vec3::Zero();
  for (std::size_t i = 0; i < model.rest.size(); ++i) centre += model.masses[i] / model.mass * state.positions[i];
  for (std::size_t i = 0; i < model.rest.size(); ++i)
    momentum += model.masses[i] * (state.positions[i] - centre).cross(state.velocities[i]);
  return momentum;
}

Quat rotationOf(const BodyModel& model, const BodyState& state) {
  Mat3 moment = Mat3::Zero();
  for (std::size_t i = 0; i < model.rest.size(); ++i)
    moment += model.masses[i] * state.positions[i] * model.rest[i].transpose();
  return nearestRotation(moment, Quat::Identity()).rotation;
}

// --- the same at any step

BodyDef block(const Kind& kind, bool held) {
  BodyDef def;
  def.name = "block";
  def.mesh = boxMesh(Vec3(0.2, 0.1, 0.1), 8, 4, 4);
  def.material = materialOf(kind);
  if (kind.elastic) {
    def.material.youngs_modulus = 2000.0;
    def.material.poissons_ratio = 0.3;
    def.spacing = 0.025;
  } else {
    def.material.alpha = 0.00995;  // omega h = 0.1 at 1/60 s
    def.clusters.kind = kind.clusters == 1 ? ClusterOptions::Kind::kOne : ClusterOptions::Kind::kCount;
    def.clusters.count = kind.clusters;
  }
  if (held) {
    Box box;
    box.extend(Vec3(-0.2, -0.1, -0.1));
    box.extend(Vec3(-0.09, 0.1, 0.1));
    def.fixed.push_back(box);
  }
  return def;
}

}  // namespace

bool runsInFloat(const Kind& kind) { return !kind.elastic && kind.clusters == 1; }

std::vector<Kind> kinds() {
  return {{"rigid/one", false, MatchMode::kRigid, 1},         {"rigid/many", false, MatchMode::kRigid, 9},
          {"linear/one", false, MatchMode::kLinear, 1},       {"linear/many", false, MatchMode::kLinear, 9},
          {"quadratic/one", false, MatchMode::kQuadratic, 1}, {"quadratic/many", false, MatchMode::kQuadratic, 9},
          {"elastic/many", true, MatchMode::kLinear, 9}};
}

double patchError(const Kind& kind, bool in_float, double scale, double far) {
  double largest = 0.0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    Random random(seed);
    Material material = materialOf(kind);
    material.beta = 1.0;
    const BodyModel model = randomCloud(random, kind, scale, 96, material);
    const Points y = fieldOf(random, model.rest, kind.mode, scale, far);
    const double beta = in_float ? 0.95 : 1.0;
    std::vector<ClusterPose> poses(model.clusters.size());
    Points goals;
    MatchCounters counters;
    matchShapes(matchInput(model), y, kind.mode, beta, poses, goals, counters);
    Points expected = y;  // the field, and in float the share of the rigid goal that is always there
    if (in_float) {
      Points rigid;
      matchShapes(matchInput(model), y, MatchMode::kRigid, 0.0, poses, rigid, counters);
      for (std::size_t i = 0; i < y.size(); ++i) expected[i] = beta * y[i] + (1.0 - beta) * rigid[i];
      goals = steppedToGoals(model, material, y);
    }
    largest = std::max(largest, largestDistance(goals, expected) / scale);
  }
  return largest;
}

Drift momentumDrift(const Kind& kind, bool in_float, int steps) {
  Random random(5);
  const Material material = materialOf(kind);
  const BodyModel model = randomCloud(random, kind, 0.2, 96, material);
  BodyState state;
  state.positions = model.rest;
  state.poses.resize(model.clusters.size());
  const Vec3 drift(1.0, -2.0, 0.5), spin(3.0, -5.0, 2.0);
  for (const Vec3& q : model.rest) state.velocities.push_back(drift + spin.cross(q) + random.vector(0.1));
  const auto linear = [&] {
    Vec3 sum = Vec3::Zero();
    for (std::size_t i = 0; i < model.rest.size(); ++i) sum += model.masses[i] * state.velocities[i];
    return sum;
  };
  const auto energy = [&] {
    double sum = 0.0;
    for (std::size_t i = 0; i < model.rest.size(); ++i)
      sum += 0.5 * model.masses[i] * state.velocities[i].squaredNorm();
    return sum;
  };
  const Vec3 linear_before = linear(), angular_before = angularMomentum(model, state);
  const double energy_before = energy();
  double most = energy_before;
  if (!in_float) {
    const double h = kind.elastic ? 0.9 / model.highest_frequency : 1.0 / 120.0;
    StepScratch scratch;
    MatchCounters counters;
    for (int step = 0; step < steps; ++step) {
      matchAndMove(model, material, Vec3::Zero(), h, state, scratch, counters);
      most = std::max(most, energy());
    }
  } else {
    BatchStep step = batchStep(material, 1.0 / 120.0);
    step.gravity.setZero();
    MatchCounters counters;
    BodyBatch batch({matchInput(model)}, kind.mode == MatchMode::kQuadratic);
    state.poses[0].rotation = Quat::Identity();
    const BatchBody body{state.positions.data(), state.velocities.data(), &state.poses[0].rotation};
    for (int k = 0; k < steps; ++k) batch.step({body}, step, counters);
    most = std::max(most, energy());
  }
  Drift result;
  result.linear = (linear() - linear_before).norm() / linear_before.norm() / steps;
  result.angular = (angularMomentum(model, state) - angular_before).norm() / angular_before.norm() / steps;
  result.energy = most / energy_before - 1.0;
  return result;
}

double spinError(const Kind& kind, bool tumbling, double h, double seconds) {
  Spinning s = spinning(kind, tumbling);
  simulate(*s.body.model, s.body.def.material, Vec3::Zero(), h, seconds, s.body.state, [](double) {});
  integrate(s.exact, seconds);
  return rotationOf(*s.body.model, s.body.state).angularDistance(s.exact.rotation);
}

double spinLoss(const Kind& kind, double h, double seconds) {
  Spinning s = spinning(kind, false);
  const Vec3 before = angularMomentum(*s.body.model, s.body.state);
  simulate(*s.body.model, s.body.def.material, Vec3::Zero(), h, seconds, s.body.state, [](double) {});
  return (angularMomentum(*s.body.model, s.body.state) - before).norm() / before.norm();
}

double fittedOrder(const std::vector<double>& steps, const std::vector<double>& errors) {
  double x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const double a = std::log(steps[k]), b = std::log(errors[k]);
    x += a, y += b, xx += a * a, xy += a * b;
  }
  const auto n = static_cast<double>(steps.size());
  return (n * xy - x * y) / (n * xx - x * x);
}

Ringing ringing(const Kind& kind, double rate, double damping) {
  BodyDef def = block(kind, false);
  def.material.damping = damping;
  PreparedBody body = *prepareBody(std::move(def));
  const BodyModel& model = *body.model;
  for (Vec3& p : body.state.positions) p.x() *= 1.04;
  double before = 0.0, time_before = 0.0, area = 0.0;
  std::vector<double> crossings, areas;
  simulate(model, body.def.material, Vec3::Zero(), 1.0 / rate, kind.elastic ? 1.0 : 8.0, body.state, [&](double t) {
    double signal = 0.0;
    for (std::size_t i = 0; i < model.rest.size(); ++i)
      signal += model.masses[i] * model.rest[i].x() * (body.state.positions[i].x() - model.rest[i].x());
    if (before * signal < 0.0) {
      const double at = time_before + (t - time_before) * before / (before - signal);
      area += 0.5 * before * (at - time_before);
      crossings.push_back(at);
      areas.push_back(std::abs(area));
      area = 0.5 * signal * (t - at);
    } else {
      area += 0.5 * (before + signal) * (t - time_before);
    }
    before = signal;
    time_before = t;
  });
  Ringing result;
  result.half_waves = static_cast<int>(crossings.size());
  if (crossings.size() < 3) return result;
  // The first half wave is not whole.
  const std::size_t last = std::min<std::size_t>(crossings.size() - 1, 7);
  result.frequency = 0.5 * static_cast<double>(last) / (crossings[last] - crossings[0]);
  result.decay = std::log(areas[1] / areas[last]) / (crossings[last] - crossings[1]);
  return result;
}

double sag(const Kind& kind, double rate) {
  BodyDef def = block(kind, true);
  def.material.damping = 2.0;
  PreparedBody body = *prepareBody(std::move(def));
  const double end = 0.0999;
  simulate(*body.model, body.def.material, Vec3(0.0, 0.0, kind.elastic ? -2.0 : -0.2), 1.0 / rate,
           kind.elastic ? 8.0 : 20.0, body.state, [](double) {});
  double lowest = 0.0;
  for (std::size_t i = 0; i < body.model->rest.size(); ++i)
    if (body.model->rest[i].x() > end) lowest = std::min(lowest, body.state.positions[i].z() - body.model->rest[i].z());
  return -lowest;
}

Squeezed squeeze(const Material& material) {
  BodyDef def;
  def.name = "cube";
  def.mesh = boxMesh(Vec3(0.1, 0.1, 0.1), 6, 6, 6);
  def.spacing = 0.02;
  def.material = material;
  const PreparedBody body = *prepareBody(std::move(def));
  const BodyModel& m = *body.model;
  BodyState state = body.state;
  StepScratch scratch;
  MatchCounters counted;
  PreserveCounters counters;
  const double h = 1.0 / 240.0;
  for (int step = 0; step < 720; ++step) {
    const double half = 0.05 * (1.0 - 0.4 * std::min(1.0, step / 120.0));
    matchAndMove(m, material, Vec3::Zero(), h, state, scratch, counted);
    scratch.touched.clear();
    for (Index i = 0; i < m.rest.size(); ++i) {
      double& z = state.positions[i].z();
      if (std::abs(z) <= half) continue;
      const double side = z > 0 ? 1.0 : -1.0;
      z = side * half;
      scratch.touched.push_back({i, Vec3(0, 0, -side)});
    }
    preserve(m, material, state, scratch, counters);
    velocitiesFromPositions(h, state, scratch);
  }
  updateSurface(m, state);
  Squeezed result{signedVolume(state.surface, m.surface.triangles) / m.rest_volume,
                  surfaceArea(state.surface, m.surface.triangles) / m.rest_area, 0.0, counters.gradients};
  for (const Vec3& v : state.velocities) result.speed = std::max(result.speed, v.norm());
  return result;
}

}  // namespace meshless::bench
