#include "meshless_surgery/appearance/look.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace meshless {
namespace look_test {

constexpr Color kBase{0.8f, 0.1f, 0.3f, 0.7f};

Look lookOf(Noise noise) {
  Look look;
  look.noise = noise;
  look.second = {0.2f, 0.6f, 0.3f, 1.0f};
  look.scale = 0.003;
  return look;
}

Points places(std::size_t count, double within) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> along(-within, within);
  Points points(count);
  for (Vec3& p : points) p = Vec3(along(random), along(random), along(random));
  return points;
}

TEST(Look, EveryColourIsBetweenTheTwo) {
  for (const Noise noise : kNoises)
    for (const double within : {0.003, 0.2, 1e4})
      for (const Vec3& p : places(3000, within)) {
        const Color c = colorAt(lookOf(noise), kBase, p, Vec3::UnitZ());
        ASSERT_TRUE(c.r >= 0.2f && c.r <= 0.8f) << toString(noise) << " " << c.r;
        ASSERT_TRUE(c.g >= 0.1f && c.g <= 0.6f) << toString(noise) << " " << c.g;
        ASSERT_EQ(0.3f, c.b) << toString(noise);
        ASSERT_EQ(0.7f, c.a) << toString(noise);
      }
}

TEST(Look, APatternHasBothColoursAndThePlainOneHasNone) {
  for (const Noise noise : kNoises) {
    double least = 1.0, most = 0.0;
    for (const Vec3& p : places(5000, 0.1)) {
      const double share = patternAt(lookOf(noise), p);
      ASSERT_TRUE(share >= 0.0 && share <= 1.0) << toString(noise) << " " << share;
      least = std::min(least, share);
      most = std::max(most, share);
    }
    EXPECT_LT(least, 0.15) << toString(noise);
    if (noise == Noise::kPlain)
      EXPECT_EQ(0.0, most);
    else
      EXPECT_GT(most, 0.85) << toString(noise);
  }
}

// Neighbours look alike: what is drawn between vertices is what is there. Cells have walls, where a tint ends.
TEST(Look, PatternsGoOnWithoutSteps) {
  for (const Noise noise : kNoises) {
    const Look look = lookOf(noise);
    std::size_t steps = 0;
    const double along = 1e-3 * look.scale;
    for (const Vec3& p : places(100000, 0.1))
      steps += std::abs(patternAt(look, p) - patternAt(look, p + Vec3(along, -along, along))) > 0.05;
    EXPECT_LE(steps, 8u) << toString(noise);
  }
}

TEST(Look, ALargerScaleIsTheSamePatternLarger) {
  for (const Noise noise : kNoises) {
    const Look fine = lookOf(noise);
    Look coarse = fine;
    coarse.scale *= 4.0;
    for (const Vec3& p : places(500, 0.1)) ASSERT_NEAR(patternAt(fine, p), patternAt(coarse, 4.0 * p), 1e-9);
  }
}

TEST(Look, WhatCannotBeUsedIsNamedWithItsRange) {
  const double no_number = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(Look().validate("outer").ok());
  const auto refused = [](const Look& look, const std::string& key) {
    const Status status = look.validate("outer");
    ASSERT_FALSE(status.ok()) << key;
    EXPECT_NE(std::string::npos, status.error().detail.find("outer." + key + " is ")) << status.error().detail;
    EXPECT_NE(std::string::npos, status.error().detail.find("accepted: ")) << status.error().detail;
  };
  for (const double scale : {0.0, -1.0, 2.0, no_number}) {
    Look look;
    look.scale = scale;
    refused(look, "scale");
  }
  for (const double share : {-0.1, 1.1, no_number}) {
    Look look;
    look.wetness = share;
    refused(look, "wetness");
    look = Look();
    look.bump = share;
    refused(look, "bump");
    look = Look();
    look.second.g = static_cast<float>(share);
    refused(look, "second");
  }
}

}  // namespace look_test
}  // namespace meshless
