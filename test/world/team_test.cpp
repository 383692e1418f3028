// Threads that stand by: every loop is done once, whoever is awake.
#include "world/team.h"

#include <chrono>
#include <cmath>
#include <numeric>

#include <gtest/gtest.h>

#include "meshless_surgery/base/random.h"

namespace meshless {
namespace team_test {

TEST(Team, EachPieceOfWorkIsDoneOnce) {
  Team team(3);
  Random random(7);
  for (int loop = 0; loop < 2000; ++loop) {
    const std::size_t count = static_cast<std::size_t>(random.whole(0, 300));
    std::vector<int> done(count, 0);
    team.run(count, [&](std::size_t n) { ++done[n]; });
    for (const int times : done) ASSERT_EQ(times, 1);
    // Long enough now and then for the others to fall asleep.
    if (loop % 100 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  EXPECT_GT(team.shared(), 1900u);
}

TEST(Team, LoopsWithinLoopsAreDoneByWhoIsAtThem) {
  Team team(2);
  std::vector<int> done(40 * 30, 0);
  team.run(40, [&](std::size_t a) { team.run(30, [&](std::size_t b) { ++done[30 * a + b]; }); });
  for (const int times : done) ASSERT_EQ(times, 1);
  EXPECT_EQ(team.shared(), 1u);
}

TEST(Team, TwoThatCallAtATimeBothGetTheirWorkDone) {
  Team team(2);
  std::vector<std::size_t> sums(2, 0);
  const auto call = [&](std::size_t who) {
    for (int loop = 0; loop < 500; ++loop) {
      std::vector<std::size_t> parts(64, 0);
      team.run(64, [&](std::size_t n) { parts[n] = n; });
      sums[who] += std::accumulate(parts.begin(), parts.end(), std::size_t{0});
    }
  };
  std::thread other([&] { call(1); });
  call(0);
  other.join();
  for (const std::size_t sum : sums) EXPECT_EQ(sum, 500u * 64u * 63u / 2u);
}

TEST(Team, OthersTakeTheirPartAlsoAfterASleep) {
  Team team(2);
  for (int loop = 0; loop < 20; ++loop) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    std::atomic<bool> met{false};
    // Long enough for the other to wake, however busy the machine is.
    team.run(2, [&](std::size_t n) {
      if (n == 1) met = true;
      const auto since = std::chrono::steady_clock::now();
      while (n == 0 && !met && std::chrono::steady_clock::now() - since < std::chrono::seconds(20)) {
      }
    });
    EXPECT_TRUE(met) << loop;
  }
}

TEST(Team, WhatWorkThrowsComesBackAndTheNextLoopIsWhole) {
  Team team(2);
  for (const std::size_t bad : {std::size_t{0}, std::size_t{99}}) {
    EXPECT_THROW(team.run(100,
                          [&](std::size_t n) {
                            if (n == bad) throw std::runtime_error("no");
                          }),
                 std::runtime_error);
    std::vector<int> done(100, 0);
    team.run(100, [&](std::size_t n) { ++done[n]; });
    for (const int times : done) EXPECT_EQ(times, 1);
  }
}

}  // namespace team_test
}  // namespace meshless
