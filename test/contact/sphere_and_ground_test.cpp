#include "meshless_surgery/contact/sphere_and_ground.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace meshless {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(Ground, PutsPointsBelowOntoThePlane) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> any(-2.0, 2.0);
  int below = 0;
  for (int k = 0; k < 1000; ++k) {
    const Vec3 p(any(random), any(random), any(random));
    const double height = any(random);
    const Projection projection = projectOutOfGround(p, height);
    EXPECT_EQ(projection.inside, p.z() < height);
    EXPECT_EQ(projection.normal, Vec3(0, 0, 1));
    if (!projection.inside) {
      EXPECT_EQ(projection.depth, 0.0);
      continue;
    }
    ++below;
    const Vec3 out = p + projection.depth * projection.normal;
    EXPECT_NEAR(out.z(), height, 1e-15);
    EXPECT_EQ(out.head<2>(), p.head<2>());
  }
  EXPECT_GT(below, 300);
}

TEST(Ground, APointOnThePlaneIsOutside) { EXPECT_FALSE(projectOutOfGround(Vec3(1, 2, 0.5), 0.5).inside); }

TEST(Ground, NanIsNotInside) {
  EXPECT_FALSE(projectOutOfGround(Vec3(0, 0, kNan), 0.0).inside);
  EXPECT_FALSE(projectOutOfGround(Vec3(0, 0, -1), kNan).inside);
}

TEST(Sphere, PutsPointsInsideOntoTheSphereAlongTheRadius) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  int inside = 0;
  for (const double scale : {1e-3, 1.0, 1e3})
    for (int k = 0; k < 500; ++k) {
      const Vec3 centre = scale * Vec3(3, -2, 1);
      const Vec3 p = centre + scale * Vec3(any(random), any(random), any(random));
      const double radius = 0.8 * scale;
      const Projection projection = projectOutOfSphere(p, centre, radius, Vec3::UnitX());
      EXPECT_EQ(projection.inside, (p - centre).norm() < radius);
      if (!projection.inside) continue;
      ++inside;
      EXPECT_NEAR(projection.normal.norm(), 1.0, 1e-14);
      EXPECT_GT(projection.normal.dot(p - centre), 0.0);
      EXPECT_NEAR((p + projection.depth * projection.normal - centre).norm(), radius, 1e-13 * scale);
    }
  EXPECT_GT(inside, 300);
}

TEST(Sphere, TheCentreLeavesAlongTheFallback) {
  const Vec3 fallback = Vec3(1, 2, -2) / 3.0;
  const Vec3 centre(0.1, 0.2, 0.3);
  const Projection projection = projectOutOfSphere(centre, centre, 0.05, fallback);
  EXPECT_TRUE(projection.inside);
  EXPECT_EQ(projection.normal, fallback);
  EXPECT_DOUBLE_EQ(projection.depth, 0.05);
}

TEST(Sphere, NothingIsInsideOfNoSphere) {
  EXPECT_FALSE(projectOutOfSphere(Vec3::Zero(), Vec3::Zero(), 0.0, Vec3::UnitZ()).inside);
  EXPECT_FALSE(projectOutOfSphere(Vec3::Zero(), Vec3::Zero(), -1.0, Vec3::UnitZ()).inside);
  EXPECT_FALSE(projectOutOfSphere(Vec3::Zero(), Vec3::Zero(), kNan, Vec3::UnitZ()).inside);
  EXPECT_FALSE(projectOutOfSphere(Vec3(kNan, 0, 0), Vec3::Zero(), 1.0, Vec3::UnitZ()).inside);
}

TEST(Friction, StopsASmallSlideAndShortensALargeOne) {
  const Vec3 normal = Vec3::UnitZ();
  EXPECT_TRUE(frictionCorrection(Vec3(0.001, 0, -0.5), normal, 0.01, 0.5).isApprox(Vec3(-0.001, 0, 0), 1e-14));
  const Vec3 slide = frictionCorrection(Vec3(0.3, 0.4, -0.5), normal, 0.01, 0.5);
  EXPECT_NEAR(slide.norm(), 0.005, 1e-16);
  EXPECT_TRUE(slide.isApprox(-0.005 * Vec3(0.6, 0.8, 0), 1e-12));
}

TEST(Friction, NeverLeavesTheConeNorTurnsTheSlideRound) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (int k = 0; k < 1000; ++k) {
    const Vec3 motion(any(random), any(random), any(random));
    const Vec3 normal = Vec3(any(random), any(random), any(random)).normalized();
    const double depth = std::abs(any(random)), friction = 2.0 * std::abs(any(random));
    const Vec3 correction = frictionCorrection(motion, normal, depth, friction);
    const Vec3 tangential = motion - normal.dot(motion) * normal;
    EXPECT_NEAR(correction.dot(normal), 0.0, 1e-15);
    EXPECT_LE(correction.norm(), friction * depth * (1 + 1e-14));
    EXPECT_GE((tangential + correction).dot(tangential), -1e-15);
    EXPECT_LE((tangential + correction).norm(), tangential.norm());
  }
}

TEST(Friction, NothingWithoutDepthFrictionOrMotion) {
  const Vec3 n = Vec3::UnitZ();
  EXPECT_EQ(frictionCorrection(Vec3(1, 0, 0), n, 0.0, 0.5), Vec3(0, 0, 0));
  EXPECT_EQ(frictionCorrection(Vec3(1, 0, 0), n, 0.1, 0.0), Vec3(0, 0, 0));
  EXPECT_EQ(frictionCorrection(Vec3(0, 0, 1), n, 0.1, 0.5), Vec3(0, 0, 0));
  EXPECT_EQ(frictionCorrection(Vec3(kNan, 0, 0), n, 0.1, 0.5), Vec3(0, 0, 0));
  EXPECT_EQ(frictionCorrection(Vec3(1, 0, 0), n, kNan, 0.5), Vec3(0, 0, 0));
}

}  // namespace
}  // namespace meshless
