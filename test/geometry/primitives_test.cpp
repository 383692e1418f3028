#include "meshless_surgery/geometry/mesh/primitives.h"

#include <cmath>
#include <limits>
#include <map>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/shapes.h"

namespace meshless {
namespace primitives_test {

constexpr double kPi = 3.14159265358979323846;

/// Every directed edge has exactly one opposite: closed, oriented, manifold along edges.
void expectClosed(const TriangleMesh& mesh, const std::string& name) {
  ASSERT_FALSE(mesh.empty()) << name;
  std::map<std::pair<Index, Index>, int> edges;
  std::vector<int> used(mesh.vertices.size(), 0);
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k) {
      ASSERT_LT(t[k], mesh.vertices.size()) << name;
      ++used[t[k]];
      ++edges[{t[k], t[(k + 1) % 3]}];
    }
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1) << name;
    EXPECT_EQ(edges.count({edge.second, edge.first}), 1u) << name;
  }
  for (const int count : used) EXPECT_GT(count, 0) << name << ": a vertex that no triangle uses";
}

double worstAspect(const TriangleMesh& mesh) {
  double worst = 0.0;
  for (const Triangle& t : mesh.triangles) {
    const Vec3 a = mesh.vertices[t[1]] - mesh.vertices[t[0]], b = mesh.vertices[t[2]] - mesh.vertices[t[0]];
    const double longest = std::max({a.norm(), b.norm(), (a - b).norm()});
    worst = std::max(worst, longest * longest / a.cross(b).norm());
  }
  return worst;
}

TEST(Primitives, AllAreClosedAndPointOutwards) {
  for (const double edge : {0.5, 0.05, 0.021}) {
    const std::vector<shapes::Shape> all = {{"box", boxMesh(Vec3(0.3, 0.2, 0.1), edge)},
                                            {"sphere", sphereMesh(0.1, edge)},
                                            {"cylinder", cylinderMesh(0.3, 0.1, edge)},
                                            {"torus", torusMesh(0.2, 0.06, edge)}};
    for (const auto& [name, mesh] : all) {
      expectClosed(mesh, name);
      EXPECT_GT(signedVolume(mesh), 0.0) << name;
      EXPECT_LT(solidCentroid(mesh).norm(), 1e-12) << name;
    }
  }
}

TEST(Primitives, TheFixturesOfTheLawsAreClosed) {
  for (const auto& [name, mesh] : shapes::simpleShapes()) {
    expectClosed(mesh, name);
    EXPECT_GT(signedVolume(mesh), 0.0) << name;
  }
}

TEST(Primitives, BoxHasItsExactVolumeAndSize) {
  const TriangleMesh box = boxMesh(Vec3(0.3, 0.2, 0.1), 3, 4, 5);
  EXPECT_NEAR(signedVolume(box), 0.006, 1e-15);
  EXPECT_NEAR(surfaceArea(box), 0.22, 1e-14);
  EXPECT_EQ(box.triangles.size(), 4u * (12 + 20 + 15));
  EXPECT_EQ(boundsOf(box.vertices).max, Vec3(0.15, 0.1, 0.05));
  EXPECT_EQ(boundsOf(box.vertices).min, Vec3(-0.15, -0.1, -0.05));
}

TEST(Primitives, SphereConvergesWithTheSquareOfTheEdge) {
  const double exact = 4.0 / 3.0 * kPi * 0.001;
  const double coarse = exact - signedVolume(sphereMesh(0.1, 0.04)), fine = exact - signedVolume(sphereMesh(0.1, 0.02));
  EXPECT_GT(fine, 0.0);
  EXPECT_NEAR(coarse / fine, 4.0, 1.2);
  for (const Vec3& p : sphereMesh(0.1, 0.013).vertices) EXPECT_NEAR(p.norm(), 0.1, 1e-15);
}

TEST(Primitives, CylinderAndTorusApproachTheirVolume) {
  EXPECT_NEAR(signedVolume(cylinderMesh(0.3, 0.05, 0.005)) / (kPi * 0.0025 * 0.3), 1.0, 0.003);
  EXPECT_NEAR(signedVolume(torusMesh(0.1, 0.03, 0.004)) / (2.0 * kPi * kPi * 0.1 * 0.0009), 1.0, 0.01);
}

TEST(Primitives, EdgesAreAsLongAsAskedAndTrianglesWellShaped) {
  const double edge = 0.01;
  const std::vector<shapes::Shape> all = {{"box", boxMesh(Vec3(0.1, 0.2, 0.05), edge)},
                                          {"sphere", sphereMesh(0.1, edge)},
                                          {"cylinder", cylinderMesh(0.2, 0.05, edge)},
                                          {"torus", torusMesh(0.1, 0.04, edge)}};
  for (const auto& [name, mesh] : all) {
    EXPECT_NEAR(meanEdgeLength(mesh), edge, 0.3 * edge) << name;
    EXPECT_LT(worstAspect(mesh), 4.0) << name;  // 1.15 is equilateral, 2 half a square
  }
}

TEST(Primitives, NothingForSizesThatAreNotPositive) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {0.0, -1.0, nan, infinity}) {
    EXPECT_TRUE(boxMesh(Vec3(bad, 1, 1), 0.1).empty());
    EXPECT_TRUE(boxMesh(Vec3(1, bad, 1), 2, 2, 2).empty());
    EXPECT_TRUE(boxMesh(Vec3(1, 1, 1), bad).empty());
    EXPECT_TRUE(sphereMesh(bad, 0.1).empty());
    EXPECT_TRUE(sphereMesh(1, bad).empty());
    EXPECT_TRUE(cylinderMesh(bad, 1, 0.1).empty());
    EXPECT_TRUE(cylinderMesh(1, bad, 0.1).empty());
    EXPECT_TRUE(torusMesh(1, bad, 0.1).empty());
  }
  EXPECT_TRUE(boxMesh(Vec3(1, 1, 1), 0, 2, 2).empty());
  EXPECT_TRUE(torusMesh(0.1, 0.1, 0.02).empty());
}

}  // namespace primitives_test
}  // namespace meshless
