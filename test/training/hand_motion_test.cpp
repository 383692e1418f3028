#include "meshless_surgery/training/hand_motion.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/training/frame.h"
#include "support/bodies.h"

namespace meshless {
namespace hand_motion_test {

constexpr double kStep = 1.0 / 120.0;

TEST(HandMotion, WhereItComesBackIsNoWay) {
  HandMotion hand;
  hand.feed(Vec3(0, 0, 0), {}, kStep);
  hand.feed(Vec3(0.01, 0, 0), {}, kStep);
  hand.feed({}, {}, kStep);
  hand.feed(Vec3(1, 0, 0), {}, kStep);
  hand.feed(Vec3(1, 0.02, 0), {}, kStep);
  EXPECT_NEAR(0.03, hand.path(), 1e-12);
  EXPECT_NEAR(1.0, hand.economy(), 1e-12);
}

TEST(HandMotion, TurnsAddUp) {
  HandMotion hand;
  for (int k = 0; k <= 100; ++k)
    hand.feed(Vec3::Zero(), Quat(Eigen::AngleAxisd(0.01 * (k <= 60 ? k : 120 - k), Vec3::UnitY())), kStep);
  EXPECT_NEAR(1.0, hand.angularPath(), 1e-6);
  EXPECT_EQ(0.0, hand.path());
  EXPECT_TRUE(std::isnan(hand.economy()));
  EXPECT_EQ(0u, hand.movements());
}

TEST(HandMotion, TheWorkspaceOfABallIsItsVolume) {
  HandMotion hand;
  for (int i = -20; i <= 20; ++i)
    for (int j = -20; j <= 20; ++j)
      for (int k = -20; k <= 20; ++k)
        if (i * i + j * j + k * k <= 400) hand.feed(Vec3(3.0 + 0.005 * i, 0.005 * j, 0.005 * k), {}, kStep);
  EXPECT_NEAR(4.0 / 3.0 * M_PI * 1e-3, hand.workspace(), 0.02 * 4.2e-3);
}

TEST(HandMotion, ARestIsNoMovementAndAStreamOfThirtyHertzIsOne) {
  HandMotion hand;
  for (int k = 0; k < 240; ++k) hand.feed(Vec3(0.0004 * k * kStep, 0, 0), {}, kStep);  // a drift of 0.4 mm/s
  EXPECT_EQ(0u, hand.movements());
  for (int k = 0; k < 240; ++k) hand.feed(Vec3(0.0008 + 0.05 * (k / 4 * 4) * kStep, 0, 0), {}, kStep);
  EXPECT_EQ(1u, hand.movements());
  EXPECT_TRUE(hand.moves());
}

TEST(StrainOf, AStretchedBodyIsThatStretch) {
  for (const bool elastic : {false, true}) {
    BodyDef def = test::block();
    if (elastic) def.material.youngs_modulus = 1e4;
    const PreparedBody body = test::prepared(def);
    Points stretched = body.state.positions;
    const Quat turn(Eigen::AngleAxisd(0.7, Vec3(0.2, 0.4, 0.9).normalized()));
    for (Vec3& p : stretched) p = turn * Vec3(1.1 * p.x(), p.y(), 0.95 * p.z());
    const std::vector<double> strains = strainsOf(*body.model, stretched);
    EXPECT_EQ(tissueParts(*body.model), strains.size());
    for (const double strain : strains) EXPECT_TRUE(strain == 0.0 || std::abs(strain - 0.1) < 1e-6) << strain;
    EXPECT_NEAR(0.1, *std::max_element(strains.begin(), strains.end()), 1e-6);
    for (const double strain : strainsOf(*body.model, body.state.positions)) EXPECT_NEAR(0.0, strain, 1e-6);
  }
}

}  // namespace hand_motion_test
}  // namespace meshless
