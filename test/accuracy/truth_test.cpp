// The deformer against the finite-element truth (bench/truth): materials for accuracy, without calibration.
#include <gtest/gtest.h>

#include <string>

#include "static_load.h"

namespace meshless::bench {
namespace {

const char* const kFolder = TRUTH_FOLDER;

StaticResult solved(const std::string& name, double spacing) {
  const Result<TruthCase> truth = readTruthCase(std::string(kFolder) + "/" + name + ".csv");
  EXPECT_TRUE(truth.ok()) << (truth.ok() ? "" : truth.error().detail);
  StaticSettings settings;
  settings.spacing = spacing;
  settings.material.youngs_modulus = 1.0;
  const Result<StaticResult> result = solveStatic(*truth, kFolder, settings);
  EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().detail);
  EXPECT_TRUE(result->at_rest) << name;
  return *result;
}

TEST(AgainstFiniteElements, BarsWithin2PercentAtAFewHundredParticles) {
  for (const char* load :
       {"cantilever_small", "cantilever_large", "pull", "stretch_150", "torsion", "twist_90", "twist_180"})
    for (const char* nu : {"_nu30", "_nu45"})
      EXPECT_LT(solved(std::string("bar_") + load + nu, 0.0125).error, 0.02) << load << nu;
}

TEST(AgainstFiniteElements, TheIndentedBlockWithin2PercentAt1800Particles) {
  for (const char* nu : {"_nu30", "_nu45"}) {
    const StaticResult result = solved(std::string("block_indent") + nu, 0.05 / 7.0);
    EXPECT_EQ(result.particles, 1800u);
    EXPECT_LT(result.error, 0.02) << nu;
  }
}

TEST(AgainstFiniteElements, TheHangingOrganWithin5Percent) {
  for (const char* nu : {"_nu30", "_nu45"}) EXPECT_LT(solved(std::string("organ_hang") + nu, 0.008).error, 0.05) << nu;
}

TEST(AgainstFiniteElements, HalfTheSpacingIsNearer) {
  for (const char* name : {"bar_cantilever_large_nu30", "bar_torsion_nu45", "bar_pull_nu45"})
    EXPECT_LT(solved(name, 0.00625).error, 0.6 * solved(name, 0.0125).error) << name;
}

TEST(ReadTruthCase, SaysWhatIsWrong) {
  EXPECT_EQ(readTruthCase("/no/such/file.csv").error().code, ErrorCode::kUnreadable);
}

}  // namespace
}  // namespace meshless::bench
