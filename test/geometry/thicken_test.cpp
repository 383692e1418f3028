#include "meshless_surgery/geometry/mesh/thicken.h"

#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "meshless_surgery/geometry/mesh/primitives.h"

namespace meshless {
namespace {

constexpr double kPi = 3.14159265358979323846;

// A sheet of width x length, n triangles' edges along each, bent about y to a radius; 0: flat.
TriangleMesh sheet(double width, double length, int n, double radius) {
  TriangleMesh mesh;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      const double x = width * (i / static_cast<double>(n) - 0.5), y = length * j / n;
      mesh.vertices.push_back(radius > 0.0
                                  ? Vec3(radius * std::sin(x / radius), y, radius * (std::cos(x / radius) - 1.0))
                                  : Vec3(x, y, 0.0));
    }
  const auto at = [n](int i, int j) { return static_cast<Index>(i * (n + 1) + j); };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

void expectSolid(const TriangleMesh& mesh) {
  const MeshReport report = inspectMesh(mesh);
  EXPECT_TRUE(report.closed());
  EXPECT_EQ(report.self_intersections, 0u);
  EXPECT_GT(report.signed_volume, 0.0);
}

TEST(Thicken, ASheetHasItsAreaTimesTheThickness) {
  for (const double thickness : {1e-4, 3e-3, 0.05}) {
    const auto layer = thickened(sheet(0.12, 0.2, 7, 0.0), thickness);
    ASSERT_TRUE(layer.ok()) << layer.error().detail;
    expectSolid(*layer);
    EXPECT_NEAR(signedVolume(*layer), 0.12 * 0.2 * thickness, 1e-12);
    const Box bounds = boundsOf(layer->vertices);
    EXPECT_NEAR(bounds.max.z(), 0.5 * thickness, 1e-15);
    EXPECT_NEAR(bounds.min.z(), -0.5 * thickness, 1e-15);
  }
}

TEST(Thicken, ABentSheetHasTheVolumeOfItsTurn) {
  const double radius = 0.05, thickness = 0.01;
  const auto layer = thickened(sheet(0.12, 0.2, 120, radius), thickness);
  ASSERT_TRUE(layer.ok()) << layer.error().detail;
  expectSolid(*layer);
  EXPECT_NEAR(signedVolume(*layer), 0.12 * 0.2 * thickness, 1e-4 * 0.12 * 0.2 * thickness);
}

// A box that lacks its lid: creases and corners keep the distance of the faces.
TEST(Thicken, CreasesKeepTheThickness) {
  TriangleMesh box = boxMesh(Vec3(0.1, 0.08, 0.06), 4, 4, 4);
  TriangleMesh open = box;
  open.triangles.clear();
  open.patches.clear();
  for (const Triangle& t : box.triangles)
    if (std::min({box.vertices[t[0]].z(), box.vertices[t[1]].z(), box.vertices[t[2]].z()}) < 0.0299)
      open.triangles.push_back(t);
  const double thickness = 0.004;
  const auto layer = thickened(open, thickness);
  ASSERT_TRUE(layer.ok()) << layer.error().detail;
  expectSolid(*layer);
  // Outer block less inner one; the rim is moved within the planes of its faces.
  const double outer = 0.104 * 0.084 * 0.062, inner = 0.096 * 0.076 * 0.058;
  EXPECT_NEAR(signedVolume(*layer), outer - inner, 1e-9 * outer);
}

TEST(Thicken, AClosedSurfaceIsTheOutsideOfAWall) {
  const double radius = 0.04, wall = 0.005;
  const TriangleMesh ball = sphereMesh(radius, 0.002);
  const auto layer = thickened(ball, wall);
  ASSERT_TRUE(layer.ok()) << layer.error().detail;
  expectSolid(*layer);
  const double exact = 4.0 / 3.0 * kPi * (std::pow(radius, 3) - std::pow(radius - wall, 3));
  EXPECT_NEAR(signedVolume(*layer), exact, 0.01 * exact);
  for (std::size_t v = 0; v < ball.vertices.size(); ++v) EXPECT_EQ(layer->vertices[v], ball.vertices[v]);
}

// Fine triangles at the edges of a box, noise on a ball: what is offset vertex by vertex would turn over.
TEST(Thicken, WallsOfRoughSurfacesHaveTheirThickness) {
  const auto box = thickened(boxMesh(Vec3(0.1, 0.08, 0.06), 0.005), 0.015);
  ASSERT_TRUE(box.ok()) << box.error().detail;
  expectSolid(*box);
  const double exact = 0.1 * 0.08 * 0.06 - 0.07 * 0.05 * 0.03;
  EXPECT_NEAR(signedVolume(*box), exact, 0.02 * exact);  // its inner edges are rounded
  TriangleMesh rough = sphereMesh(0.04, 0.003);
  unsigned state = 7;
  for (Vec3& p : rough.vertices) {
    state = state * 1664525u + 1013904223u;
    p *= 1.0 + 0.02 * (state / 4294967296.0 - 0.5);
  }
  const std::size_t outside = rough.vertices.size();
  const auto wall = thickened(rough, 0.01);
  ASSERT_TRUE(wall.ok()) << wall.error().detail;
  expectSolid(*wall);
  for (std::size_t v = outside; v < wall->vertices.size(); ++v)
    EXPECT_NEAR(wall->vertices[v].norm(), 0.03, 0.0008) << "0.4 mm of noise outside";
}

TEST(Thicken, PatchesGoAlong) {
  TriangleMesh mesh = sheet(0.1, 0.1, 2, 0.0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) mesh.patches.push_back(static_cast<std::uint32_t>(t));
  const auto layer = thickened(mesh, 0.01);
  ASSERT_TRUE(layer.ok());
  ASSERT_EQ(layer->patches.size(), layer->triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    EXPECT_EQ(layer->patches[t], t);
    EXPECT_EQ(layer->patches[mesh.triangles.size() + t], t);
  }
}

TEST(Thicken, WhatIsTooThickForItsCurveIsRefused) {
  for (const double thickness : {0.0, -1.0, std::nan(""), double{INFINITY}}) {
    const auto layer = thickened(sheet(0.1, 0.1, 2, 0.0), thickness);
    ASSERT_FALSE(layer.ok());
    EXPECT_EQ(layer.error().code, ErrorCode::kInvalidArgument);
  }
  const auto bent = thickened(sheet(0.12, 0.2, 60, 0.05), 0.101);
  ASSERT_FALSE(bent.ok());
  EXPECT_EQ(bent.error().code, ErrorCode::kUnsuitableShape);
  EXPECT_FALSE(thickened(sphereMesh(0.04, 0.004), 0.041).ok());
  TriangleMesh fin = sheet(0.1, 0.1, 1, 0.0);  // a third triangle at an edge
  fin.vertices.push_back(Vec3(0.0, 0.0, 0.1));
  fin.triangles.push_back({fin.triangles[0][0], fin.triangles[0][1], 4});
  EXPECT_FALSE(thickened(fin, 0.01).ok());
}

}  // namespace
}  // namespace meshless
