#include "meshless_surgery/dynamics/match_batch.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <optional>

#include <gtest/gtest.h>

#include "meshless_surgery/body/deform.h"
#include "support/random.h"

namespace meshless {
namespace match_batch_test {

using test::Random;

constexpr MatchMode kModes[] = {MatchMode::kRigid, MatchMode::kLinear, MatchMode::kQuadratic};
constexpr double kSpacing = 0.02;  // [m]

std::vector<InstructionSet> sets() {
  std::vector<InstructionSet> all;
  for (InstructionSet set : {InstructionSet::kBaseline, InstructionSet::kAvx2, InstructionSet::kAvx512})
    if (instructionSetAvailable(set)) all.push_back(set);
  return all;
}

// A body as the world steps it, with the plain code.
struct Plain {
  BodyModel model;
  BodyState state;
  StepScratch scratch;
  MatchCounters counters;
  std::optional<double> ground;  // [m]

  MatchInput input() const { return matchInput(model); }

  void finish() {
    model.match_masses = model.masses;
    model.fixed.assign(model.rest.size(), false);
    for (double m : model.masses) model.mass += m;
    model.shape = makeRestShape(model.rest, model.masses, model.clusters);
    addQuadraticRest(model.rest, model.masses, model.clusters, model.shape);
    state.positions = model.rest;
    state.velocities.assign(model.rest.size(), Vec3::Zero());
    state.poses.resize(model.clusters.size());
  }

  void step(const Material& material, const BatchStep& s) {
    matchAndMove(model, material, s.gravity, s.h, state, scratch, counters);
    land(s.h);
  }
  // Out of the ground, as others change a state between steps.
  void land(double h) {
    if (ground)
      for (Vec3& x : state.positions) x.z() = std::max(x.z(), *ground);
    velocitiesFromPositions(h, state, scratch);
  }

  Vec3 centre() const { return rigidMotionOf(model, state.positions, state.velocities).centre; }
  Vec3 momentum() const {
    Vec3 p = Vec3::Zero();
    for (std::size_t i = 0; i < model.rest.size(); ++i) p += model.masses[i] * state.velocities[i];
    return p;
  }
  Vec3 angularMomentum() const {
    Vec3 l = Vec3::Zero();
    const Vec3 c = centre();
    for (std::size_t i = 0; i < model.rest.size(); ++i)
      l += model.masses[i] * (state.positions[i] - c).cross(state.velocities[i]);
    return l;
  }
  // [kg m^2/s] what the angular momentum is small against, should it be near zero
  double turning() const {
    double sum = 0.0;
    const Vec3 c = centre();
    for (std::size_t i = 0; i < model.rest.size(); ++i)
      sum += model.masses[i] * (state.positions[i] - c).norm() * state.velocities[i].norm();
    return sum;
  }
  double movement() const {
    double sum = 0.0;
    for (std::size_t i = 0; i < model.rest.size(); ++i) sum += model.masses[i] * state.velocities[i].norm();
    return sum;
  }
};

void addLattice(int nx, int ny, int nz, double spacing, double jitter, const Vec3& at, Random& random,
                BodyModel& model) {
  for (int z = 0; z < nz; ++z)
    for (int y = 0; y < ny; ++y)
      for (int x = 0; x < nx; ++x) {
        model.rest.push_back(at + spacing * (Vec3(x, y, z) + random.vector(jitter)));
        model.masses.push_back(random.uniform(0.5e-3, 1.5e-3));
      }
}

Plain makeBody(Random& random, int nx, int ny, int nz, double scale = 1.0, const Vec3& at = Vec3(0, 0, 0.05)) {
  Plain body;
  addLattice(nx, ny, nz, scale * kSpacing, 0.1, at, random, body.model);
  ClusterSet& set = body.model.clusters;
  set.offsets = {0, static_cast<Index>(body.model.rest.size())};
  for (Index i = 0; i < body.model.rest.size(); ++i) set.members.push_back(i);
  set.weights.assign(set.members.size(), 1.0);
  body.finish();
  return body;
}

// Turned, deformed and in motion.
void disturb(Plain& body, Random& random, double scale = 1.0, double strain = 0.1) {
  const Mat3 map = random.rotation().toRotationMatrix() * (Mat3::Identity() + random.matrix(strain));
  const Vec3 c = body.centre(), spin = random.vector(5.0), velocity = scale * random.vector(0.2);
  for (std::size_t i = 0; i < body.model.rest.size(); ++i) {
    const Vec3 r = body.state.positions[i] - c;
    body.state.positions[i] = c + map * r + scale * random.vector(0.1 * strain * kSpacing);
    body.state.velocities[i] = velocity + spin.cross(map * r) + scale * random.vector(0.02);
  }
}

Material appearance(MatchMode mode, double damping) {
  Material m;
  m.mode = mode;
  m.alpha = 0.6;
  m.beta = 0.5;
  m.damping = damping;
  return m;
}

std::vector<BatchBody> statesOf(std::vector<Plain>& of, std::size_t first, std::size_t count) {
  std::vector<BatchBody> states;
  for (std::size_t i = first; i < first + count; ++i)
    states.push_back({of[i].state.positions.data(), of[i].state.velocities.data(), &of[i].state.poses[0].rotation});
  return states;
}

/// Bodies of their own, side by side.
struct Lanes {
  std::vector<Plain> bodies;
  BodyBatch batch;

