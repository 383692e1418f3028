#include "ros/stillness.h"

#include "ros/scene_support.h"
#include "ros/surfaces.h"

namespace meshless {
namespace stillness_test {

struct Said {
  World& world;
  Stillness of_surfaces, of_points;
  Stillness::Clock::time_point now = Stillness::Clock::now();
  std::uint64_t commands = 0;

  /// Of surfaces and of points.
  std::pair<bool, bool> news(double seconds = 1e-3) {
    now += std::chrono::duration_cast<Stillness::Clock::duration>(std::chrono::duration<double>(seconds));
    SnapshotWants wants;
    wants.surfaces = wants.particles = true;
    const WorldSnapshot snapshot = world.snapshot(wants);
    return {of_surfaces.news(snapshot, false, toolsIn(snapshot), commands, now),
            of_points.news(snapshot, true, {}, commands, now)};
  }
};

constexpr std::pair<bool, bool> kBoth{true, true}, kNone{false, false};

TEST(Stillness, WhatLiesStillIsSaidOnceASecond) {
  const auto world = twoBoxes();
  Said said{*world, {}, {}};
  EXPECT_EQ(said.news(), kBoth) << "nothing was said yet";
  for (int k = 0; k < 5; ++k) {
    world->step();
    EXPECT_EQ(said.news(0.1), kNone);
  }
  EXPECT_EQ(said.news(0.51), kBoth);
  EXPECT_EQ(said.news(0.1), kNone);
  ++said.commands;
  EXPECT_EQ(said.news(), kBoth) << "who waits for what a service has done";
  EXPECT_EQ(said.news(), kNone);
}

TEST(Stillness, WhatMovesIsSaidAtOnce) {
  const auto world = twoBoxes();
  Said said{*world, {}, {}};
  said.news();
  PickCommand pick;
  pick.point = Vec3(-0.05, 0, 0);
  pick.max_distance = 0.1;
  const auto picked = world->apply(pick);
  ASSERT_TRUE(picked.ok());
  EXPECT_EQ(said.news(), std::make_pair(true, false)) << "the spring is drawn with surfaces";
  EXPECT_EQ(said.news(), kNone);
  MovePickCommand move;
  move.pick = std::get<PickReply>(*picked).pick;
  move.target = Vec3(-0.2, 0.1, 0.05);
  ASSERT_TRUE(world->apply(move).ok());
  for (int k = 0; k < 3; ++k) {
    world->step();
    EXPECT_EQ(said.news(), kBoth);
    EXPECT_EQ(said.news(), kNone);
  }
  PushCommand push;
  push.position = Vec3(0, 0, 5);
  ASSERT_TRUE(world->apply(push).ok());
  EXPECT_EQ(said.news(), std::make_pair(true, false));
  ASSERT_TRUE(world->apply(RemoveCommand{"a"}).ok());
  EXPECT_EQ(said.news(), kBoth);
  world->reset();
  said.news();
  EXPECT_EQ(said.news(), kNone);
  world->reset();
  EXPECT_TRUE(said.news().first) << "messages of an older run are void";
}

}  // namespace stillness_test
}  // namespace meshless
