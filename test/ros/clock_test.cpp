#include "ros/clock.h"

#include <gtest/gtest.h>

#include "ros/hand_clock.h"

namespace meshless {
namespace clock_test {

TEST(Clock, CountsFromTheFirstTimeThatWasTold) {
  HandClock hand;
  hand.time = 0.0;  // no /clock yet
  EXPECT_EQ(hand.clock.now(), 0.0);
  EXPECT_EQ(hand.clock.now(), 0.0);
  hand.time = 1.7e9;
  EXPECT_EQ(hand.clock.now(), 0.0);
  hand.time = 1.7e9 + 0.25;
  EXPECT_NEAR(hand.clock.now(), 0.25, 1e-6);
}

TEST(Clock, NeverGoesBackAndGoesOnFromWhereItWas) {
  HandClock hand;
  hand.clock.now();
  hand.time = 107.0;
  EXPECT_NEAR(hand.clock.now(), 7.0, 1e-9);
  hand.time = 5.0;  // a bag that is played again
  EXPECT_NEAR(hand.clock.now(), 7.0, 1e-9);
  hand.time = 5.5;
  EXPECT_NEAR(hand.clock.now(), 7.5, 1e-9);
  for (const double wild : {4e9, 0.0, 4e9, 1e-9}) {  // further than a ros::Duration goes
    const double before = hand.clock.now();
    hand.time = wild;
    EXPECT_GE(hand.clock.now(), before);
  }
}

TEST(Clock, StampsAreTheSourcesOwn) {
  HandClock hand;
  hand.clock.now();
  hand.time = 102.0;
  const double now = hand.clock.now();
  EXPECT_NEAR(hand.clock.stampOf(now).toSec(), 102.0, 1e-6);
  EXPECT_NEAR(hand.clock.stampOf(now - 0.05).toSec(), 101.95, 1e-6);
  hand.time = 5.0;
  EXPECT_NEAR(hand.clock.stampOf(hand.clock.now()).toSec(), 5.0, 1e-6);
  // There is no time below 0.
  hand.time = 0.01;
  EXPECT_NEAR(hand.clock.stampOf(hand.clock.now() - 0.05).toSec(), 0.01, 1e-6);
}

TEST(Clock, OneThatMayStandIsLookedAtOften) {
  HandClock hand;
  const double now = hand.clock.now();
  EXPECT_EQ(hand.clock.wallUntil(now), 0.0);
  EXPECT_EQ(hand.clock.wallUntil(now - 1.0), 0.0);
  EXPECT_GT(hand.clock.wallUntil(now + 100.0), 0.0);
  EXPECT_LE(hand.clock.wallUntil(now + 100.0), 1e-3);
  EXPECT_GT(wallClock().wallUntil(wallClock().now() + 100.0), 90.0);
}

}  // namespace clock_test
}  // namespace meshless
