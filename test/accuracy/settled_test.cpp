// Bodies as users have them, at the defaults, through World::step, against CalculiX.
#include "settled_load.h"

#include <gtest/gtest.h>

namespace meshless::bench {
namespace {

SettledResult settled(const std::string& name, double finer = 1.0) {
  const Result<TruthCase> truth = readTruthCase(std::string(CALCULIX_FOLDER) + "/" + name + ".csv");
  EXPECT_TRUE(truth.ok()) << (truth.ok() ? "" : truth.error().detail);
  const Result<SettledResult> result = settle(*truth, CALCULIX_FOLDER, {finer});
  EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().detail);
  EXPECT_LT(result->moving, 3e-4) << name;
  EXPECT_EQ(result->slower, 1.0) << name;
  return *result;
}

// Any shape, any placing, any clamp, at the default number of particles.
TEST(Settled, BodiesOfFilledCellsWithin2PercentAtTheDefaults) {
  for (const char* name : {"bar", "bar_nu49", "bar_turned", "bar_awkward_000", "bar_awkward_260", "bar_awkward_282",
                           "bar_awkward_322", "bar_oblique_clamp", "taper", "tube", "curved", "angle"})
    EXPECT_LT(settled(name).error, 0.02) << name;
}

// What is seen of a bent bar, in triangles of half a spacing: its vertices, and what edges between them turn by.
TEST(Settled, TheSurfaceOfABentBarWithin1PercentAndSmooth) {
  const SettledResult result = settled("bar_fine");
  EXPECT_LT(result.farthest, 0.01);
  EXPECT_LT(result.slope, 0.02);
}

TEST(Settled, WhatFallsAsleepIsWithinAThousandthOfItsRest) {
  SettledOptions options;
  const Result<TruthCase> truth = readTruthCase(std::string(CALCULIX_FOLDER) + "/bar.csv");
  ASSERT_TRUE(truth.ok()) << truth.error().detail;
  const double rest = settle(*truth, CALCULIX_FOLDER, options)->tip;
  options.sleeps = true;
  const Result<SettledResult> asleep = settle(*truth, CALCULIX_FOLDER, options);
  EXPECT_EQ(asleep->moving, 0.0) << "it sleeps";
  EXPECT_NEAR(asleep->tip, rest, 1e-3 * rest);
}

// A spacing that divides neither the body nor the way to its clamp is as good as any.
TEST(Settled, FinerIsNotWorse) {
  for (const double finer : {1.1, 1.26}) EXPECT_LT(settled("bar_awkward_260", finer).error, 0.005) << finer;
}

}  // namespace
}  // namespace meshless::bench
