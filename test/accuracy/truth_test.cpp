// The deformer against the finite-element truth (bench/truth): elastic materials, without calibration.
#include <gtest/gtest.h>

#include <string>

#include "static_load.h"

namespace meshless::bench {
namespace {

const char* const kFolder = TRUTH_FOLDER;

TruthCase truthOf(const std::string& name) {
  const Result<TruthCase> truth = readTruthCase(std::string(kFolder) + "/" + name + ".csv");
  EXPECT_TRUE(truth.ok()) << (truth.ok() ? "" : truth.error().detail);
  return *truth;
}

StaticResult solved(const std::string& name, double spacing) {
  const TruthCase truth = truthOf(name);
  StaticSettings settings;
  settings.spacing = spacing;
  settings.material.youngs_modulus = 1.0;
  const Result<StaticResult> result = solveStatic(truth, kFolder, settings);
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

// What is moved to a place goes there whatever its stiffness: the force alone tells. A bar of four cells across is too
// stiff in twist by a sixth, and by a quarter of that with eight.
TEST(AgainstFiniteElements, TheForceOfStretchAndTheMomentOfTwist) {
  for (const char* nu : {"_nu30", "_nu45"}) {
    const std::string stretch = std::string("bar_stretch_150") + nu;
    EXPECT_NEAR(solved(stretch, 0.0125).end_force.x() / truthOf(stretch).vector("end_force").x(), 1.0, 0.01) << stretch;
    for (const char* angle : {"bar_twist_90", "bar_twist_180"}) {
      const std::string twist = std::string(angle) + nu;
      const double moment = truthOf(twist).number("end_moment_x");
      const double coarse = solved(twist, 0.0125).end_moment / moment,
                   fine = solved(twist, 0.00625).end_moment / moment;
      EXPECT_NEAR(fine, 1.0, 0.05) << twist;
      EXPECT_LT(std::abs(fine - 1.0), 0.4 * std::abs(coarse - 1.0)) << twist;
    }
  }
}

// The sphere touches particles of the top face alone, so that less than the whole face of contact presses: its force is
// too small, by less where the spacing is finer.
TEST(AgainstFiniteElements, TheForceOfTheIndentingSphere) {
  for (const char* nu : {"_nu30", "_nu45"}) {
    const std::string name = std::string("block_indent") + nu;
    const double force = truthOf(name).number("indentation_force");
    const double coarse = solved(name, 0.0125).contact_force / force,
                 fine = solved(name, 0.05 / 7.0).contact_force / force;
    EXPECT_GT(fine, 0.89) << nu;
    EXPECT_LT(fine, 1.0) << nu;
    EXPECT_LT(1.0 - fine, 0.6 * (1.0 - coarse)) << nu;
  }
}

TEST(AgainstFiniteElements, TheHangingOrganWithin5Percent) {
  for (const char* nu : {"_nu30", "_nu45"}) EXPECT_LT(solved(std::string("organ_hang") + nu, 0.008).error, 0.05) << nu;
}

// Cells that the surface crosses are as stiff as what fills them.
TEST(AgainstFiniteElements, TheHangingOrganOfFilledCellsWithin3PercentAt1181Particles) {
  const StaticResult soft = solved("organ_hang_nu30", 0.0104);
  EXPECT_EQ(soft.particles, 1181u);
  EXPECT_LT(soft.error, 0.015);
  EXPECT_LT(solved("organ_hang_nu45", 0.0104).error, 0.025);
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
