// Surfaces in even triangles. Lengths are those of collision surfaces: a spacing makes 1,600 cells of the body.
#include "meshless_surgery/geometry/mesh/even_surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>

#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "shapes/random_organ.h"
#include "support/mesh_laws.h"
#include "support/shapes.h"

namespace meshless {
namespace even_surface_test {

constexpr std::size_t kMost = 200000;

double spacingOf(const TriangleMesh& mesh) { return std::cbrt(signedVolume(mesh) / 1600.0); }

// [m] of the shortest edge whose faces turn by more than 35 degrees; infinite without any.
double shortestSharpEdge(const TriangleMesh& mesh) {
  std::map<std::pair<Index, Index>, Vec3> normals;
  double shortest = std::numeric_limits<double>::infinity();
  for (const Triangle& t : mesh.triangles) {
    const Vec3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    for (int k = 0; k < 3; ++k) normals[{t[k], t[(k + 1) % 3]}] = (b - a).cross(c - a).normalized();
  }
  for (const auto& [edge, normal] : normals) {
    const auto other = normals.find({edge.second, edge.first});
    if (other == normals.end() || normal.dot(other->second) < 0.82)
      shortest = std::min(shortest, (mesh.vertices[edge.first] - mesh.vertices[edge.second]).norm());
  }
  return shortest;
}

// All that is promised of `even`, made of `given` with edges of 0.8 spacings.
void expectLaws(const std::string& name, const TriangleMesh& given, const EvenSurface& even, double farthest) {
  SCOPED_TRACE(name);
  const double spacing = spacingOf(given), edge = 0.8 * spacing;
  EXPECT_TRUE(laws::isClosedOriented(even.mesh));
  EXPECT_TRUE(laws::usesEveryVertex(even.mesh));
  EXPECT_TRUE(laws::hasNoDuplicateTriangles(even.mesh));
  const double volume = signedVolume(given);
  EXPECT_NEAR(signedVolume(even.mesh), volume, 0.02 * volume);
  EXPECT_LE(even.distance, farthest * spacing);
  const double shortest_sharp = shortestSharpEdge(given);
  double shortest = std::numeric_limits<double>::infinity(), longest = 0.0;
  for (const Triangle& t : even.mesh.triangles)
    for (int k = 0; k < 3; ++k) {
      const double length = (even.mesh.vertices[t[k]] - even.mesh.vertices[t[(k + 1) % 3]]).norm();
      shortest = std::min(shortest, length);
      longest = std::max(longest, length);
    }
  EXPECT_GE(shortest, std::min(0.28 * edge, 0.3 * shortest_sharp));
  EXPECT_LE(longest, 2.0 * edge);
  const MeshReport report = inspectMesh(even.mesh);
  EXPECT_EQ(report.self_intersections, 0u);
  EXPECT_EQ(report.components, inspectMesh(given, false).components);
  // The distance is that of every vertex, whoever measures.
  const SolidQuery query(given), back(even.mesh);
  for (const Vec3& v : even.mesh.vertices) ASSERT_LE(query.distance(v), even.distance + 1e-9 * spacing);
  for (const Vec3& v : given.vertices) ASSERT_LE(back.distance(v), even.distance + 1e-9 * spacing);
}

TEST(EvenSurface, EveryShapeIsTheSameSurfaceInEvenTriangles) {
  std::vector<shapes::Shape> all = shapes::allShapes();
  all.push_back({"fine sphere", sphereMesh(0.1, 0.0025)});
  all.push_back({"fine box", boxMesh(Vec3(0.2, 0.1, 0.05), 0.004)});
  all.push_back({"fine cylinder", cylinderMesh(0.3, 0.05, 0.005)});
  all.push_back({"fine slab", boxMesh(Vec3(0.2, 0.2, 0.002), 0.003)});
  for (const shapes::Shape& shape : all) {
    const Result<EvenSurface> even = evenSurface(shape.mesh, 0.8 * spacingOf(shape.mesh), kMost);
    ASSERT_TRUE(even.ok()) << shape.name << ": " << even.error().detail;
    expectLaws(shape.name, shape.mesh, *even, 0.12);
  }
}

TEST(EvenSurface, RandomOrgansAreTheSameSurfaceInEvenTriangles_Long) {
  for (int k = 0; k < 6; ++k) {
    const Result<TriangleMesh> organ = randomOrgan(100 + k, k % 3, 0.2, k < 3 ? 4000 : 15000);
    ASSERT_TRUE(organ.ok()) << organ.error().detail;
    const Result<EvenSurface> even = evenSurface(*organ, 0.8 * spacingOf(*organ), kMost);
    ASSERT_TRUE(even.ok()) << k << ": " << even.error().detail;
    expectLaws("organ " + std::to_string(k), *organ, *even, 0.16);
    if (k % 3 == 0)
      EXPECT_LE(even->distance, 0.1 * spacingOf(*organ));  // a solid one, without rings thinner than a cell
  }
}

TEST(EvenSurface, TheSameInputGivesTheSameBits) {
  const TriangleMesh mesh = liverMesh();
  const Result<EvenSurface> first = evenSurface(mesh, 0.01, kMost), second = evenSurface(mesh, 0.01, kMost);
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_EQ(first->mesh.vertices, second->mesh.vertices);
  EXPECT_EQ(first->mesh.triangles, second->mesh.triangles);
  EXPECT_EQ(first->distance, second->distance);
}

TEST(EvenSurface, TurnedAndScaledInputGivesTheSameVolumeAndFineness) {
  const TriangleMesh mesh = kidneyMesh();
  const double edge = 0.8 * spacingOf(mesh);
  const Result<EvenSurface> here = evenSurface(mesh, edge, kMost);
  for (const double scale : {0.01, 1.0, 30.0}) {
    const Result<EvenSurface> there = evenSurface(shapes::moved(mesh, shapes::anyPose(), scale), scale * edge, kMost);
    ASSERT_TRUE(here.ok() && there.ok());
    EXPECT_NEAR(signedVolume(there->mesh) / std::pow(scale, 3), signedVolume(here->mesh), 1e-3 * signedVolume(mesh));
    EXPECT_NEAR(static_cast<double>(there->mesh.triangles.size()), here->mesh.triangles.size(),
                0.05 * here->mesh.triangles.size());
    EXPECT_NEAR(meanEdgeLength(there->mesh) / scale, meanEdgeLength(here->mesh), 0.03 * edge);
  }
  // Far from the origin the same, but for rounding.
  TriangleMesh far = mesh;
  for (Vec3& v : far.vertices) v += Vec3(1024.0, -2048.0, 512.0);
  const Result<EvenSurface> away = evenSurface(far, edge, kMost);
  ASSERT_TRUE(away.ok());
  EXPECT_NEAR(signedVolume(away->mesh), signedVolume(here->mesh), 1e-3 * signedVolume(mesh));
}

TEST(EvenSurface, OpenSurfacesStayOpen) {
  TriangleMesh sheet;
  for (int i = 0; i <= 40; ++i)
    for (int j = 0; j <= 40; ++j) sheet.vertices.emplace_back(0.005 * i, 0.005 * j, 0.01 * std::sin(0.1 * i));
  for (Index i = 0; i < 40; ++i)
    for (Index j = 0; j < 40; ++j) {
      const Index a = 41 * i + j, b = a + 41;
      sheet.triangles.push_back({a, b, b + 1});
      sheet.triangles.push_back({a, b + 1, a + 1});
    }
  const Result<EvenSurface> even = evenSurface(sheet, 0.012, kMost);
  ASSERT_TRUE(even.ok()) << even.error().detail;
  const MeshReport report = inspectMesh(even->mesh);
  EXPECT_GT(report.boundary_edges, 40u);
  EXPECT_EQ(report.components, 1u);
  EXPECT_EQ(report.self_intersections, 0u);
  EXPECT_NEAR(surfaceArea(even->mesh), surfaceArea(sheet), 0.02 * surfaceArea(sheet));
  EXPECT_LT(even->distance, 0.2 * 0.012);
}

TEST(EvenSurface, BadInputIsRefused) {
  const TriangleMesh box = boxMesh(Vec3(0.1, 0.1, 0.1), 1, 1, 1);
  for (const double edge : {0.0, -0.01, std::nan(""), std::numeric_limits<double>::infinity(), 1e-4}) {
    const Result<EvenSurface> even = evenSurface(box, edge, 10000);
    ASSERT_FALSE(even.ok()) << edge;
    EXPECT_EQ(even.error().code, ErrorCode::kInvalidArgument);
    EXPECT_NE(even.error().detail.find("accepted: above 0, finite, and at least 0.0037"), std::string::npos)
        << even.error().detail;
  }
  const auto refused = [](const TriangleMesh& mesh, double edge) {
    const Result<EvenSurface> even = evenSurface(mesh, edge, kMost);
    return !even.ok() && even.error().code == ErrorCode::kUnsuitableShape && !even.error().detail.empty();
  };
  EXPECT_TRUE(refused(TriangleMesh(), 0.01));
  TriangleMesh flat = box;  // a triangle without area
  flat.vertices.push_back(0.5 * (flat.vertices[0] + flat.vertices[1]));
  flat.triangles.push_back({0, 1, static_cast<Index>(flat.vertices.size() - 1)});
  EXPECT_TRUE(refused(flat, 0.01));
  TriangleMesh missing = box;
  missing.triangles[0][0] = 99;
  EXPECT_TRUE(refused(missing, 0.01));
  TriangleMesh twice = box;  // an edge of three faces
  twice.vertices.emplace_back(0.2, 0.3, 0.4);
  twice.triangles.push_back({box.triangles[0][0], box.triangles[0][1], static_cast<Index>(twice.vertices.size() - 1)});
  EXPECT_TRUE(refused(twice, 0.01));
  TriangleMesh nan = box;
  nan.vertices[0].x() = std::nan("");
  EXPECT_TRUE(refused(nan, 0.01));
}

TEST(EvenSurface, WhatIsFinerThanTheEdgeIsDoneWithHalfOfItOrRefused) {
  // Bristles much thinner than an edge: no surface of such triangles is near them.
  const TriangleMesh thin = torusMesh(0.1, 0.004, 0.003);
  const Result<EvenSurface> coarse = evenSurface(thin, 0.03, kMost), fine = evenSurface(thin, 0.006, kMost);
  EXPECT_TRUE(!coarse.ok() || coarse->distance <= 0.2 * 0.03);
  ASSERT_TRUE(fine.ok()) << fine.error().detail;
  EXPECT_LE(fine->distance, 0.2 * 0.006);
  EXPECT_NEAR(signedVolume(fine->mesh), signedVolume(thin), 0.05 * signedVolume(thin));
}

}  // namespace even_surface_test
}  // namespace meshless
