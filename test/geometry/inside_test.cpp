#include "meshless_surgery/geometry/query/inside.h"

#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/shapes.h"

namespace meshless {
namespace inside_test {

Points randomPoints(const Box& box, std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-0.1, 1.1);
  Points points;
  for (std::size_t k = 0; k < count; ++k)
    points.push_back(box.min + Vec3(unit(random), unit(random), unit(random)).cwiseProduct(box.max - box.min));
  return points;
}

/// The plain sum of solid angles over all triangles, in turns.
double windingNumber(const TriangleMesh& mesh, const Vec3& p) {
  double sum = 0.0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3 a = mesh.vertices[t[0]] - p, b = mesh.vertices[t[1]] - p, c = mesh.vertices[t[2]] - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    sum += 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (4.0 * 3.14159265358979323846);
}

TEST(Inside, AgreesWithTheWindingNumberOnEveryShape) {
  for (const auto& [name, mesh] : shapes::allShapes()) {
    const SolidQuery query(mesh);
    int inside = 0;
    for (const Vec3& p : randomPoints(boundsOf(mesh.vertices), 300, 7)) {
      const bool expected = windingNumber(mesh, p) > 0.5;
      EXPECT_EQ(query.contains(p), expected) << name << " at " << p.transpose();
      inside += expected;
    }
    EXPECT_GT(inside, 10) << name;
  }
}

TEST(Inside, VolumeByCountingMatchesTheMeasure) {
  const TriangleMesh torus = torusMesh(0.1, 0.03, 0.01);
  const SolidQuery query(torus);
  const Box box = boundsOf(torus.vertices);
  std::size_t inside = 0;
  const Points points = randomPoints(box, 20000, 3);
  for (const Vec3& p : points) inside += query.contains(p);
  const double sampled = 1.2 * 1.2 * 1.2 * (box.max - box.min).prod();  // the points' box is larger by 0.1 on each side
  EXPECT_NEAR(sampled * static_cast<double>(inside) / static_cast<double>(points.size()), signedVolume(torus),
              0.03 * signedVolume(torus));
}

TEST(Inside, HoldsAtLatticePointsThatLineUpWithFacesAndEdges) {
  const TriangleMesh box = boxMesh(Vec3(0.2, 0.2, 0.2), 4, 4, 4);
  const SolidQuery query(box);
  for (int i = -5; i <= 5; ++i)
    for (int j = -5; j <= 5; ++j)
      for (int k = -5; k <= 5; ++k) {
        if (std::max({std::abs(i), std::abs(j), std::abs(k)}) == 4) continue;  // on the surface: either is right
        const bool expected = std::max({std::abs(i), std::abs(j), std::abs(k)}) < 4;
        EXPECT_EQ(query.contains(Vec3(i, j, k) * 0.025), expected) << i << " " << j << " " << k;
      }
}

TEST(Inside, CavityIsOutside) {
  const SolidQuery query(shapes::hollowSphere());
  EXPECT_FALSE(query.contains(Vec3::Zero()));
  EXPECT_TRUE(query.contains(Vec3(0.07, 0, 0.01)));
}

TEST(Inside, OverlappingPiecesAreInsideWhereEitherIs) {
  TriangleMesh mesh = sphereMesh(0.1, 0.02);
  shapes::append(mesh, sphereMesh(0.1, 0.02), Vec3(0.1, 0.003, 0.007));
  const SolidQuery query(mesh);
  EXPECT_TRUE(query.contains(Vec3(-0.05, 0, 0)));
  EXPECT_TRUE(query.contains(Vec3(0.05, 0, 0)));  // parity alone calls this outside
  EXPECT_TRUE(query.contains(Vec3(0.15, 0, 0)));
  EXPECT_FALSE(query.contains(Vec3(0.05, 0.099, 0)));
}

TEST(Inside, DistanceMatchesEveryTriangleTried) {
  const TriangleMesh mesh = shapes::arch();
  const SolidQuery query(mesh);
  // Against a dense sampling of each triangle: never farther, and nearer by at most half the sampling's step.
  for (const Vec3& p : randomPoints(boundsOf(mesh.vertices), 50, 11)) {
    double nearest = 1e300;
    const int n = 60;
    for (const Triangle& t : mesh.triangles)
      for (int i = 0; i <= n; ++i)
        for (int j = 0; i + j <= n; ++j) {
          const Vec3 q = (mesh.vertices[t[0]] * i + mesh.vertices[t[1]] * j + mesh.vertices[t[2]] * (n - i - j)) / n;
          nearest = std::min(nearest, (q - p).norm());
        }
    EXPECT_LE(query.distance(p), nearest + 1e-12);
    EXPECT_GE(query.distance(p), nearest - 0.003);
  }
  const SolidQuery sphere(sphereMesh(0.1, 0.005));
  EXPECT_NEAR(sphere.distance(Vec3(0.03, 0.04, 0)), 0.05, 1e-4);
  EXPECT_NEAR(sphere.distance(Vec3(0.3, 0.4, 0)), 0.4, 1e-4);
}

TEST(Inside, SegmentsCrossWhereTheirEndsAreOnDifferentSides) {
  for (const auto& [name, mesh] : shapes::allShapes()) {
    const SolidQuery query(mesh);
    const Points points = randomPoints(boundsOf(mesh.vertices), 400, 5);
    int differing = 0;
    for (std::size_t k = 0; k + 1 < points.size(); ++k) {
      if (query.contains(points[k]) == query.contains(points[k + 1])) continue;
      ++differing;
      EXPECT_TRUE(query.crosses(points[k], points[k + 1])) << name;
      EXPECT_TRUE(query.crosses(points[k + 1], points[k])) << name;
    }
    EXPECT_GT(differing, 5) << name;
  }
}

TEST(Inside, SegmentsInsideAConvexBodyDoNotCross) {
  const TriangleMesh box = boxMesh(Vec3(0.2, 0.2, 0.2), 4, 4, 4);
  const SolidQuery query(box);
  // Between surface vertices: through the inside, along edges and within faces.
  for (std::size_t i = 0; i < box.vertices.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) EXPECT_FALSE(query.crosses(box.vertices[i], box.vertices[j])) << i << " " << j;
}

TEST(Inside, SegmentsAcrossAGapCross) {
  const SolidQuery query(shapes::arch());
  EXPECT_TRUE(query.crosses(Vec3(-0.075, 0, 0.02), Vec3(0.075, 0, 0.02)));   // leg to leg
  EXPECT_FALSE(query.crosses(Vec3(-0.075, 0, 0.1), Vec3(0.075, 0, 0.1)));    // along the beam
  EXPECT_TRUE(query.crosses(Vec3(-0.05, 0, 0.04), Vec3(0.075, 0, 0.04)));    // from one leg's surface
  EXPECT_FALSE(query.crosses(Vec3(-0.05, 0, 0.04), Vec3(0.05, 0, 0.04)));    // surface to surface through the air
  EXPECT_FALSE(query.crosses(Vec3(-0.0501, 0, 0.04), Vec3(-0.08, 0, 0.04)));
}

TEST(Inside, SegmentThroughASharedEdgeOrVertexCrosses) {
  const SolidQuery query(boxMesh(Vec3(0.2, 0.2, 0.2), 2, 2, 2));
  EXPECT_TRUE(query.crosses(Vec3(0, 0, 0.2), Vec3(0, 0, 0)));        // through a vertex
  EXPECT_TRUE(query.crosses(Vec3(0.05, 0, 0.2), Vec3(0.05, 0, 0)));  // through an edge
  EXPECT_TRUE(query.crosses(Vec3(0.05, 0.05, 0.2), Vec3(0.05, 0.05, 0)));
}

TEST(Inside, AcceptsWhatIsNoSolid) {
  const SolidQuery nothing((TriangleMesh()));
  EXPECT_FALSE(nothing.contains(Vec3::Zero()));
  EXPECT_FALSE(nothing.crosses(Vec3::Zero(), Vec3::Ones()));
  EXPECT_TRUE(std::isinf(nothing.distance(Vec3::Zero())));

  TriangleMesh open = sphereMesh(0.1, 0.02);
  open.triangles.resize(open.triangles.size() - 3);
  const SolidQuery query(open);
  EXPECT_TRUE(query.contains(Vec3::Zero()));
  EXPECT_FALSE(query.contains(Vec3(0.2, 0, 0)));

  TriangleMesh broken = sphereMesh(0.1, 0.02);
  broken.triangles.push_back({0, 1, 100000});
  broken.vertices[0].x() = std::numeric_limits<double>::quiet_NaN();
  broken.triangles.push_back({3, 3, 3});
  const SolidQuery tolerant(broken);
  EXPECT_TRUE(tolerant.contains(Vec3::Zero()));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(tolerant.contains(Vec3(nan, 0, 0)));
  EXPECT_FALSE(tolerant.crosses(Vec3(nan, 0, 0), Vec3(0, 0, 1)));
}

TEST(Inside, RealLiverThatCrossesItselfHasASensibleInside) {
  const TriangleMesh liver = shapes::realMesh("liver-smooth.obj");
  if (liver.empty()) GTEST_SKIP() << "no real meshes beside the checkout";
  const SolidQuery query(liver);
  for (const Vec3& p : randomPoints(boundsOf(liver.vertices), 500, 2))
    EXPECT_EQ(query.contains(p), windingNumber(liver, p) > 0.5);
}

}  // namespace inside_test
}  // namespace meshless
