// What the stress suite (test/stress) puts to the proof, and the laws that it holds each step to.
#pragma once

#include <cmath>
#include <cstdlib>

#include "meshless_surgery/dynamics/elastic.h"
#include "dynamics/rotation.h"
#include "support/bodies.h"
#include "support/random.h"

namespace meshless::stress {

/// MESHLESS_SURGERY_STRESS in percent: 100 is the short form. Below, only so much of each table is run and of the
/// random commands; above, more of what is random.
inline double share() {
  const char* text = std::getenv("MESHLESS_SURGERY_STRESS");
  const double percent = text ? std::strtod(text, nullptr) : 100.0;
  return percent > 0.0 ? percent / 100.0 : 1.0;
}

/// Which sample: the next takes the cases beside, so that all have had their turn after 1 / share() of them.
inline double seed() {
  const char* text = std::getenv("MESHLESS_SURGERY_SEED");
  return text ? std::strtod(text, nullptr) : 0.0;
}

/// The part of a table that share() asks for, spread over all of it.
template <class T>
std::vector<T> thinned(const std::vector<T>& all) {
  std::vector<T> some;
  const double shift = std::fmod(share() * seed(), 1.0);
  for (std::size_t i = 0; i < all.size(); ++i)
    if (std::floor(shift + share() * static_cast<double>(i + 1)) > std::floor(shift + share() * static_cast<double>(i)))
      some.push_back(all[i]);
  return some;
}

/// A name that gtest accepts.
inline std::string testName(const std::string& text) {
  std::string name;
  bool upper = true;
  for (char c : text) {
    if (!std::isalnum(static_cast<unsigned char>(c))) {
      upper = true;
      continue;
    }
    name += upper ? static_cast<char>(std::toupper(static_cast<unsigned char>(c))) : c;
    upper = false;
  }
  return name;
}

/// How a body is matched: mode, clusters, and whether alone in double or in a batch in float.
struct Kind {
  std::string name;
  MatchMode mode = MatchMode::kLinear;
  bool elastic = false;
  bool many_clusters = false;
  int bodies = 1;  // 32 and more alike are matched side by side in float
};

inline void PrintTo(const Kind& kind, std::ostream* out) { *out << kind.name; }

inline std::vector<Kind> allKinds() {
  std::vector<Kind> kinds;
  for (const MatchMode mode : {MatchMode::kRigid, MatchMode::kLinear, MatchMode::kQuadratic}) {
    const std::string name = toString(mode);
    kinds.push_back({name + " one cluster", mode, false, false, 1});
    kinds.push_back({name + " many clusters", mode, false, true, 1});
    kinds.push_back({name + " float batch", mode, false, false, 36});
  }
  kinds.push_back({"elastic one cluster", MatchMode::kLinear, true, false, 1});
  kinds.push_back({"elastic cells", MatchMode::kLinear, true, true, 1});
  return kinds;
}

inline Material materialOf(const Kind& kind) {
  Material material;
  material.mode = kind.mode;
  if (kind.elastic) {
    material.youngs_modulus = 5000.0;
    material.poissons_ratio = 0.4;
  }
  return material;
}

/// A block of 0.2 x 0.1 x 0.1 m, times `scale`; in a batch of fewer particles.
inline BodyDef blockOf(const Kind& kind, const std::string& name, const Vec3& at = Vec3::Zero(), double scale = 1.0) {
  BodyDef def;
  def.name = name;
  const bool coarse = kind.bodies > 1;
  def.mesh = boxMesh(scale * Vec3(0.2, 0.1, 0.1), coarse ? 4 : 8, coarse ? 2 : 4, coarse ? 2 : 4);
  def.spacing = scale * (coarse ? 0.05 : 0.025);
  def.pose.translation = at;
  def.material = materialOf(kind);
  def.clusters.kind = ClusterOptions::Kind::kOne;
  if (kind.many_clusters) {
    def.clusters.kind = kind.elastic ? ClusterOptions::Kind::kCells : ClusterOptions::Kind::kGrid;
    def.clusters.grid = {4, 2, 2};
  }
  return def;
}

/// The same body in another state, which set(positions, velocities, rest) makes. Rotations stay those of rest: what
/// comes then is not what they were prepared for.
using SetState = std::function<void(Points& positions, Points& velocities)>;
inline std::shared_ptr<const PreparedBody> inState(PreparedBody body, const SetState& set) {
  set(body.state.positions, body.state.velocities);
  updateSurface(*body.model, body.state);
  return std::make_shared<const PreparedBody>(std::move(body));
}

/// Energy of deformation [J]. Over that of cells, for appearance materials that of springs from particles to the goals
/// of their clusters: exact for rigid goals, and what is near it for fitted ones.
inline double deformationEnergy(const BodyModel& model, const Material& material, double h, const Points& x) {
  const MatchInput in = matchInput(model);
  const ElasticParameters own = ownElasticity(model, material);
  double sum = 0.0;
  if (model.cells)
    sum = elasticEnergy(*model.cells, own, x, std::vector<ClusterPose>(model.cells->cells.size()));
  else if (material.elastic())
    sum = elasticEnergy(in, model.elastic, own, x, std::vector<ClusterPose>(model.clusters.size()));
  if (material.elastic()) return sum;
  const double stiffness = goalPull(material.alpha, h).gain / (h * h);
  for (Index c = 0; c < in.clusters.size(); ++c) {
    const ClusterRest& rest = in.shape.clusters[c];
    const Index begin = in.clusters.offsets[c], end = in.clusters.offsets[c + 1];
    Vec3 centre = Vec3::Zero();
    for (Index k = begin; k < end; ++k)
      centre += in.masses[in.clusters.members[k]] * in.clusters.weights[k] * x[in.clusters.members[k]] / rest.mass;
    Mat3 a = Mat3::Zero();
    for (Index k = begin; k < end; ++k) {
      const Index i = in.clusters.members[k];
      a += in.masses[i] * in.clusters.weights[k] * (x[i] - centre) * (in.rest[i] - rest.centre).transpose();
    }
    const Mat3 rotation = nearestRotationExact(a, Quat::Identity()).rotation.toRotationMatrix();
    for (Index k = begin; k < end; ++k) {
      const Index i = in.clusters.members[k];
      sum += 0.5 * stiffness * in.masses[i] * in.clusters.weights[k] *
             (x[i] - centre - rotation * (in.rest[i] - rest.centre)).squaredNorm();
    }
  }
  return sum;
}

/// How far the farthest particle is from the rest shape that was moved to fit best, over the rest shape's diagonal.
inline double distanceFromRest(const BodyModel& model, const Points& x) {
  Vec3 centre = Vec3::Zero(), rest_centre = Vec3::Zero();
  Box bounds;
  for (std::size_t i = 0; i < x.size(); ++i) {
    centre += model.masses[i] / model.mass * x[i];
    rest_centre += model.masses[i] / model.mass * model.rest[i];
    bounds.extend(model.rest[i]);
  }
  Mat3 a = Mat3::Zero();
  for (std::size_t i = 0; i < x.size(); ++i)
    a += model.masses[i] * (x[i] - centre) * (model.rest[i] - rest_centre).transpose();
  const Quat turn = nearestRotationExact(a, Quat::Identity()).rotation;
  double farthest = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i)
    farthest = std::max(farthest, (x[i] - centre - turn * (model.rest[i] - rest_centre)).norm());
  return farthest / bounds.diagonal();
}

