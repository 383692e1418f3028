// Bodies under tools, at the defaults, through World::step, against CalculiX.
#include "tool_load.h"

#include <cmath>

#include <gtest/gtest.h>

namespace meshless::bench {
namespace {

ToolResult pressed(const std::string& name, double finer) {
  const Result<TruthCase> truth = readTruthCase(std::string(CALCULIX_FOLDER) + "/" + name + ".csv");
  EXPECT_TRUE(truth.ok()) << (truth.ok() ? "" : truth.error().detail);
  const Result<ToolResult> result = press(*truth, {finer, 0.0, 0.0});
  EXPECT_TRUE(result.ok()) << (result.ok() ? "" : result.error().detail);
  return *result;
}

// What cells are too coarse to show of the dent is in the force, and not in the surface.
TEST(Tools, TheSpheresForceIsRightWhereItsDentIsShownToATenth) {
  for (const double finer : {1.0, 1.26}) {
    const ToolResult result = pressed("press_3_nu30", finer);
    EXPECT_NEAR(result.tip, 1.0, 0.12) << finer;
    EXPECT_NEAR(result.ratio, 1.0, 0.05) << finer;
  }
}

// Wherever the sphere comes down and however fine the surface is, with half a cell to one and a half in the radius of
// the contact (docs/accuracy.md#where-the-sphere-presses).
TEST(Tools, TheForceOfTheSphereDoesNotDependOnThePlace) {
  for (const char* name : {CALCULIX_FOLDER "/press_1_nu45", TRUTH_FOLDER "/block_press_3_nu45",
                           TRUTH_FOLDER "/cylinder_press_1_nu45", TRUTH_FOLDER "/cylinder_press_4_nu45"}) {
    const Result<TruthCase> truth = readTruthCase(std::string(name) + ".csv");
    ASSERT_TRUE(truth.ok()) << truth.error().detail;
    const double contact = std::sqrt(truth->number("sphere_radius") * truth->number("sphere_depth"));
    for (const double finer : {1.0, 1.26})
      for (const double edge : {0.0, 0.005})
        for (const Vec3& beside : {Vec3(0, 0, 0), Vec3(0.003, 0.002, 0), Vec3(0.006, 0.006, 0)}) {
          const Result<ToolResult> result = press(*truth, {finer, 0.0, edge, beside});
          ASSERT_TRUE(result.ok()) << result.error().detail;
          const double cells = contact / result->spacing;
          EXPECT_NEAR(result->ratio, 1.0, 0.15)
              << name << ", " << cells << " cells, edge " << edge << ", beside " << beside.transpose();
        }
  }
}

// On a plane of the lattice the tip went to the nearest corner: deflections of 0.91 to 1.12, mouths of 0.76 to 1.30.
TEST(Tools, AHalfCutBarOpensAsFarAsTheBladeWentInAPlaneOfTheLatticeToo) {
  for (const char* name : {"half_cut_1", "half_cut_2", "half_cut_3"}) {
    const std::string folder = CALCULIX_FOLDER;
    const Result<TruthCase> truth = readTruthCase(folder + "/" + name + ".csv");
    ASSERT_TRUE(truth.ok()) << truth.error().detail;
    const Result<ToolResult> result = hangIncised(*truth, folder, {1.0, 0.05 / 8.0, 0.0});
    ASSERT_TRUE(result.ok()) << result.error().detail;
    EXPECT_NEAR(result->tip, 1.0, 0.03) << name;
    EXPECT_NEAR(result->ratio, 1.0, 0.06) << name;
  }
}

}  // namespace
}  // namespace meshless::bench
