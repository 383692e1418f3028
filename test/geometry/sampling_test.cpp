#include "shapes/sampling.h"

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/shapes.h"

namespace meshless {
namespace sampling_test {

TEST(Sampling, EveryPointIsInsideAndClear) {
  for (const auto& [name, mesh] : shapes::allShapes()) {
    const SolidQuery query(mesh);
    const double spacing = std::cbrt(signedVolume(mesh) / 2000.0);
    for (const double clearance : {0.0, 0.3 * spacing}) {
      const LatticeSample sample = sampleInterior(mesh, query, spacing, clearance);
      EXPECT_EQ(sample.spacing_used, spacing) << name;
      for (const Vec3& p : sample.points) {
        EXPECT_TRUE(query.contains(p)) << name;
        EXPECT_GE(query.distance(p), clearance) << name;
      }
    }
  }
}

TEST(Sampling, MissesNoPointOfTheLattice) {
  for (const auto& [name, mesh] : shapes::allShapes()) {
    const SolidQuery query(mesh);
    const double spacing = std::cbrt(signedVolume(mesh) / 1000.0), clearance = 0.25 * spacing;
    const LatticeSample sample = sampleInterior(mesh, query, spacing, clearance);
    // One by one, without the shortcut along lines.
    const Box box = boundsOf(mesh.vertices);
    std::size_t expected = 0;
    const auto reach = [&](int axis) { return static_cast<int>((box.max - box.min)[axis] / 2.0 / spacing) + 1; };
    for (int i = -reach(0); i <= reach(0); ++i)
      for (int j = -reach(1); j <= reach(1); ++j)
        for (int k = -reach(2); k <= reach(2); ++k) {
          const Vec3 p = 0.5 * (box.min + box.max) + spacing * Vec3(i, j, k);
          expected += query.contains(p) && query.distance(p) >= clearance;
        }
    EXPECT_EQ(sample.points.size(), expected) << name;
  }
}

TEST(Sampling, PointsTimesCellsIsTheVolume) {
  const TriangleMesh sphere = sphereMesh(0.1, 0.01);
  const LatticeSample sample = sampleInterior(sphere, SolidQuery(sphere), 0.01, 0.0);
  EXPECT_NEAR(static_cast<double>(sample.points.size()) * 1e-6, signedVolume(sphere), 0.05 * signedVolume(sphere));
}

TEST(Sampling, SymmetricBodiesGetSymmetricPoints) {
  const TriangleMesh box = boxMesh(Vec3(0.2, 0.1, 0.05), 4, 4, 4);
  const LatticeSample sample = sampleInterior(box, SolidQuery(box), 0.013, 0.004);
  ASSERT_FALSE(sample.points.empty());
  EXPECT_EQ(sample.points.size() % 2, 1u);
  for (const Vec3& p : sample.points)
    EXPECT_NE(std::find(sample.points.begin(), sample.points.end(), Vec3(-p)), sample.points.end());
}

TEST(Sampling, WidensTheSpacingUntilThePointsFit) {
  for (const auto& [name, mesh] : shapes::allShapes()) {
    const double spacing = std::cbrt(signedVolume(mesh) / 1e6);
    const LatticeSample sample = sampleInterior(mesh, SolidQuery(mesh), spacing, 0.0, 500);
    EXPECT_LE(sample.points.size(), 500u) << name;
    EXPECT_GE(sample.points.size(), 60u) << name;
    EXPECT_GT(sample.spacing_used, spacing) << name;
  }
}

TEST(Sampling, AThinBodyMayHaveNoPoint) {
  const TriangleMesh slab = boxMesh(Vec3(0.2, 0.2, 0.002), 4, 4, 1);
  EXPECT_TRUE(sampleInterior(slab, SolidQuery(slab), 0.01, 0.005).points.empty());
}

TEST(Sampling, NothingForASpacingThatIsNotPositive) {
  const TriangleMesh box = boxMesh(Vec3(1, 1, 1), 2, 2, 2);
  const SolidQuery query(box);
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {0.0, -1.0, nan, infinity}) EXPECT_TRUE(sampleInterior(box, query, bad, 0.0).points.empty());
  for (const double bad : {-1.0, nan}) EXPECT_TRUE(sampleInterior(box, query, 0.1, bad).points.empty());
  EXPECT_TRUE(sampleInterior(TriangleMesh(), SolidQuery(TriangleMesh()), 0.1, 0.0).points.empty());
  EXPECT_TRUE(sampleInterior(box, query, 0.1, 0.0, 0).points.empty());
}

}  // namespace sampling_test
}  // namespace meshless
