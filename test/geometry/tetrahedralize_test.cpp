#include "meshless_surgery/geometry/mesh/tetrahedralize.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/sampling.h"
#include "support/shapes.h"

namespace meshless {
namespace tetrahedralize_test {

double volumeOf(const Points& points, const Tetrahedron& t) {
  const Vec3& a = points[t[0]];
  return (points[t[1]] - a).cross(points[t[2]] - a).dot(points[t[3]] - a) / 6.0;
}

double sum(const Points& points, const std::vector<Tetrahedron>& tetrahedra) {
  double volume = 0.0;
  for (const Tetrahedron& t : tetrahedra) volume += volumeOf(points, t);
  return volume;
}

double smallest(const Points& points, const std::vector<Tetrahedron>& tetrahedra) {
  double volume = 1e300;
  for (const Tetrahedron& t : tetrahedra) volume = std::min(volume, volumeOf(points, t));
  return volume;
}

/// Each face is shared by two tetrahedra that see it in opposite directions, or by one.
void expectConforming(const std::vector<Tetrahedron>& tetrahedra) {
  std::map<Triangle, int> faces;
  for (Tetrahedron t : tetrahedra) {
    std::sort(t.begin(), t.end());
    for (int k = 0; k < 4; ++k) {
      Triangle face;
      for (int i = 0, n = 0; i < 4; ++i)
        if (i != k) face[n++] = t[i];
      ++faces[face];
    }
  }
  for (const auto& entry : faces) EXPECT_LE(entry.second, 2);
}

Points lattice(int nx, int ny, int nz, const Pose& pose, double spacing) {
  Points points;
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j)
      for (int k = 0; k < nz; ++k) points.push_back(pose * (spacing * Vec3(i, j, k)));
  return points;
}

TEST(Tetrahedralize, BlockOfThePaperIsExactly32) {
  const TriangleMesh block = block32Mesh();
  ASSERT_EQ(block.vertices.size(), 18u);
  ASSERT_EQ(block.triangles.size(), 32u);
  Points points = block.vertices;
  points.push_back(Vec3::Zero());
  const std::vector<Tetrahedron> tetrahedra = tetrahedralize(points, SolidQuery(block));
  EXPECT_EQ(tetrahedra.size(), 32u);
  EXPECT_NEAR(sum(points, tetrahedra), 0.1 * 0.1 * 0.05, 1e-15);
  for (const Tetrahedron& t : tetrahedra) EXPECT_EQ(std::count(t.begin(), t.end(), 18u), 1);
}

TEST(Tetrahedralize, LatticesHaveNoSliversHoweverTheyAreTurned) {
  for (const Pose& pose : {Pose(), shapes::anyPose(), Pose{Quat::Identity(), Vec3(100.1, -30.7, 3.3)}}) {
    const double spacing = 0.1;
    const Points points = lattice(5, 4, 6, pose, spacing);
    const std::vector<Tetrahedron> tetrahedra = tetrahedralizeHull(points);
    const double cell = spacing * spacing * spacing;
    EXPECT_NEAR(sum(points, tetrahedra), 4 * 3 * 5 * cell, 1e-9 * cell);
    EXPECT_GT(smallest(points, tetrahedra), cell / 6.0 * 0.999);  // a cube splits into sixths and a third
    expectConforming(tetrahedra);
    const TriangleMesh hull = {points, boundaryFaces(tetrahedra), {}};
    EXPECT_EQ(hull.triangles.size(), 4u * (4 * 3 + 3 * 5 + 4 * 5));  // no crack inside
    EXPECT_NEAR(signedVolume(hull), 4 * 3 * 5 * cell, 1e-9 * cell);
  }
}

TEST(Tetrahedralize, PointsOfASphereFillIt) {
  // All on one sphere: every five of them are cospherical.
  const TriangleMesh sphere = sphereMesh(0.1, 0.04);
  const std::vector<Tetrahedron> tetrahedra = tetrahedralize(sphere.vertices, SolidQuery(sphere));
  EXPECT_NEAR(sum(sphere.vertices, tetrahedra), signedVolume(sphere), 1e-6 * signedVolume(sphere));
  EXPECT_GT(smallest(sphere.vertices, tetrahedra), 0.0);
}

TEST(Tetrahedralize, FillsEveryShapeFromSurfaceAndInterior) {
  for (const auto& [name, mesh] : shapes::allShapes()) {
    const SolidQuery query(mesh);
    Points points = mesh.vertices;
    const double spacing = std::min(std::cbrt(signedVolume(mesh) / 300.0), meanEdgeLength(mesh));
    for (const Vec3& p : sampleInterior(mesh, query, spacing, 0.5 * spacing).points) points.push_back(p);
    const std::vector<Tetrahedron> tetrahedra = tetrahedralize(points, query);
    ASSERT_FALSE(tetrahedra.empty()) << name;
    EXPECT_GT(smallest(points, tetrahedra), 0.0) << name;
    EXPECT_NEAR(sum(points, tetrahedra) / signedVolume(mesh), 1.0, 0.1) << name;  // long edges are not forced in
    expectConforming(tetrahedra);
    std::set<Index> used;
    for (const Tetrahedron& t : tetrahedra) used.insert(t.begin(), t.end());
    EXPECT_EQ(used.size(), points.size()) << name;
  }
}

TEST(Tetrahedralize, KeepsOutOfNotches) {
  const TriangleMesh arch = shapes::arch();
  const SolidQuery query(arch);
  Points points = arch.vertices;
  for (const Vec3& p : sampleInterior(arch, query, 0.01, 0.004).points) points.push_back(p);
  EXPECT_LT(sum(points, tetrahedralize(points, query)), 1.02 * signedVolume(arch));
  EXPECT_NEAR(sum(points, tetrahedralizeHull(points)), 0.2 * 0.06 * 0.12, 1e-9);
}

TEST(Tetrahedralize, BoundaryOfAHullPointsOutwards) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  Points points;
  for (int k = 0; k < 200; ++k) points.emplace_back(unit(random), unit(random), unit(random));
  const std::vector<Tetrahedron> tetrahedra = tetrahedralizeHull(points);
  const TriangleMesh hull = {points, boundaryFaces(tetrahedra), {}};
  EXPECT_NEAR(signedVolume(hull), sum(points, tetrahedra), 1e-12);
  for (const Triangle& t : hull.triangles) {
    const Vec3 normal = (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]]);
    for (const Vec3& p : points) EXPECT_LE(normal.dot(p - points[t[0]]), 1e-12);
  }
}