  void step(const BatchStep& step, MatchCounters& counters, const ForEach& for_each = oneAfterAnother) {
    batch.step(statesOf(bodies, 0, bodies.size()), step, counters, for_each);
  }
};

Lanes batchOf(const std::vector<Plain>& bodies) {
  std::vector<MatchInput> inputs;
  for (const Plain& b : bodies) inputs.push_back(b.input());
  return {bodies, BodyBatch(inputs, true)};
}

double largestDistance(const Points& a, const Points& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    if (!((a[i] - b[i]).norm() <= largest)) largest = (a[i] - b[i]).norm();
  return largest;
}

// A falling body's velocity is known to float of the velocity, and where it is after the fall to float of the fall.
constexpr double kOfFall = 1e-6;
double fallen(const BatchStep& step, int steps) { return 0.5 * step.gravity.norm() * std::pow(steps * step.h, 2.0); }

TEST(BatchStep, KnowsHowFarAheadTheMatchLooks) {
  for (double h : {1.0 / 30.0, 1.0 / 60.0, 1.0 / 500.0})
    EXPECT_EQ(batchStep(appearance(MatchMode::kLinear, 1.0), h).ahead, h + goalPull(0.6, h).lead);
  // Forgotten, it shows.
  EXPECT_TRUE(std::isnan(BatchStep().ahead));
}

TEST(BodyBatch, HoldsNothingThatHasFlowed) {
  Random random(1);
  const Plain body = makeBody(random, 3, 3, 3);
  std::vector<PlasticShape> flowed;
  MatchInput input = body.input();
  EXPECT_TRUE(BodyBatch::holds(input));
  input.plastic = &flowed;
  EXPECT_TRUE(BodyBatch::holds(input));
  flowed.resize(1);
  EXPECT_FALSE(BodyBatch::holds(input));
}

// Long and short steps, with much damping and without.
TEST(BodyBatch, FollowsTheReferenceAtAnyStep) {
  for (double rate : {30.0, 60.0, 240.0, 2000.0})
    for (double damping : {0.0, 1.0, 300.0})
      for (MatchMode mode : kModes) {
        Random random(37);
        std::vector<Plain> bodies;
        for (int i = 0; i < 20; ++i) {
          bodies.push_back(makeBody(random, 3, 3, 3));
          disturb(bodies.back(), random);
        }
        const Material material = appearance(mode, damping);
        const BatchStep step = batchStep(material, 1.0 / rate);
        Lanes batch = batchOf(bodies);
        MatchCounters counters;
        double far = 0.0, fast = 0.0;
        for (int n = 0; n < 20; ++n) {
          batch.step(step, counters);
          for (Plain& body : bodies) body.step(material, step);
        }
        for (std::size_t i = 0; i < bodies.size(); ++i) {
          const Plain& found = batch.bodies[i];
          far = std::max(far, largestDistance(found.state.positions, bodies[i].state.positions));
          fast = std::max(fast, largestDistance(found.state.velocities, bodies[i].state.velocities));
        }
        EXPECT_LE(far, 2e-6 * 2.0 * kSpacing + kOfFall * fallen(step, 20)) << toString(mode) << rate << " " << damping;
        EXPECT_LE(fast, 1e-5 + kOfFall * 20.0 * step.h * step.gravity.norm())
            << toString(mode) << rate << " " << damping;
      }
}

// However strong the damping, what is left is the motion of a rigid body with the momentum that was there.
template <class Step>
void expectRigidAfterDamping(const Plain& before, const Step& after_step) {
  BatchStep step = batchStep(appearance(MatchMode::kLinear, 1e6), 1.0 / 120.0);
  step.gain = 0.0;
  step.gravity.setZero();
  const Plain after = after_step(step);
  const RigidMotion rigid = rigidMotionOf(before.model, before.state.positions, before.state.velocities);
  double deforming = 0.0, most = 0.0;
  for (std::size_t i = 0; i < before.model.rest.size(); ++i) {
    const Vec3 together = rigid.velocity + rigid.spin.cross(before.state.positions[i] - rigid.centre);
    deforming = std::max(deforming, (before.state.velocities[i] - together).norm());
    most = std::max(most, (after.state.velocities[i] - together).norm());
  }
  EXPECT_GT(deforming, 1e-2);
  EXPECT_LE(most, 1e-6);
}
TEST(BodyBatch, DampingLeavesTheRigidMotion) {
  Random random(41);
  std::vector<Plain> bodies;
  for (int i = 0; i < 3; ++i) {
    bodies.push_back(makeBody(random, 3, 3, 3));
    disturb(bodies.back(), random);
  }
  for (std::size_t i = 0; i < bodies.size(); ++i)
    expectRigidAfterDamping(bodies[i], [&](const BatchStep& step) {
      Lanes batch = batchOf(bodies);
      MatchCounters counters;
      batch.step(step, counters);
      return batch.bodies[i];
    });
}

TEST(BodyBatch, StepsAsTheReferenceInFreeFlight) {
  for (InstructionSet set : sets())
    for (MatchMode mode : kModes)
      for (double scale : {1e-3, 1.0, 1e3}) {
        Random random(7);
        std::vector<Plain> bodies;
        for (int i = 0; i < 37; ++i) {
          bodies.push_back(makeBody(random, 3, 3, 3, scale, scale * Vec3(1e3, -10.0 * i, 5.0)));
          disturb(bodies.back(), random, scale);
        }
        const Material material = appearance(mode, 1.0);
        BatchStep step = batchStep(material, 1.0 / 120.0);
        step.gravity *= scale;
        step.set = set;
        Lanes batch = batchOf(bodies);
        MatchCounters counters;
        double first = 0.0, last = 0.0, fast = 0.0;
        for (int n = 0; n < 100; ++n) {
          batch.step(step, counters);
          for (std::size_t i = 0; i < bodies.size(); ++i) {
            bodies[i].step(material, step);
            if (n != 0 && n != 99) continue;
            const Plain& found = batch.bodies[i];
            double& largest = n == 0 ? first : last;
            largest = std::max(largest, largestDistance(found.state.positions, bodies[i].state.positions));
            if (n == 99) fast = std::max(fast, largestDistance(found.state.velocities, bodies[i].state.velocities));
          }
        }
        EXPECT_LE(first, 2e-7 * 2.0 * kSpacing * scale) << toString(mode);
        EXPECT_LE(last, 5e-6 * 2.0 * kSpacing * scale + kOfFall * fallen(step, 100)) << toString(mode) << scale;
        EXPECT_LE(fast, 2e-5 * scale) << toString(mode);
        EXPECT_EQ(counters.rotations, 3700u);
        EXPECT_EQ(counters.quadratic_moments, mode == MatchMode::kQuadratic ? 3700u : 0u);
        EXPECT_EQ(counters.linear_fits, mode == MatchMode::kRigid ? 0u : 3700u);
      }
}

TEST(BodyBatch, StaysWithTheReferenceOnTheGround) {
  for (InstructionSet set : sets())
    for (MatchMode mode : kModes) {
      Random random(11);
      std::vector<Plain> bodies;
      for (int i = 0; i < 20; ++i) {
        bodies.push_back(makeBody(random, 3, 3, 3));
        disturb(bodies.back(), random, 1.0, 0.02);
        bodies.back().ground = 0.0;
      }
      const Material material = appearance(mode, 1.0);
      BatchStep step = batchStep(material, 1.0 / 120.0);
      step.set = set;
      Lanes batch = batchOf(bodies);
      std::vector<Plain>& found = batch.bodies;
      MatchCounters counters;
      std::size_t lifted = 0;
      // A particle that touches one step sooner by rounding lets bodies part: each step goes from the same state.
      for (int n = 0; n < 100; ++n) {
        for (std::size_t i = 0; i < bodies.size(); ++i) {
          found[i].scratch.previous = found[i].state.positions;
          bodies[i].state = found[i].state;
          bodies[i].step(material, step);
        }
        batch.step(step, counters);
        double largest = 0.0;
        for (std::size_t i = 0; i < bodies.size(); ++i) {
          for (const Vec3& x : found[i].state.positions) lifted += x.z() < 0.0;
          found[i].land(step.h);
          largest = std::max(largest, largestDistance(found[i].state.positions, bodies[i].state.positions));
        }
        ASSERT_LE(largest, 1e-6 * 2.0 * kSpacing) << toString(mode) << " step " << n;
      }
      EXPECT_GT(lifted, 1000u);
    }
}

TEST(BodyBatch, KeepsMomentum) {
  for (MatchMode mode : kModes)
    for (double damping : {0.0, 20.0}) {
      Random random(3);
      std::vector<Plain> bodies;
      for (int i = 0; i < 16; ++i) {
        bodies.push_back(makeBody(random, 3, 3, 3));
        disturb(bodies.back(), random);
      }
      BatchStep step = batchStep(appearance(mode, damping), 1.0 / 120.0);
      step.gravity.setZero();
      Lanes batch = batchOf(bodies);
      MatchCounters counters;
      constexpr int kSteps = 1000;
      for (int n = 0; n < kSteps; ++n) batch.step(step, counters);
      for (std::size_t i = 0; i < bodies.size(); ++i) {
        const Plain& after = batch.bodies[i];
        // 6.5e-10 and 4.8e-10 by the worst of 96 bodies
        EXPECT_LE((after.momentum() - bodies[i].momentum()).norm(), 4e-9 * kSteps * bodies[i].movement());
        EXPECT_LE((after.angularMomentum() - bodies[i].angularMomentum()).norm(), 2e-9 * kSteps * bodies[i].turning());
      }
    }
}

TEST(BodyBatch, BodiesDoNotDependOnPlaceNeighboursOrOrder) {
  Random random(5);
  std::vector<Plain> bodies;
  for (int i = 0; i < 150; ++i) {
    bodies.push_back(makeBody(random, 3, 2, 3));
    disturb(bodies.back(), random);
  }
  for (InstructionSet set : sets())
    for (MatchMode mode : kModes) {
      BatchStep step = batchStep(appearance(mode, 1.0), 1.0 / 120.0);
      step.set = set;
      std::vector<Plain> spoiled = bodies;
      for (int i : {0, 17, 40}) spoiled[i].state.positions[3].x() = std::numeric_limits<double>::quiet_NaN();
      for (int i : {5, 70}) spoiled[i].state.velocities[3].x() = std::numeric_limits<double>::infinity();
      const std::vector<Plain> few(bodies.begin() + 130, bodies.begin() + 143);
      Lanes all = batchOf(bodies), with_nan = batchOf(spoiled), part = batchOf(few);
      MatchCounters counters;
      for (int n = 0; n < 50; ++n) {
        all.step(step, counters);
        with_nan.step(step, counters, [](std::size_t count, const std::function<void(std::size_t)>& work) {
          for (std::size_t i = count; i > 0; --i) work(i - 1);
        });
        part.step(step, counters);
      }
      for (std::size_t i = 0; i < bodies.size(); ++i) {
        if (i == 0 || i == 17 || i == 40 || i == 5 || i == 70) continue;
        const Plain &a = all.bodies[i], &b = with_nan.bodies[i];
        ASSERT_EQ(largestDistance(a.state.positions, b.state.positions), 0.0) << i;
        ASSERT_EQ(largestDistance(a.state.velocities, b.state.velocities), 0.0) << i;
        if (i < 130 || i >= 143) continue;
        ASSERT_EQ(largestDistance(a.state.positions, part.bodies[i - 130].state.positions), 0.0) << i;
      }
    }
}

// A few at a time in places that were made for others.
TEST(BodyBatch, BodiesMayTakeTheWrongPlaces) {
  Random random(6);
  std::vector<Plain> bodies;
  for (int i = 0; i < 40; ++i) {
    bodies.push_back(makeBody(random, 3, 2, 3));
    disturb(bodies.back(), random);
  }
  for (MatchMode mode : kModes) {
    const BatchStep step = batchStep(appearance(mode, 1.0), 1.0 / 120.0);
    std::vector<Plain> others = bodies;
    Lanes batch = batchOf(bodies);
    const std::vector<Plain>& own = batch.bodies;
    std::vector<MatchInput> narrow(20, bodies[39].input());
    BodyBatch places(narrow, true);
    MatchCounters all, some;
    for (int n = 0; n < 20; ++n) {
      batch.step(step, all);
      for (std::size_t first = 0; first < 40; first += 13) {
        const std::size_t count = std::min<std::size_t>(13, 40 - first);
        for (std::size_t i = 0; i < count; ++i) places.refit(i, bodies[first + i].input());
        places.step(statesOf(others, first, count), step, some);
      }
    }
    for (std::size_t i = 0; i < 40; ++i) {
      ASSERT_EQ(largestDistance(own[i].state.positions, others[i].state.positions), 0.0) << i;
      ASSERT_EQ(largestDistance(own[i].state.velocities, others[i].state.velocities), 0.0) << i;
    }
    EXPECT_EQ(all.clusters, some.clusters);
    EXPECT_EQ(all.rotations, some.rotations);
  }
}

// Lines, sheets and crumbs: what has no linear or quadratic fit.
TEST(BodyBatch, FallsBackWhereTheRankIsMissing) {
  const std::array<int, 3> sizes[] = {{12, 1, 1}, {4, 3, 1}, {2, 2, 3}, {1, 1, 12}, {3, 2, 2}};
  for (MatchMode mode : kModes) {
    Random random(9);
    std::vector<Plain> bodies;
    for (const auto& n : sizes) {
      Plain body;
      addLattice(n[0], n[1], n[2], kSpacing, 0.0, Vec3::Zero(), random, body.model);
      body.model.clusters = makeBody(random, 12, 1, 1).model.clusters;
      body.finish();
      for (std::size_t i = 0; i < 12; ++i) body.state.velocities[i] = random.vector(0.05);
      bodies.push_back(std::move(body));
    }
    const Material material = appearance(mode, 1.0);
    const BatchStep step = batchStep(material, 1.0 / 120.0);
    Lanes batch = batchOf(bodies);
    MatchCounters counters;
    for (int n = 0; n < 20; ++n) {
      batch.step(step, counters);
      for (Plain& body : bodies) body.step(material, step);
    }
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      const Plain& found = batch.bodies[i];
      // A line's spin about itself is known to no precision.
      EXPECT_LE(largestDistance(found.state.positions, bodies[i].state.positions), 1e-4 * kSpacing)
          << toString(mode) << " " << i;
    }
  }
}

}  // namespace match_batch_test
}  // namespace meshless
