#include "meshless_surgery/geometry/mesh/surface_from_points.h"

#include <stdio.h>   // popen
#include <unistd.h>  // readlink

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <random>

#include <CGAL/version.h>
#include <gtest/gtest.h>

#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "support/shapes.h"

namespace meshless {
namespace surface_from_points_test {

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
    EXPECT_LT(surface->max_distance, 1e-15) << name;
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
      const double scatter = relative * spacingOf(mesh, cloud.size());  // [m] standard deviation
      addNoise(cloud, scatter, 5);
      const Result<SurfaceFromPoints> surface = surfaceFromPoints(cloud);
#if CGAL_VERSION_NR < 1050500000
      if (!surface.ok()) continue;  // older CGAL cannot wrap
#endif
      ASSERT_TRUE(surface.ok()) << name << ": " << surface.error().detail;
      expectSolid(*surface, name);
      expectTrueDistances(*surface, cloud, name);
      EXPECT_LT(surface->mean_distance, 1.6 * scatter) << name;
      EXPECT_LT(surface->max_distance, 6.5 * scatter) << name;
      // Through the means it is in the middle of the scatter, a wrapping around nearly all of it: no more than two
      // deviations out, over the whole area. A shell without what is inside would lack far more than half of one.
      const double out = (signedVolume(surface->mesh) - signedVolume(mesh)) / surfaceArea(mesh);
      EXPECT_GT(out, -0.5 * scatter) << name << " by " << surface->method;
      EXPECT_LT(out, 2.0 * scatter) << name << " by " << surface->method;
    }
  }
}

#if CGAL_VERSION_NR >= 1050500000
// A wrapping whose ball fits through the hole is a shell with nothing inside.
TEST(SurfaceFromPoints, AHoleInThickScatterIsSpanned) {
  const TriangleMesh liver = liverMesh();
  const double spacing = spacingOf(liver, liver.vertices.size());
  const double scatter = 0.8 * spacing;
  const Vec3 top = *std::max_element(liver.vertices.begin(), liver.vertices.end(),
                                     [](const Vec3& a, const Vec3& b) { return a.z() < b.z(); });
  for (const double width : {8.0, 12.0}) {  // [spacings]
    Points cloud;
    for (const Vec3& p : liver.vertices)
      if ((p - top).norm() > 0.5 * width * spacing) cloud.push_back(p);
    addNoise(cloud, scatter, 5);
    const Result<SurfaceFromPoints> surface = surfaceFromPoints(cloud);
    ASSERT_TRUE(surface.ok()) << width << ": " << surface.error().detail;
    expectSolid(*surface, "liver");
    EXPECT_EQ(surface->method, "alpha wrapping") << width;
    const double out = (signedVolume(surface->mesh) - signedVolume(liver)) / surfaceArea(liver);
    EXPECT_GT(out, 0.0) << width;
    EXPECT_LT(out, 3.0 * scatter) << width;
  }
}
#endif

