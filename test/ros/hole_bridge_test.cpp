#include "ros/hole_bridge.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "meshless_surgery/base/types.h"

namespace meshless {
namespace hole_bridge_test {

constexpr double kTick = 0.002;  // [s]

TEST(HoleBridge, WithoutAHoleItIsTheValue) {
  HoleBridge<double> bridge(0.0);
  for (int i = 0; i < 10; ++i) {
    EXPECT_FALSE(bridge.isOpen(i * kTick));
    EXPECT_EQ(bridge.across(i * kTick, 7.0 * i), 7.0 * i);
  }
}

// Nobody was there from 0.1 s to 0.14 s; the ticks of that time are said later, all with the value of after.
TEST(HoleBridge, NoTickHasMoreThanItsShareOfAHole) {
  HoleBridge<double> bridge(0.0);
  const auto value = [](double time) { return time < 0.1 ? 1.0 : 5.0 + 10.0 * (time - 0.1); };
  double before = 1.0, steepest = 0.0, now = 0.09;
  for (; now < 0.1; now += kTick) before = bridge.across(now, value(now));
  bridge.open(now, 0.04);
  for (; now < 0.2; now += kTick) {
    const double said = bridge.across(now, value(now));
    steepest = std::max(steepest, std::abs(said - before));
    before = said;
    if (now > 0.141) EXPECT_EQ(said, value(now));
  }
  // A twentieth of 4.4, and at its end the value's own slope.
  EXPECT_LT(steepest, 0.25);
  EXPECT_GT(steepest, 0.2);
}

TEST(HoleBridge, AHoleInABridgeGoesOnFromWhatWasSaid) {
  HoleBridge<double> bridge(0.0);
  bridge.across(0.0, 1.0);
  bridge.open(0.1, 0.04);
  const double half = bridge.across(0.12, 3.0);
  EXPECT_NEAR(half, 2.0, 1e-12);
  bridge.open(0.15, 0.05);
  EXPECT_EQ(bridge.across(0.15, -4.0), half);
  EXPECT_EQ(bridge.across(0.2, -4.0), -4.0);
}

TEST(HoleBridge, AShortHoleDoesNotEndALongBridge) {
  HoleBridge<double> bridge(0.0);
  bridge.open(0.1, 0.1);
  EXPECT_NEAR(bridge.across(0.15, 10.0), 5.0, 1e-12);
  bridge.open(0.15, 0.006);
  EXPECT_NEAR(bridge.across(0.16, 10.0), 6.0, 1e-12);
  EXPECT_EQ(bridge.across(0.201, 10.0), 10.0);
}

// A step that came late, and then the ticks that were missed before it.
TEST(HoleBridge, UntilTheBridgeBeginsNothingNewIsSaid) {
  HoleBridge<double> bridge(0.0);
  bridge.across(0.09, 1.0);
  bridge.open(0.14, 0.05);
  bridge.open(0.1, 0.04);
  EXPECT_EQ(bridge.across(0.1, 10.0), 1.0);
  EXPECT_EQ(bridge.across(0.138, 10.0), 1.0);
  EXPECT_NEAR(bridge.across(0.145, 10.0), 1.9, 1e-12);
  EXPECT_EQ(bridge.across(0.192, 10.0), 10.0);
}

TEST(HoleBridge, WhatOnlyPushesDoesNotPull) {
  HoleBridge<Vec3> bridge(Vec3::Zero());
  bridge.across(0.0, Vec3(-3, 1, 0));
  bridge.open(0.1, 0.05);
  for (double now = 0.1; now < 0.16; now += kTick) EXPECT_LE(bridge.across(now, Vec3(-0.1, -1, 0)).x(), 0.0);
  bridge.open(0.2, 0.05);
  for (double now = 0.2; now < 0.26; now += kTick) EXPECT_LE(bridge.across(now, Vec3::Zero()).x(), 0.0);
  EXPECT_EQ(bridge.across(0.26, Vec3::Zero()), Vec3::Zero()) << "exactly zero again";
}

}  // namespace hole_bridge_test
}  // namespace meshless
