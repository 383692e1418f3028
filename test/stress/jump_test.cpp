// A pick's target that jumps, whatever the substeps: the tissue goes there within the step, and no faster.
#include <gtest/gtest.h>

#include "support/stress.h"

namespace meshless::stress {
namespace {

double fastestAfterJump(int substeps, bool elastic) {
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
  Points before = world.snapshot({false, true, false}).bodies[0].particles;
  double fastest = 0.0;
  for (int step = 0; step < 30; ++step) {
    world.step();
    const Points now = world.snapshot({false, true, false}).bodies[0].particles;
    for (std::size_t i = 0; i < now.size(); ++i)
      fastest = std::max(fastest, settings.step_rate * (now[i] - before[i]).norm());
    before = now;
  }
  const WorldSnapshot shot = world.snapshot({});
  EXPECT_LT((shot.picks[0].position - shot.picks[0].target).norm(), 1e-3);
  return fastest;
}

TEST(Jump, IsFollowedWithinTheStepAndNoFaster) {
  const double fair = 120.0;  // [m/s] a metre within a step
  for (const bool elastic : {false, true})
    for (const int substeps : {1, 8, 64}) {
      SCOPED_TRACE(substeps);
      EXPECT_LT(fastestAfterJump(substeps, elastic), 4.0 * fair);
    }
}

}  // namespace
}  // namespace meshless::stress
