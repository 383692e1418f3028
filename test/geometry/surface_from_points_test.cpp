#include "meshless_surgery/geometry/surface_from_points.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/inside.h"
#include "meshless_surgery/geometry/measures.h"
#include "meshless_surgery/geometry/mesh_check.h"
#include "support/shapes.h"

namespace meshless {
namespace {

/// `count` points, evenly likely over the area.
Points sampled(const TriangleMesh& mesh, std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<double> sums;
  for (const Triangle& t : mesh.triangles)
    sums.push_back((sums.empty() ? 0.0 : sums.back()) + surfaceArea(mesh.vertices, {t}));
  Points points;
  for (std::size_t k = 0; k < count; ++k) {
    const auto at = std::lower_bound(sums.begin(), sums.end(), unit(random) * sums.back());
    const Triangle& t = mesh.triangles[static_cast<std::size_t>(at - sums.begin())];
    const double root = std::sqrt(unit(random)), b = unit(random);
    points.push_back((1.0 - root) * mesh.vertices[t[0]] + root * (1.0 - b) * mesh.vertices[t[1]] +
                     root * b * mesh.vertices[t[2]]);
  }
  return points;
}

void addNoise(Points& points, double deviation, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, deviation);
  for (Vec3& p : points) p += Vec3(normal(random), normal(random), normal(random));
}

double spacingOf(const TriangleMesh& mesh, std::size_t count) {
  return std::sqrt(surfaceArea(mesh) / static_cast<double>(count));
}

void expectSolid(const SurfaceFromPoints& surface, const std::string& name) {
  const MeshReport report = inspectMesh(surface.mesh);
  EXPECT_TRUE(report.closed()) << name;
  EXPECT_EQ(report.self_intersections, 0u) << name;
  EXPECT_GT(report.signed_volume, 0.0) << name;
  EXPECT_FALSE(surface.method.empty()) << name;
}

void expectTrueDistances(const SurfaceFromPoints& surface, const Points& cloud, const std::string& name) {
  const SolidQuery query(surface.mesh);
  double largest = 0.0, sum = 0.0;
  for (const Vec3& p : cloud) {
    largest = std::max(largest, query.distance(p));
    sum += query.distance(p);
  }
  EXPECT_NEAR(surface.max_distance, largest, 1e-12) << name;
  EXPECT_NEAR(surface.mean_distance, sum / static_cast<double>(cloud.size()), 1e-12) << name;
}

std::vector<shapes::Shape> bodies() {
  return {{"sphere", sphereMesh(0.1, 0.01)},
          {"torus", torusMesh(0.1, 0.03, 0.008)},
          {"turned torus", shapes::moved(torusMesh(0.1, 0.03, 0.008), shapes::anyPose(), 20.0)},
          {"box", boxMesh(Vec3(0.1, 0.1, 0.1), 0.01)},
          {"cylinder", cylinderMesh(0.2, 0.05, 0.01)},
          {"liver", liverMesh()},
          {"kidney", kidneyMesh()},
          {"fish", fishMesh()}};
}

TEST(SurfaceFromPoints, VerticesOfAMeshGiveItsSolidBack) {
  for (const auto& [name, mesh] : bodies()) {
    const Result<SurfaceFromPoints> surface = surfaceFromPoints(mesh.vertices);
    ASSERT_TRUE(surface.ok()) << name << ": " << surface.error().detail;
    expectSolid(*surface, name);
    expectTrueDistances(*surface, mesh.vertices, name);
    EXPECT_EQ(surface->max_distance, 0.0) << name;
    EXPECT_EQ(surface->mesh.vertices.size(), mesh.vertices.size()) << name;
    EXPECT_NEAR(signedVolume(surface->mesh) / signedVolume(mesh), 1.0, 0.01) << name;
  }
}

TEST(SurfaceFromPoints, RandomSamplesAreHeld) {
  for (const auto& [name, mesh] : bodies()) {
    const Points cloud = sampled(mesh, 3000, 2);
    const Result<SurfaceFromPoints> surface = surfaceFromPoints(cloud);
    ASSERT_TRUE(surface.ok()) << name << ": " << surface.error().detail;
    expectSolid(*surface, name);
    expectTrueDistances(*surface, cloud, name);
    EXPECT_LT(surface->max_distance, spacingOf(mesh, cloud.size())) << name;
    EXPECT_NEAR(signedVolume(surface->mesh) / signedVolume(mesh), 1.0, 0.05) << name;
  }
}

TEST(SurfaceFromPoints, NoiseOfATenthOfTheSpacingIsHeld) {
  for (const auto& [name, mesh] : bodies()) {
    Points cloud = mesh.vertices;
    const double spacing = spacingOf(mesh, cloud.size());
    addNoise(cloud, 0.1 * spacing, 4);
    const Result<SurfaceFromPoints> surface = surfaceFromPoints(cloud);
    ASSERT_TRUE(surface.ok()) << name << ": " << surface.error().detail;
    expectSolid(*surface, name);
    EXPECT_LT(surface->max_distance, spacing) << name;
    EXPECT_NEAR(signedVolume(surface->mesh) / signedVolume(mesh), 1.0, 0.03) << name;
  }
}

TEST(SurfaceFromPoints, ThickScatterStillGivesASolid) {
  for (const auto& [name, mesh] : bodies()) {
    for (const double relative : {0.4, 0.8}) {
      Points cloud = sampled(mesh, 3000, 3);
      const double spacing = spacingOf(mesh, cloud.size());
      addNoise(cloud, relative * spacing, 5);
      const Result<SurfaceFromPoints> surface = surfaceFromPoints(cloud);
#if defined(CGAL_VERSION_NR) && CGAL_VERSION_NR < 1050500000
      if (!surface.ok()) continue;  // older CGAL cannot wrap
#endif
      ASSERT_TRUE(surface.ok()) << name << ": " << surface.error().detail;
      expectSolid(*surface, name);
      EXPECT_LT(surface->mean_distance, 2.0 * spacing) << name;
      EXPECT_LT(surface->max_distance, 8.0 * spacing) << name;
      EXPECT_NEAR(signedVolume(surface->mesh) / signedVolume(mesh), 1.0, 0.8) << name << " by " << surface->method;
    }
  }
}

TEST(SurfaceFromPoints, TwoBodiesStayTwo) {
  TriangleMesh pair = sphereMesh(0.05, 0.01);
  shapes::append(pair, boxMesh(Vec3(0.1, 0.1, 0.1), 0.01), Vec3(0.3, 0.0, 0.0));
  Points cloud = pair.vertices;
  addNoise(cloud, 1e-4, 1);
  const Result<SurfaceFromPoints> surface = surfaceFromPoints(cloud);
  ASSERT_TRUE(surface.ok()) << surface.error().detail;
  expectSolid(*surface, "pair");
  EXPECT_EQ(inspectMesh(surface->mesh, false).components, 2u);
}

TEST(SurfaceFromPoints, DuplicatesChangeNothing) {
  const TriangleMesh sphere = sphereMesh(0.1, 0.02);
  Points cloud = sphere.vertices;
  cloud.insert(cloud.end(), sphere.vertices.begin(), sphere.vertices.end());
  const Result<SurfaceFromPoints> once = surfaceFromPoints(sphere.vertices), twice = surfaceFromPoints(cloud);
  ASSERT_TRUE(once.ok() && twice.ok());
  EXPECT_EQ(once->mesh.triangles, twice->mesh.triangles);
  EXPECT_EQ(once->mesh.vertices, twice->mesh.vertices);
}

void expectRepeats(const Points& cloud) {
  const Result<SurfaceFromPoints> first = surfaceFromPoints(cloud), second = surfaceFromPoints(cloud);
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_TRUE(first->mesh.triangles == second->mesh.triangles);
  EXPECT_TRUE(first->mesh.vertices == second->mesh.vertices);
}

// Known fault: CGAL's front still depends on addresses (see the header).
TEST(SurfaceFromPoints, DISABLED_TheSameCloudGivesTheSameSurface) {
  Points cloud = torusMesh(0.1, 0.03, 0.008).vertices;
  expectRepeats(cloud);
  addNoise(cloud, 0.0016, 3);
  expectRepeats(cloud);
  cloud = sampled(liverMesh(), 2000, 9);
  addNoise(cloud, 0.001, 1);
  expectRepeats(cloud);
}

TEST(SurfaceFromPoints, FourPointsAreATetrahedron) {
  const Result<SurfaceFromPoints> surface = surfaceFromPoints(shapes::tetrahedron().vertices);
  ASSERT_TRUE(surface.ok()) << surface.error().detail;
  expectSolid(*surface, "tetrahedron");
}

TEST(SurfaceFromPoints, RefusesWhatEnclosesNothing) {
  const auto refused = [](const Points& cloud, const std::string& message) {
    const Result<SurfaceFromPoints> surface = surfaceFromPoints(cloud);
    ASSERT_FALSE(surface.ok()) << message;
    EXPECT_EQ(surface.error().code, ErrorCode::kUnsuitableShape);
    EXPECT_NE(surface.error().detail.find(message), std::string::npos) << surface.error().detail;
  };
  refused({}, "0 different points");
  refused({Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)}, "3 different points");
  refused(Points(100, Vec3(1, 2, 3)), "1 different points");
  Points plane, line;
  for (int i = 0; i < 20; ++i) {
    line.push_back(shapes::anyPose() * Vec3(0.1 * i, 0, 0));
    for (int j = 0; j < 20; ++j) plane.push_back(shapes::anyPose() * Vec3(0.1 * i, 0.1 * j, 0.0));
  }
  refused(plane, "in a plane");
  refused(line, "in a plane");
  Points bad = sphereMesh(0.1, 0.05).vertices;
  bad[5].z() = std::numeric_limits<double>::quiet_NaN();
  refused(bad, "point 5 is not finite");
}

TEST(SurfaceFromPoints, RealMeshes) {
  const TriangleMesh liver = shapes::realMesh("liver2.obj");
  if (liver.empty()) GTEST_SKIP() << "no real meshes beside the checkout";
  for (const Points& cloud : {liver.vertices, sampled(liver, 4000, 8)}) {
    const Result<SurfaceFromPoints> surface = surfaceFromPoints(cloud);
    ASSERT_TRUE(surface.ok()) << surface.error().detail;
    expectSolid(*surface, "liver2");
    EXPECT_NEAR(signedVolume(surface->mesh) / signedVolume(liver), 1.0, 0.02);
  }
}

}  // namespace
}  // namespace meshless