TEST(SurfaceFromPoints, PointsBesideItAreNoBodyOfTheirOwn) {
  const TriangleMesh sphere = sphereMesh(0.1, 0.01);
  const double spacing = spacingOf(sphere, sphere.vertices.size());
  Points cloud = sphere.vertices;
  for (const Vec3& p : shapes::tetrahedron().vertices)
    cloud.push_back(Vec3(0.0, 0.0, 0.1 + 2.0 * spacing) + 0.3 * spacing * p);
  const Result<SurfaceFromPoints> surface = surfaceFromPoints(cloud);
  ASSERT_TRUE(surface.ok()) << surface.error().detail;
  expectSolid(*surface, "sphere");
  EXPECT_EQ(inspectMesh(surface->mesh, false).components, 1u) << surface->method;
  EXPECT_NEAR(signedVolume(surface->mesh) / signedVolume(sphere), 1.0, 0.01) << surface->method;
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

struct Cloud {
  std::string name, method;  // the way that gives its surface
  Points points;
};

/// Even and random samples, clean to thick: every way to a surface is taken at least twice.
std::vector<Cloud> repeatedClouds() {
  const auto noisy = [](Points points, double deviation) {
    addNoise(points, deviation, 3);
    return points;
  };
  const TriangleMesh torus = torusMesh(0.1, 0.03, 0.008), sphere = sphereMesh(0.1, 0.01);
  std::vector<Cloud> clouds = {
      {"clean torus", "through the points", torus.vertices},
      {"rough liver", "through the points", noisy(sampled(liverMesh(), 2000, 9), 0.0005)},
      {"rough sphere", "through the points", noisy(sampled(sphere, 3000, 3), 0.0006)},
      {"rough torus", "through the points", noisy(sampled(torus, 3000, 3), 0.0006)},
      {"noisy torus", "through their means", noisy(torus.vertices, 0.0024)},
      {"noisy sphere", "through their means", noisy(sampled(sphere, 3000, 3), 0.0020)},
  };
#if CGAL_VERSION_NR >= 1050500000
  clouds.push_back({"thick torus", "alpha wrapping", noisy(torus.vertices, 0.0064)});
  clouds.push_back({"thick sphere", "alpha wrapping", noisy(sampled(sphere, 2000, 3), 0.006)});
#endif
  return clouds;
}

/// Leaves holes in the heap, so that what is allocated next lies elsewhere and in another order.
class ScatteredHeap {
 public:
  explicit ScatteredHeap(unsigned seed) {
    std::mt19937 random(seed);
    for (unsigned k = 0; k < 5000 + 1000 * (seed % 7); ++k) blocks_.emplace_back(new char[16 + random() % 6000]);
    for (auto& block : blocks_)
      if (random() % 2 == 0) block.reset();
  }

 private:
  std::vector<std::unique_ptr<char[]>> blocks_;
};

TEST(SurfaceFromPoints, TheSameCloudGivesTheSameSurface) {
  unsigned seed = 1;
  for (const Cloud& cloud : repeatedClouds()) {
    const Result<SurfaceFromPoints> first = surfaceFromPoints(cloud.points);
    ASSERT_TRUE(first.ok()) << cloud.name << ": " << first.error().detail;
    EXPECT_NE(first->method.find(cloud.method), std::string::npos) << cloud.name << " by " << first->method;
    for (int repeat = 0; repeat < 2; ++repeat) {
      const ScatteredHeap heap(seed++);
      const Result<SurfaceFromPoints> again = surfaceFromPoints(cloud.points);
      ASSERT_TRUE(again.ok()) << cloud.name;
      EXPECT_TRUE(first->mesh.triangles == again->mesh.triangles) << cloud.name;
      EXPECT_TRUE(first->mesh.vertices == again->mesh.vertices) << cloud.name;
      EXPECT_EQ(first->max_distance, again->max_distance) << cloud.name;
      EXPECT_EQ(first->mean_distance, again->mean_distance) << cloud.name;
      EXPECT_EQ(first->method, again->method) << cloud.name;
    }
  }
}

std::uint64_t fingerprint(const TriangleMesh& mesh) {
  std::uint64_t hash = 14695981039346656037ull;  // FNV-1a
  const auto add = [&](const void* data, std::size_t size) {
    for (std::size_t k = 0; k < size; ++k)
      hash = (hash ^ static_cast<const unsigned char*>(data)[k]) * 1099511628211ull;
  };
  for (const Vec3& p : mesh.vertices) add(p.data(), 3 * sizeof(double));
  for (const Triangle& t : mesh.triangles) add(t.data(), 3 * sizeof(Index));
  return hash;
}

std::vector<std::string> fingerprints() {
  std::vector<std::string> lines;
  for (const Cloud& cloud : repeatedClouds()) {
    const Result<SurfaceFromPoints> surface = surfaceFromPoints(cloud.points);
    lines.push_back("surface of " + cloud.name + ": " +
                    (surface.ok() ? std::to_string(fingerprint(surface->mesh)) : surface.error().detail));
  }
  return lines;
}

constexpr char kChild[] = "SURFACE_TEST_CHILD";  // set to its heap's seed in the processes that the next test starts

TEST(SurfaceFromPoints, AnotherProcessGivesTheSameSurface) {
  if (const char* seed = std::getenv(kChild)) {
    const ScatteredHeap heap(static_cast<unsigned>(std::atoi(seed)));
    for (const std::string& line : fingerprints()) std::printf("%s\n", line.c_str());
    return;
  }
  char self[4096];
  const ssize_t length = readlink("/proc/self/exe", self, sizeof self);
  ASSERT_TRUE(length > 0 && static_cast<std::size_t>(length) < sizeof self);
  const std::vector<std::string> expected = fingerprints();
  for (const std::string seed : {"2", "3"}) {  // the system gives each its own address layout
    // Without the share of the cases that this process has: its own is this one case.
    const std::string command = std::string("env -u GTEST_TOTAL_SHARDS -u GTEST_SHARD_INDEX ") + kChild + "=" + seed +
                                " GTEST_OUTPUT= '" +
                                std::string(self, static_cast<std::size_t>(length)) +
                                "' --gtest_filter=SurfaceFromPoints.AnotherProcessGivesTheSameSurface";
    FILE* output = popen(command.c_str(), "r");
    ASSERT_NE(output, nullptr);
    std::vector<std::string> lines;
    char line[512];
    while (std::fgets(line, sizeof line, output) != nullptr)
      if (std::string(line).rfind("surface of ", 0) == 0) lines.emplace_back(line, std::strcspn(line, "\n"));
    EXPECT_EQ(pclose(output), 0);
    EXPECT_EQ(lines, expected) << "process " << seed;
  }
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

}  // namespace surface_from_points_test
}  // namespace meshless
