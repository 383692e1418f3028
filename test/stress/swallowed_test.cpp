// A push sphere hundreds of times larger than the bodies that lie on the ground appears about them, again and again: it
// puts them out as a whole, and tears nothing.
#include <gtest/gtest.h>

#include "support/stress_cases.h"

namespace meshless::stress {
namespace swallowed_test {

constexpr double kSize = 0.25;  // [m] diagonal of a block

class Swallowed : public testing::TestWithParam<Kind> {};

TEST_P(Swallowed, BodiesStayWhole) {
  for (const double radius : {5.0, 100.0}) {
    SCOPED_TRACE(radius);
    WorldSettings settings;
    Twins twins(settings);
    for (int b = 0; b < 3; ++b)
      twins.spawn(test::shared(blockOf(GetParam(), "block" + std::to_string(b), Vec3(0.25 * b, 0.0, 0.001))));
    test::Random random(3);
    double reach = 3.0;
    for (int step = 0; step < 60; ++step) {
      PushCommand push;
      push.radius = radius;
      push.position = radius * Vec3(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-0.5, 1));
      twins.attempt(push);
      reach += 2.0 * radius + 3.0;
      ASSERT_TRUE(twins.step(Vec3::Zero(), reach));
      for (const BodySnapshot& body : twins.seen().bodies)
        ASSERT_LT(reachOf(body.particles, body.measures.centre_of_mass), 3.0 * kSize) << "step " << step;
    }
    twins.attempt(PushCommand{false});
    for (int step = 0; step < 240; ++step) ASSERT_TRUE(twins.step(Vec3::Zero(), reach + 100.0));
    for (const BodySnapshot& body : twins.seen().bodies)
      EXPECT_LT(reachOf(body.particles, body.measures.centre_of_mass), 0.75 * kSize) << body.name;
  }
}

// A stiff pick holds tissue inside of the sphere, and they contradict each other. At once the tissue is moved by no
// more than its own size.
TEST_P(Swallowed, BodiesThatAreHeldStayFinite) {
  for (const double radius : {1.0, 1000.0})
    for (const int substeps : {1, 7}) {
      SCOPED_TRACE(std::to_string(radius) + " m, " + std::to_string(substeps));
      WorldSettings settings;
      settings.substeps = substeps;
      Twins twins(settings);
      Kind coarse = GetParam();
      coarse.bodies = 36;
      twins.spawn(test::shared(blockOf(coarse, "block", Vec3(0.0, 0.0, 0.001))));
      for (int step = 0; step < 10; ++step) ASSERT_TRUE(twins.step(Vec3::Zero(), 3.0));
      PickCommand pick;
      pick.point = Vec3(0.1, 0.05, 0.05);
      pick.max_distance = 1.0;
      pick.stiffness = 2e9;
      twins.attempt(pick);
      PushCommand push;
      push.radius = radius;
      push.position = 0.3 * radius * Vec3(0.3, -0.2, 0.1);
      twins.attempt(push);
      for (int step = 0; step < 60; ++step) {
        ASSERT_TRUE(twins.step(Vec3::Zero(), 1e3)) << "step " << step;
        ASSERT_LT(twins.seen().bodies[0].measures.kinetic_energy, 1e7) << "step " << step;
      }
    }
}

// A sphere that goes through the middle of a body appears in it, and is gone after half a second: what it has pushed
// aside comes back.
TEST_P(Swallowed, HalfCoveredBodiesComeBack) {
  test::Random random(5);
  for (const double radius : {0.03, 0.06, 0.2, 1.0, 30.0}) {
    SCOPED_TRACE(radius);
    const WorldSettings settings = test::weightless();
    Twins twins(settings);
    twins.spawn(test::shared(blockOf(GetParam(), "block")));
    PushCommand push;
    push.radius = radius;
    push.position = radius * random.unit();
    twins.attempt(push);
    const double reach = 10.0 + 4.0 * radius;
    for (int step = 0; step < 30; ++step) {
      ASSERT_TRUE(twins.step(Vec3::Zero(), reach)) << "step " << step;
      const BodySnapshot& body = twins.seen().bodies[0];
      ASSERT_LT(reachOf(body.particles, body.measures.centre_of_mass), 3.0 * kSize) << "step " << step;
    }
    twins.attempt(PushCommand{false});
    ASSERT_TRUE(twins.step(Vec3::Zero(), reach));
    Twins stopped = stoppedAsAWhole(twins, settings, reach);
    EnergyLaw law(1.01);
    const double h = 1.0 / settings.step_rate;
    double farthest = 1.0;
    for (int step = 0; step < 600 && !(farthest < 1e-3); ++step) {
      ASSERT_TRUE(stopped.step(Vec3::Zero(), reach)) << "step " << step;
      const BodySnapshot& body = stopped.seen().bodies[0];
      farthest = distanceFromRest(*body.model, body.particles);
      ASSERT_TRUE(
          law.holds(body.measures.kinetic_energy + deformationEnergy(*body.model, body.material, h, body.particles)))
          << "step " << step;
    }
    EXPECT_LT(farthest, 1e-3);
  }
}

// A block that is spawned half inside one a hundred times its size, on the ground, is not thrown and leaves it. What is
// elastic, or half inside and more, is pressed down between it and the ground: the faces below are nearer.
TEST_P(Swallowed, ABodyHalfInsideAHugeOneComesOut) {
  for (const double depth : {0.02, 0.05, 0.1}) {
    SCOPED_TRACE(depth);
    Twins twins{WorldSettings()};
    BodyDef huge = test::defOf(boxMesh(Vec3::Constant(10.0), 4, 4, 4), "huge");
    huge.spacing = 2.5;
    huge.pose.translation = Vec3(5.1 - depth, 0.0, 5.0);
    twins.spawn(test::shared(huge));
    twins.spawn(test::shared(blockOf(GetParam(), "block", Vec3(0.0, 0.02, 0.051))));
    for (int step = 0; step < 300; ++step) {
      ASSERT_TRUE(twins.step(Vec3::Zero(), 40.0)) << "step " << step;
      const BodySnapshot& block = twins.seen().bodies[1];
      ASSERT_LT(block.measures.linear_momentum.norm(), block.model->mass * 2.0) << "step " << step;
      ASSERT_LT(reachOf(block.particles, block.measures.centre_of_mass), 3.0 * kSize) << "step " << step;
    }
    const std::vector<BodySnapshot>& bodies = twins.seen().bodies;
    double left = std::numeric_limits<double>::infinity(), right = -left;
    for (const Vec3& p : bodies[0].surface) left = std::min(left, p.x());
    for (const Vec3& p : bodies[1].surface) right = std::max(right, p.x());
    if (!GetParam().elastic && depth < 0.05) {
      EXPECT_LT(right - left, 0.015);
    }
    EXPECT_LT(std::abs(bodies[1].measures.centre_of_mass.y()), 0.5);
  }
}

INSTANTIATE_TEST_SUITE_P(Stress, Swallowed, testing::ValuesIn(kindsAlone()),
                         [](const auto& info) { return testName(info.param.name); });

}  // namespace swallowed_test
}  // namespace meshless::stress
