#include "meshless_surgery/body/preserve.h"

#include "meshless_surgery/geometry/measures.h"
#include "support/bodies.h"

namespace meshless {
namespace {

struct Squeezed {
  double volume, area;  // relative to rest
  double speed;         // [m/s] of the fastest particle at the end
  std::size_t gradients;
};

// A cube pressed to 60 % of its height between two plates that are slippery, for three seconds.
Squeezed squeeze(const Material& material) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.1, 0.1, 0.1), 6, 6, 6));
  def.spacing = 0.02;
  def.material = material;
  const PreparedBody body = test::prepared(def);
  const BodyModel& m = *body.model;
  BodyState state = body.state;
  StepScratch scratch;
  MatchCounters counted;
  PreserveCounters counters;
  const double h = 1.0 / 240.0;
  for (int step = 0; step < 720; ++step) {
    const double half = 0.05 * (1.0 - 0.4 * std::min(1.0, step / 120.0));
    matchAndMove(m, material, Vec3::Zero(), h, state, scratch, counted);
    scratch.touched.clear();
    scratch.before_contact = state.positions;
    for (Index i = 0; i < m.rest.size(); ++i) {
      double& z = state.positions[i].z();
      if (std::abs(z) <= half) continue;
      const double side = z > 0 ? 1.0 : -1.0;
      z = side * half;
      scratch.touched.push_back({i, Vec3(0, 0, -side), 0.0});
    }
    preserve(m, material, state, scratch, counters);
    velocitiesFromPositions(m, h, state, scratch);
  }
  updateSurface(m, state);
  Squeezed result{signedVolume(state.surface, m.surface.triangles) / m.rest_volume,
                  surfaceArea(state.surface, m.surface.triangles) / m.rest_area, 0.0, counters.gradients};
  for (const Vec3& v : state.velocities) result.speed = std::max(result.speed, v.norm());
  return result;
}

Material looks() {
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
  Material material = looks();
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
  Material material = looks();
  const double off = squeeze(material).area;
  material.area.points = {{0.0, 1.0}};
  const Squeezed held = squeeze(material);
  EXPECT_LT(std::abs(held.area - 1.0), 0.2 * std::abs(off - 1.0));
}

}  // namespace
}  // namespace meshless