/// How far the farthest particle is from where one of its clusters would have it [m], moved to fit best.
inline double clusterError(const BodyModel& model, const Points& x) {
  double farthest = 0.0;
  for (Index c = 0; c < model.clusters.size(); ++c) {
    const ClusterRest& rest = model.shape.clusters[c];
    const Index begin = model.clusters.offsets[c], end = model.clusters.offsets[c + 1];
    Vec3 centre = Vec3::Zero();
    Mat3 a = Mat3::Zero();
    for (Index k = begin; k < end; ++k) {
      const Index i = model.clusters.members[k];
      centre += model.masses[i] * model.clusters.weights[k] / rest.mass * x[i];
    }
    for (Index k = begin; k < end; ++k) {
      const Index i = model.clusters.members[k];
      a += model.masses[i] * model.clusters.weights[k] * (x[i] - centre) * (model.rest[i] - rest.centre).transpose();
    }
    const Quat turn = nearestRotationExact(a, Quat::Identity()).rotation;
    for (Index k = begin; k < end; ++k) {
      const Index i = model.clusters.members[k];
      farthest = std::max(farthest, (x[i] - centre - turn * (model.rest[i] - rest.centre)).norm());
    }
  }
  return farthest;
}

/// Largest distance of a particle from `from` [m].
inline double reachOf(const Points& x, const Vec3& from) {
  double most = 0.0;
  for (const Vec3& p : x) {
    const double d = (p - from).norm();
    if (!(d <= most)) most = d;  // NaN is taken over, and stays
  }
  return most;
}

/// Without input the energy of a step swings by a little around what falls: its maximum over a quarter of a second, or
/// 30 longer steps, must not be above that of any quarter before.
class EnergyLaw {
 public:
  /// swing: how much of a rise is what the measure misses, with goals that are no potential's.
  explicit EnergyLaw(double swing = 1.001, double step_rate = 120.0)
      : swing_(swing), window_steps_(std::max(30, static_cast<int>(0.25 * step_rate))) {}

  testing::AssertionResult holds(double energy) {
    if (!std::isfinite(energy)) return testing::AssertionFailure() << "the energy is " << energy;
    if (steps_ == 0) first_ = energy;
    window_ = std::max(window_, energy);
    if (++steps_ % window_steps_ == 0) {
      lowest_ = std::min(lowest_, window_);
      window_ = 0.0;
    }
    if (energy > swing_ * lowest_ + kRounding * first_ + kNothing)
      return testing::AssertionFailure() << "the energy rose to " << energy << " J from " << lowest_ << " J";
    return testing::AssertionSuccess();
  }
  double first() const { return first_; }