TEST(Tetrahedralize, EdgesAreUniqueAndSorted) {
  const auto edges = tetrahedronEdges({{0, 1, 2, 3}, {1, 3, 2, 4}});
  EXPECT_EQ(edges.size(), 9u);
  EXPECT_TRUE(std::is_sorted(edges.begin(), edges.end()));
  for (const auto& edge : edges) EXPECT_LT(edge[0], edge[1]);
  EXPECT_EQ(boundaryFaces({{0, 1, 2, 3}, {1, 3, 2, 4}}).size(), 6u);
}

TEST(Tetrahedralize, NothingFromTooFewOrFlatPoints) {
  EXPECT_TRUE(tetrahedralizeHull({}).empty());
  EXPECT_TRUE(tetrahedralizeHull({Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)}).empty());
  EXPECT_TRUE(tetrahedralizeHull(lattice(5, 5, 1, Pose(), 0.1)).empty());
  EXPECT_TRUE(tetrahedralizeHull(lattice(5, 5, 1, shapes::anyPose(), 0.1)).empty());
  EXPECT_TRUE(tetrahedralizeHull(Points(10, Vec3(1, 2, 3))).empty());
}

TEST(Tetrahedralize, LeavesOutPointsThatAreNotFinite) {
  Points points = lattice(2, 2, 2, Pose(), 0.1);
  const std::size_t without = tetrahedralizeHull(points).size();
  points.push_back(Vec3(std::numeric_limits<double>::quiet_NaN(), 0, 0));
  EXPECT_EQ(tetrahedralizeHull(points).size(), without);
}

TEST(Tetrahedralize, TheSamePointsGiveTheSameOrder) {
  const Points points = lattice(4, 4, 4, shapes::anyPose(), 0.1);
  const std::vector<Tetrahedron> first = tetrahedralizeHull(points);
  EXPECT_EQ(first, tetrahedralizeHull(points));
  EXPECT_TRUE(std::is_sorted(first.begin(), first.end()));
}

}  // namespace tetrahedralize_test
}  // namespace meshless
