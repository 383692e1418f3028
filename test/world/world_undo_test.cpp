// Undo of cuts and incisions: the state before them, and a reason where there is none.
#include <gtest/gtest.h>

#include "meshless_surgery/world/world.h"
#include "support/bodies.h"

namespace meshless {
namespace world_undo_test {

using test::replyOf;

World twoBodies() {
  World world(test::weightless());
  EXPECT_TRUE(world.addSceneBody(test::shared(test::ball("ball", Vec3(0, 0, 0.2)))).ok());
  EXPECT_TRUE(world.addSceneBody(test::shared(test::block("block", Vec3(0.5, 0, 0.2)))).ok());
  return world;
}

// Through the ball alone, or with `width` 0 through both.
CutCommand cutBall(double width) {
  CutCommand cut;
  cut.blades.origin = Vec3(-0.3, 0, 0.2);
  cut.blades.length = 0.6;
  cut.blades.width = width;
  if (width == 0.0) cut.blades.length = 0.0;
  return cut;
}

InciseCommand openBlock() {
  InciseCommand incise;
  incise.blade.origin = Vec3(0.46, 0, 0.26);
  incise.blade.x_axis = Vec3::UnitX();
  incise.blade.y_axis = Vec3::UnitZ();
  incise.blade.length = 0.08;
  incise.blade.depth = 0.05;
  return incise;
}

/// Names, numbers, places and springs, to the last bit.
void expectSame(const WorldSnapshot& a, const WorldSnapshot& b) {
  ASSERT_EQ(a.bodies.size(), b.bodies.size());
  for (std::size_t i = 0; i < a.bodies.size(); ++i) {
    EXPECT_EQ(a.bodies[i].name, b.bodies[i].name);
    EXPECT_EQ(a.bodies[i].number, b.bodies[i].number);
    EXPECT_EQ(a.bodies[i].surface, b.bodies[i].surface);
    EXPECT_EQ(a.bodies[i].particles, b.bodies[i].particles);
    EXPECT_EQ(a.bodies[i].measures.linear_momentum, b.bodies[i].measures.linear_momentum);
    EXPECT_EQ(a.bodies[i].model->mass, b.bodies[i].model->mass);
  }
  ASSERT_EQ(a.picks.size(), b.picks.size());
  for (std::size_t i = 0; i < a.picks.size(); ++i) {
    EXPECT_EQ(a.picks[i].id, b.picks[i].id);
    EXPECT_EQ(a.picks[i].particle, b.picks[i].particle);
    EXPECT_EQ(a.picks[i].target, b.picks[i].target);
    EXPECT_EQ(a.picks[i].locked, b.picks[i].locked);
    EXPECT_EQ(a.pick_bodies.at(a.picks[i].id), b.pick_bodies.at(b.picks[i].id));
  }
}

void run(World& world, int steps) {
  for (int i = 0; i < steps; ++i) world.step();
}

PickId grab(World& world, const Vec3& point, const Vec3& target) {
  PickCommand pick;
  pick.point = point;
  pick.max_distance = 0.1;
  const PickReply reply = replyOf<PickReply>(world.apply(pick));
  LockCommand lock;
  lock.pick = reply.pick;
  lock.target = target;
  EXPECT_TRUE(world.apply(lock).ok());
  return reply.pick;
}

TEST(UndoCut, SaysThatThereIsNothingToUndo) {
  World world = twoBodies();
  const std::uint64_t before = world.stateHash();
  const auto reply = world.apply(UndoCutCommand{});
  ASSERT_FALSE(reply.ok());
  EXPECT_EQ(reply.error().code, ErrorCode::kMissed);
  EXPECT_NE(reply.error().detail.find("no cut to undo"), std::string::npos);
  EXPECT_EQ(world.stateHash(), before);
}

TEST(UndoCut, BringsBackTheBodyItsPlacesAndItsSprings) {
  World world = twoBodies();
  grab(world, Vec3(0, 0, 0.3), Vec3(0.05, 0, 0.35));
  grab(world, Vec3(0.5, 0, 0.25), Vec3(0.5, 0.05, 0.3));
  run(world, 20);
  const WorldSnapshot before = world.snapshot({true, true, true});
  const CutReply cut = replyOf<CutReply>(world.apply(cutBall(0.1)));
  EXPECT_EQ(cut.cut_bodies, std::vector<std::string>{"ball"});
  run(world, 20);
  ASSERT_EQ(world.snapshot({}).bodies.size(), 3u);
  const double time = world.simTime();
  const UndoCutReply undone = replyOf<UndoCutReply>(world.apply(UndoCutCommand{}));
  EXPECT_EQ(undone.bodies, std::vector<std::string>{"ball"});
  expectSame(before, world.snapshot({true, true, true}));
  EXPECT_EQ(world.simTime(), time);
  EXPECT_FALSE(world.apply(UndoCutCommand{}).ok());
  run(world, 20);
  EXPECT_TRUE(test::allFinite(world.snapshot({false, true, false}).bodies[0].particles));
}

TEST(UndoCut, TheSameCutAgainGivesTheSamePieces) {
  World world = twoBodies();
  const CutReply first = replyOf<CutReply>(world.apply(cutBall(0.1)));
  ASSERT_TRUE(world.apply(UndoCutCommand{}).ok());
  const CutReply second = replyOf<CutReply>(world.apply(cutBall(0.1)));
  EXPECT_EQ(first.cap_area, second.cap_area);
  ASSERT_EQ(first.new_bodies.size(), second.new_bodies.size());
  // Names of pieces that were, are retired.
  for (const std::string& name : first.new_bodies)
    for (const std::string& again : second.new_bodies) EXPECT_NE(name, again);
}

TEST(UndoCut, TakesAnIncisionBack) {
  World world = twoBodies();
  run(world, 5);
  const WorldSnapshot before = world.snapshot({true, true, true});
  const InciseReply opened = replyOf<InciseReply>(world.apply(openBlock()));
  EXPECT_GT(opened.opened_area, 0.0);
  run(world, 5);
  ASSERT_TRUE(world.apply(UndoCutCommand{}).ok());
  expectSame(before, world.snapshot({true, true, true}));
}

TEST(UndoCut, GoesBackCutByCutThroughTheLastEight) {
  World world = twoBodies();
  std::vector<WorldSnapshot> before;
  for (int k = 0; k < 9; ++k) {
    before.push_back(world.snapshot({true, true, true}));
    CutCommand cut = cutBall(0.0);  // first through both, then slices of the block
    if (k > 0) {
      cut.blades.origin = Vec3(0.4 + 0.0217 * k, -1.0, 0.2);
      cut.blades.x_axis = Vec3::UnitY();
      cut.blades.y_axis = Vec3::UnitZ();
    }
    replyOf<CutReply>(world.apply(cut));
    run(world, 2);
  }
  for (int k = 8; k > 0; --k) {
    SCOPED_TRACE(k);
    ASSERT_TRUE(world.apply(UndoCutCommand{}).ok());
    expectSame(before[static_cast<std::size_t>(k)], world.snapshot({true, true, true}));
  }
  EXPECT_FALSE(world.apply(UndoCutCommand{}).ok());
}

TEST(UndoCut, AFailedCutIsNotRemembered) {
  World world = twoBodies();
  CutCommand aside = cutBall(0.1);
  aside.blades.origin.z() = 5.0;
  ASSERT_FALSE(world.apply(aside).ok());
  EXPECT_FALSE(world.apply(UndoCutCommand{}).ok());
}

TEST(UndoCut, ResetForgetsCuts) {
  World world = twoBodies();
  ASSERT_TRUE(world.apply(cutBall(0.1)).ok());
  world.reset();
  EXPECT_FALSE(world.apply(UndoCutCommand{}).ok());
}

TEST(UndoCut, WhatCameSinceStaysAndWhatWasRemovedStaysAway) {
  World world = twoBodies();
  ASSERT_TRUE(world.apply(cutBall(0.1)).ok());
  SpawnCommand spawn;
  spawn.body = test::shared(test::block("late", Vec3(-0.5, 0, 0.2)));
  ASSERT_TRUE(world.apply(spawn).ok());
  RemoveCommand remove;
  remove.body = "block";
  ASSERT_TRUE(world.apply(remove).ok());
  ASSERT_TRUE(world.apply(UndoCutCommand{}).ok());
  const WorldSnapshot shot = world.snapshot({});
  ASSERT_EQ(shot.bodies.size(), 2u);
  EXPECT_EQ(shot.bodies[0].name, "ball");
  EXPECT_EQ(shot.bodies[1].name, "late");
}

TEST(Probe, SaysWhatARayMeetsAndChangesNothing) {
  World world = twoBodies();
  run(world, 3);
  const std::uint64_t before = world.stateHash();
  const auto met = world.probe(Vec3(0.51, 0.003, 1.0), Vec3(0, 0, -2));
  ASSERT_TRUE(met.ok());
  EXPECT_EQ(met->body, "block");
  EXPECT_NEAR(met->position.z(), 0.25, 1e-6);
  EXPECT_NEAR((met->normal - Vec3::UnitZ()).norm(), 0.0, 1e-6);
  const auto missed = world.probe(Vec3(0, 0, 1), Vec3(0, 0, 1));
  ASSERT_FALSE(missed.ok());
  EXPECT_EQ(missed.error().code, ErrorCode::kMissed);
  EXPECT_FALSE(world.probe(Vec3(0, 0, 1), Vec3::Zero()).ok());
  EXPECT_EQ(world.stateHash(), before);
}

}  // namespace world_undo_test
}  // namespace meshless