 private:
  static constexpr double kRounding = 1e-9;  // of the first: floats round relative to it
  static constexpr double kNothing = 1e-12;  // [J]
  double swing_;
  int window_steps_, steps_ = 0;
  double first_ = 0.0, window_ = 0.0, lowest_ = 1e300;
};

/// Two worlds that live through the same, on one thread and on two, and what both have to hold to.
class Twins {
 public:
  explicit Twins(WorldSettings settings) : one_(withThreads(settings, 1)), two_(withThreads(settings, 2)) {}

  World& world() { return one_; }

  /// As apply(), where a refusal is as good.
  void attempt(const Command& command) { (void)apply(command).ok(); }
  /// The reply of the first; both must give the same verdict.
  Result<Reply> apply(const Command& command) {
    Result<Reply> a = one_.apply(command);
    const Result<Reply> b = two_.apply(command);
    EXPECT_EQ(a.ok(), b.ok());
    return a;
  }
  void spawn(const std::shared_ptr<const PreparedBody>& body) {
    for (World* world : {&one_, &two_}) {
      const Result<SpawnReply> reply = world->addSceneBody(body);
      ASSERT_TRUE(reply.ok()) << reply.error().detail;
    }
  }

  void reset() {
    one_.reset();
    two_.reset();
  }

  /// A step of both; then all of the first is looked at: the same as the second to the bit, finite without
  /// having been mended, and no particle or vertex farther than `reach` [m] from `centre`.
  testing::AssertionResult step(const Vec3& centre, double reach) {
    one_.step();
    two_.step();
    const auto at = [this] { return "step " + std::to_string(one_.stepCount()) + ": "; };
    if (one_.stateHash() != two_.stateHash())
      return testing::AssertionFailure() << at() << "one thread and two do not give the same";
    seen_ = one_.snapshot({true, true, true, false});
    for (const BodySnapshot& body : seen_.bodies) {
      const double particles = reachOf(body.particles, centre), surface = reachOf(body.surface, centre);
      if (!std::isfinite(particles) || !std::isfinite(surface) || !std::isfinite(body.measures.kinetic_energy))
        return testing::AssertionFailure() << at() << body.name << " is not finite";
      if (!(particles <= reach))
        return testing::AssertionFailure() << at() << body.name << " reaches to " << particles << " m of " << reach;
      if (!(surface <= 3.0 * reach))
        return testing::AssertionFailure() << at() << body.name << "'s surface reaches to " << surface << " m";
    }
    for (const Pick& pick : seen_.picks)
      if (!pick.force.allFinite() || !pick.position.allFinite())
        return testing::AssertionFailure() << at() << "the force of pick " << pick.id << " is not finite";
    if (seen_.report.mended) return testing::AssertionFailure() << at() << "a body had to start anew from rest";
    if (!seen_.push.force.allFinite()) return testing::AssertionFailure() << at() << "the push force is not finite";
    return testing::AssertionSuccess();
  }

  const WorldSnapshot& seen() const { return seen_; }

 private:
  static WorldSettings withThreads(WorldSettings settings, int threads) {
    settings.threads = threads;
    return settings;
  }
  World one_, two_;
  WorldSnapshot seen_;
};

/// The same bodies in a new world, each without the motion that it has as a whole: what flies would fly on, and what
/// spins would stay drawn out.
inline Twins stoppedAsAWhole(Twins& twins, const WorldSettings& settings, double reach) {
  EXPECT_TRUE(twins.step(Vec3::Zero(), reach));
  const WorldSnapshot before = twins.seen();
  EXPECT_TRUE(twins.step(Vec3::Zero(), reach));
  Twins calm(settings);
  for (std::size_t b = 0; b < before.bodies.size(); ++b) {
    const BodySnapshot& now = twins.seen().bodies[b];
    PreparedBody body;
    body.def.name = now.name;
    body.def.material = now.material;
    body.model = now.model;
    body.state = restState(*body.model, Pose());
    body.state.positions = now.particles;
    for (std::size_t i = 0; i < now.particles.size(); ++i)
      body.state.velocities[i] = settings.step_rate * (now.particles[i] - before.bodies[b].particles[i]);
    const RigidMotion together = rigidMotionOf(*body.model, body.state.positions, body.state.velocities);
    for (std::size_t i = 0; i < now.particles.size(); ++i)
      body.state.velocities[i] -= together.velocity + together.spin.cross(now.particles[i] - together.centre);
    updateSurface(*body.model, body.state);
    calm.spawn(std::make_shared<const PreparedBody>(std::move(body)));
  }
  return calm;
}

}  // namespace meshless::stress
