// A pick's target that jumps, whatever the substeps: the tissue goes there evenly over the step, and no faster.
#include <gtest/gtest.h>

#include "support/stress.h"

namespace meshless::stress {
namespace jump_test {

struct Fastest {
  double held = 0.0;      // the patch that the pick holds, over the speed of the jump within a step
  double particle = 0.0;  // [m/s] any particle
  double energy = 0.0;    // [J] kinetic, as the patch arrives
};

Fastest fastestAfterJump(int substeps, bool elastic) {
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kNone;
  settings.substeps = settings.max_substeps = substeps;
  World world(settings);
  Kind kind;
  kind.elastic = elastic;
  EXPECT_TRUE(world.addSceneBody(test::shared(blockOf(kind, "block"))).ok());
  PickCommand pick;
  pick.max_distance = 1.0;
  pick.stiffness = 1e12;
  const PickId held = test::replyOf<PickReply>(world.apply(pick)).pick;
  EXPECT_TRUE(world.apply(MovePickCommand{held, Vec3(-1.0, 0.0, 0.0)}).ok());
  WorldSnapshot before = world.snapshot({false, true, true});
  const double fair = settings.step_rate * (before.picks[0].target - before.picks[0].position).norm();  // [m/s]
  Fastest fastest;
  for (int step = 0; step < 30; ++step) {
    world.step();
    const WorldSnapshot now = world.snapshot({false, true, true});
    if (step == 0) fastest.energy = now.bodies[0].measures.kinetic_energy;
    const auto speed = [&](const Vec3& a, const Vec3& b) { return settings.step_rate * (b - a).norm(); };
    fastest.held = std::max(fastest.held, speed(before.picks[0].position, now.picks[0].position) / fair);
    const Points &from = before.bodies[0].particles, &to = now.bodies[0].particles;
    for (std::size_t i = 0; i < to.size(); ++i) fastest.particle = std::max(fastest.particle, speed(from[i], to[i]));
    EXPECT_LT((now.picks[0].position - now.picks[0].target).norm(), 1e-3) << "step " << step;
    before = now;
  }
  return fastest;
}

TEST(Jump, IsFollowedEvenlyOverTheStep) {
  for (const bool elastic : {false, true}) {
    // The middle of a patch goes farther than its mean: with one substep that is all that there is to it.
    const Fastest at_once = fastestAfterJump(1, elastic);
    for (const int substeps : {8, 64}) {
      SCOPED_TRACE(substeps);
      const Fastest fastest = fastestAfterJump(substeps, elastic);
      EXPECT_LT(fastest.held, 1.01);
      EXPECT_LE(fastest.particle, 1.35 * at_once.particle);
      // It still moves as it arrives: thrown there within the first substep it would lie there by then.
      EXPECT_GT(fastest.energy, 0.8 * at_once.energy);
      EXPECT_LT(fastest.energy, 1.5 * at_once.energy);
    }
  }
}

}  // namespace jump_test
}  // namespace meshless::stress
