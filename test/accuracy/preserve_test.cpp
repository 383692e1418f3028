#include "laws.h"

#include <gtest/gtest.h>

namespace meshless {
namespace {

using bench::squeeze;
using bench::Squeezed;

Material appearance() {
  Material material;
  material.alpha = 0.8;
  material.damping = 5.0;
  return material;
}

TEST(ResponseCurve, IsLinearBetweenItsPointsAndConstantBeyond) {
  const ResponseCurve curve{{{0.1, 0.2}, {0.3, 0.6}}};
  EXPECT_EQ(curve.at(0.0), 0.2);
  EXPECT_NEAR(curve.at(0.2), 0.4, 1e-15);
  EXPECT_EQ(curve.at(5.0), 0.6);
  EXPECT_EQ(ResponseCurve().at(1.0), 0.0);
}

TEST(ResponseCurve, MustBeMonotone) {
  const auto refused = [](const ResponseCurve& curve, const std::string& word) {
    Material material;
    material.area = curve;
    const Status status = material.validate();
    ASSERT_FALSE(status.ok()) << word;
    EXPECT_NE(status.error().detail.find(word), std::string::npos) << status.error().detail;
  };
  refused({{{0.0, 0.5}, {0.1, 0.4}}}, "area[1][1] is 0.4; accepted: 0.5 to 1");
  refused({{{0.1, 0.5}, {0.1, 0.6}}}, "area[1][0] is 0.1");
  refused({{{-0.1, 0.5}}}, "area[0][0] is -0.1");
  refused({{{0.0, 1.5}}}, "area[0][1] is 1.5");
  refused({{{0.0, std::nan("")}}}, "nan");
}

TEST(Preserve, AStiffCurveHoldsTheVolumeOfASqueezedCubeALaxOneLiesBetween) {
  Material material = appearance();
  const Squeezed off = squeeze(material);
  EXPECT_LT(off.volume, 0.9);
  EXPECT_EQ(off.gradients, 0u) << "nothing is formed that no material asks for";
  material.volume.points = {{0.0, 1.0}};
  const Squeezed stiff = squeeze(material);
  EXPECT_NEAR(stiff.volume, 1.0, 0.005);
  EXPECT_LT(stiff.speed, 0.01) << "comes to rest";
  EXPECT_GT(stiff.gradients, 0u);
  material.volume.points = {{0.0, 0.0}, {0.1, 0.0}, {0.3, 0.3}};
  const Squeezed lax = squeeze(material);
  EXPECT_GT(lax.volume, off.volume + 0.01);
  EXPECT_LT(lax.volume, stiff.volume - 0.01);
}

TEST(Preserve, TheSameForAMaterialForAccuracy) {
  Material material;
  material.youngs_modulus = 500.0;
  material.poissons_ratio = 0.1;
  material.damping = 5.0;
  const double off = squeeze(material).volume;
  EXPECT_LT(off, 0.9);
  material.volume.points = {{0.0, 1.0}};
  const Squeezed stiff = squeeze(material);
  EXPECT_NEAR(stiff.volume, 1.0, 0.005);
}

TEST(Preserve, AreaIsHeldNearerByACurve) {
  Material material = appearance();
  const double off = squeeze(material).area;
  material.area.points = {{0.0, 1.0}};
  const Squeezed held = squeeze(material);
  EXPECT_LT(std::abs(held.area - 1.0), 0.2 * std::abs(off - 1.0));
}

}  // namespace
}  // namespace meshless
