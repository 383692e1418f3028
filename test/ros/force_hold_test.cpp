#include "meshless_surgery/ros/force_hold.h"

#include <gtest/gtest.h>

#include "ros/scene_support.h"

namespace meshless {
namespace {

constexpr double kStep = 1.0 / 120.0;  // [s]
constexpr double kTick = 1.0 / 500.0;  // [s]

TEST(ForceHold, GoesFromStepToStepWithoutAJump) {
  ForceHold hold;
  EXPECT_TRUE(hold.isZero(0.0));
  hold.stepped(Vec3(12, 0, 0), kStep, 1.0);
  EXPECT_EQ(hold.at(1.0), Vec3::Zero());
  EXPECT_NEAR(hold.at(1.0 + 0.5 * kStep).x(), 6.0, 1e-9);
  EXPECT_NEAR(hold.at(1.0 + kStep).x(), 12.0, 1e-9);
  EXPECT_EQ(hold.at(5.0).x(), 12.0);  // the world stands still
  // The next step comes early: it goes on from where it is.
  hold.stepped(Vec3(12, 0, 0), kStep, 5.0);
  hold.stepped(Vec3(0, 0, 0), kStep, 5.0 + 0.5 * kStep);
  EXPECT_NEAR(hold.at(5.0 + 0.5 * kStep).x(), 12.0, 1e-9);
  EXPECT_TRUE(hold.isZero(5.0 + 1.6 * kStep));
  EXPECT_FALSE(hold.isZero(5.0 + 0.7 * kStep));
}

TEST(ForceHold, WithoutATimeItIsThereAtOnce) {
  ForceHold hold;
  hold.stepped(Vec3(0, 3, 0), 0.0, 2.0);
  EXPECT_EQ(hold.at(2.0).y(), 3.0);
}

// A free body is pulled by a hand for a while and then let go: what the hand feels at 500 Hz is what the body got.
TEST(ForceHold, TheSumOverAPullIsTheChangeOfMomentum) {
  const auto boxes = twoBoxes();
  World& world = *boxes;
  PickCommand pick;
  pick.point = Vec3(-0.05, 0, 0);
  pick.max_distance = 0.1;
  const auto reply = world.apply(pick);
  ASSERT_TRUE(reply.ok());
  const PickReply picked = std::get<PickReply>(*reply);
  MovePickCommand move;
  move.pick = picked.pick;
  const SnapshotWants measures{false, false, true};

  ForceHold hold;
  Vec3 felt = Vec3::Zero();  // [N s]
  double steepest = 0.0, strongest = 0.0, time = 0.0;
  Vec3 before = Vec3::Zero();
  double tick = 0.0;
  for (int step = 0; step < 120; ++step) {
    if (step < 60) {
      move.target = picked.position + Vec3(0.0005 * step, 0.0002 * step, 0.0);
      ASSERT_TRUE(world.apply(move).ok());
    } else if (step == 60) {
      ReleaseCommand release;
      release.pick = picked.pick;
      ASSERT_TRUE(world.apply(release).ok());
    }
    world.step();
    const auto held = world.heldPick();
    hold.stepped(held ? Vec3(-held->force) : Vec3::Zero(), kStep, time);
    for (; tick < time + kStep; tick += kTick) {
      const Vec3 force = hold.at(tick);
      steepest = std::max(steepest, (force - before).norm());
      strongest = std::max(strongest, force.norm());
      before = force;
      felt += kTick * force;
    }
    time += kStep;
  }
  const Vec3 momentum = world.snapshot(measures).bodies[0].measures.linear_momentum;
  ASSERT_GT(momentum.norm(), 0.01);
  EXPECT_LT((felt + momentum).norm(), 0.02 * momentum.norm());
  EXPECT_LE(steepest, strongest * kTick / kStep * 1.001 + 1e-12);
  EXPECT_TRUE(hold.isZero(time));
}

}  // namespace
}  // namespace meshless
