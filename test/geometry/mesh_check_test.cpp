#include "meshless_surgery/geometry/mesh/mesh_check.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/shapes.h"

namespace meshless {
namespace mesh_check_test {

bool says(const RepairedMesh& mesh, const std::string& part) {
  return std::any_of(mesh.notes.begin(), mesh.notes.end(),
                     [&](const std::string& note) { return note.find(part) != std::string::npos; });
}

std::string notes(const RepairedMesh& mesh) {
  std::string all;
  for (const std::string& note : mesh.notes) all += note + "; ";
  return all;
}

/// Each triangle with three vertices of its own, as in an STL file.
TriangleMesh soup(const TriangleMesh& mesh) {
  TriangleMesh out;
  for (const Triangle& t : mesh.triangles) {
    const Index n = static_cast<Index>(out.vertices.size());
    for (const Index v : t) out.vertices.push_back(mesh.vertices[v]);
    out.triangles.push_back({n, n + 1, n + 2});
  }
  return out;
}

void expectRefused(const TriangleMesh& mesh, const std::string& message) {
  const Result<RepairedMesh> result = repairMesh(mesh);
  ASSERT_FALSE(result.ok()) << "should say: " << message;
  EXPECT_EQ(result.error().code, ErrorCode::kUnsuitableShape);
  EXPECT_NE(result.error().detail.find(message), std::string::npos) << result.error().detail;
}

TEST(MeshCheck, EveryShapeIsSoundAndStaysAsItIs) {
  for (const auto& [name, mesh] : shapes::allShapes()) {
    const MeshReport report = inspectMesh(mesh);
    EXPECT_TRUE(report.closed()) << name;
    EXPECT_EQ(report.degenerate_triangles, 0u) << name;
    EXPECT_EQ(report.duplicate_triangles, 0u) << name;
    EXPECT_EQ(report.self_intersections, 0u) << name;
    EXPECT_EQ(report.components, name == "two pieces" || name == "hollow sphere" ? 2u : 1u) << name;
    EXPECT_DOUBLE_EQ(report.signed_volume, signedVolume(mesh)) << name;

    const Result<RepairedMesh> repaired = repairMesh(mesh);
    ASSERT_TRUE(repaired.ok()) << name << ": " << repaired.error().detail;
    EXPECT_TRUE(repaired->notes.empty()) << name << ": " << notes(*repaired);
    EXPECT_TRUE(repaired->solid) << name;
    EXPECT_FALSE(repaired->self_intersecting) << name;
    EXPECT_EQ(repaired->mesh.vertices, mesh.vertices) << name;
    EXPECT_EQ(repaired->mesh.triangles, mesh.triangles) << name;
  }
}

TEST(MeshCheck, ASoupOfSingleTrianglesIsJoined) {
  for (const auto& [name, mesh] : shapes::allShapes()) {
    EXPECT_EQ(inspectMesh(soup(mesh), false).boundary_edges, 3 * mesh.triangles.size()) << name;
    TriangleMesh noisy = soup(mesh);
    const double jitter = 2e-10 * boundsOf(mesh.vertices).diagonal();
    for (std::size_t v = 0; v < noisy.vertices.size(); ++v) noisy.vertices[v][v % 3] += v % 2 ? jitter : -jitter;
    for (const TriangleMesh& input : {soup(mesh), noisy}) {
      const Result<RepairedMesh> repaired = repairMesh(input);
      ASSERT_TRUE(repaired.ok()) << name << ": " << repaired.error().detail;
      EXPECT_EQ(repaired->mesh.vertices.size(), mesh.vertices.size()) << name;
      EXPECT_EQ(repaired->mesh.triangles.size(), mesh.triangles.size()) << name;
      EXPECT_TRUE(repaired->solid) << name;
      EXPECT_TRUE(inspectMesh(repaired->mesh, false).closed()) << name;
      EXPECT_NEAR(signedVolume(repaired->mesh), signedVolume(mesh), 1e-6 * signedVolume(mesh)) << name;
      EXPECT_TRUE(says(*repaired, "merged")) << name;
    }
  }
}

TEST(MeshCheck, InsideOutIsTurnedAndSaid) {
  for (const auto& [name, mesh] : shapes::allShapes()) {
    const Result<RepairedMesh> repaired = repairMesh(shapes::turnedInsideOut(mesh));
    ASSERT_TRUE(repaired.ok()) << name;
    EXPECT_NEAR(signedVolume(repaired->mesh), signedVolume(mesh), 1e-12) << name;
    EXPECT_TRUE(says(*repaired, "inside-out")) << name << ": " << notes(*repaired);
    EXPECT_TRUE(repaired->solid) << name;
  }
}

TEST(MeshCheck, SingleTurnedTrianglesAreTurnedBack) {
  for (const auto& [name, mesh] : shapes::allShapes()) {
    TriangleMesh mixed = mesh;
    for (std::size_t f = 0; f < mixed.triangles.size(); f += 5) std::swap(mixed.triangles[f][0], mixed.triangles[f][1]);
    EXPECT_TRUE(inspectMesh(mixed, false).closed()) << name;
    const Result<RepairedMesh> repaired = repairMesh(mixed);
    ASSERT_TRUE(repaired.ok()) << name;
    EXPECT_NEAR(signedVolume(repaired->mesh), signedVolume(mesh), 1e-12) << name;
    EXPECT_TRUE(says(*repaired, "faced against")) << name;
  }
}

TEST(MeshCheck, ACavityPointsInwards) {
  TriangleMesh mesh = sphereMesh(0.1, 0.02);
  const double outer = signedVolume(mesh);
  shapes::append(mesh, sphereMesh(0.06, 0.02));  // the wrong way round for a cavity
  shapes::append(mesh, shapes::turnedInsideOut(sphereMesh(0.03, 0.02)));  // an island in it, the wrong way round too
  const Result<RepairedMesh> repaired = repairMesh(mesh);
  ASSERT_TRUE(repaired.ok());
  const double expected = outer - signedVolume(sphereMesh(0.06, 0.02)) + signedVolume(sphereMesh(0.03, 0.02));
  EXPECT_NEAR(signedVolume(repaired->mesh), expected, 1e-12);
  EXPECT_TRUE(says(*repaired, "cavity"));
  EXPECT_TRUE(says(*repaired, "1 component of 3 was inside-out")) << notes(*repaired);
}

TEST(MeshCheck, SmallHolesAreClosedAndSaid) {
  std::vector<shapes::Shape> all = shapes::allShapes();
  all.push_back({"fine sphere", sphereMesh(0.1, 0.007)});
  all.push_back({"fine box", boxMesh(Vec3(0.2, 0.1, 0.05), 0.005)});
  std::size_t tried = 0;
  for (const auto& [name, mesh] : all) {
    // Else the hole is not small.
    if (10.0 * meanEdgeLength(mesh) > 0.25 * boundsOf(mesh.vertices).diagonal()) continue;
    ++tried;
    TriangleMesh open = mesh;
    // All triangles about the first vertex, and one triangle elsewhere.
    const Index centre = mesh.triangles[0][0];
    open.triangles.erase(std::remove_if(open.triangles.begin(), open.triangles.end(),
                                        [&](const Triangle& t) { return std::count(t.begin(), t.end(), centre) > 0; }),
                         open.triangles.end());
    open.triangles.erase(open.triangles.begin() + static_cast<long>(open.triangles.size() / 2));
    const std::size_t boundary = inspectMesh(open, false).boundary_edges;
    ASSERT_GE(boundary, 6u) << name;
    const Result<RepairedMesh> repaired = repairMesh(open);
    ASSERT_TRUE(repaired.ok()) << name;
    EXPECT_TRUE(repaired->solid) << name << ": " << notes(*repaired);
    EXPECT_TRUE(inspectMesh(repaired->mesh, false).closed()) << name;
    EXPECT_NEAR(signedVolume(repaired->mesh), signedVolume(mesh), 0.02 * signedVolume(mesh)) << name;
    EXPECT_TRUE(says(*repaired, "closed 2 small holes with " + std::to_string(boundary))) << name << notes(*repaired);
  }
  EXPECT_GE(tried, 5u);
}

TEST(MeshCheck, HolesThatTouchInAVertexAreClosedEach) {
  TriangleMesh mesh = boxMesh(Vec3(0.2, 0.2, 0.2), 10, 10, 10);
  const double volume = signedVolume(mesh);
  // Two triangles that share one vertex and no edge.
  const Triangle first = mesh.triangles[50];
  for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
    const Triangle t = mesh.triangles[f];
    int shared = 0;
    for (const Index v : t) shared += std::count(first.begin(), first.end(), v) > 0;
    if (shared != 1) continue;
    mesh.triangles.erase(mesh.triangles.begin() + static_cast<long>(f));
    break;
  }
  mesh.triangles.erase(std::find(mesh.triangles.begin(), mesh.triangles.end(), first));
  const Result<RepairedMesh> repaired = repairMesh(mesh);
  ASSERT_TRUE(repaired.ok());
  EXPECT_TRUE(repaired->solid);
  EXPECT_TRUE(says(*repaired, "closed 2 small holes with 6 open edges")) << notes(*repaired);
  EXPECT_NEAR(signedVolume(repaired->mesh), volume, 1e-15);
}

TEST(MeshCheck, AWideOpenSurfaceStaysOpenAndIsNoSolid) {
  TriangleMesh mesh = sphereMesh(0.1, 0.02);
  mesh.triangles.erase(std::remove_if(mesh.triangles.begin(), mesh.triangles.end(),
                                      [&](const Triangle& t) {
                                        return std::any_of(t.begin(), t.end(), [&](Index v) {
                                          return mesh.vertices[v].z() > 0.01;
                                        });
                                      }),
                       mesh.triangles.end());
  const std::size_t boundary = inspectMesh(mesh).boundary_edges;
  const Result<RepairedMesh> repaired = repairMesh(mesh);
  ASSERT_TRUE(repaired.ok());
  EXPECT_FALSE(repaired->solid);
  EXPECT_TRUE(says(*repaired, "open: " + std::to_string(boundary) + " edges")) << notes(*repaired);
  EXPECT_TRUE(says(*repaired, "that no triangle uses"));
}

TEST(MeshCheck, ASheetIsNotDoubled) {
  TriangleMesh mesh = sphereMesh(0.1, 0.02);
  shapes::append(mesh, TriangleMesh{{Vec3(0, 0, 0), Vec3(0.01, 0, 0), Vec3(0, 0.01, 0)}, {{0, 1, 2}}, {}},
                 Vec3(0.2, 0, 0));
  const Result<RepairedMesh> repaired = repairMesh(mesh);
  ASSERT_TRUE(repaired.ok());
  EXPECT_FALSE(repaired->solid);
  EXPECT_EQ(repaired->mesh.triangles.size(), mesh.triangles.size());
}

TEST(MeshCheck, SelfIntersectionIsCountedAndLoadedAllTheSame) {
  TriangleMesh mesh = sphereMesh(0.1, 0.03);
  shapes::append(mesh, sphereMesh(0.1, 0.03), Vec3(0.11, 0.013, 0.007));
  const MeshReport report = inspectMesh(mesh);
  EXPECT_TRUE(report.closed());
  EXPECT_GT(report.self_intersections, 10u);
  EXPECT_EQ(inspectMesh(mesh, false).self_intersections, 0u);
  const Result<RepairedMesh> repaired = repairMesh(mesh);
  ASSERT_TRUE(repaired.ok());
  EXPECT_TRUE(repaired->solid);
  EXPECT_TRUE(repaired->self_intersecting);
  EXPECT_TRUE(says(*repaired, std::to_string(report.self_intersections) + " pairs of triangles meet"));
}

TEST(MeshCheck, FindsTheOnePairThatCrosses) {
  // Two single triangles: apart, then one through the other; in one plane, apart and over each other.
  const auto crossing = [](const Vec3& shift, bool upright) {
    TriangleMesh mesh = {{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)}, {{0, 1, 2}}, {}};
    TriangleMesh other = mesh;
    if (upright) other.vertices = {Vec3(0.2, 0.2, -0.5), Vec3(0.3, 0.2, 0.5), Vec3(0.2, 0.3, 0.5)};
    shapes::append(mesh, other, shift);
    return inspectMesh(mesh).self_intersections;
  };
  EXPECT_EQ(crossing(Vec3::Zero(), true), 1u);
  EXPECT_EQ(crossing(Vec3(1.0, 1.0, 0.0), true), 0u);
  EXPECT_EQ(crossing(Vec3(0.1, 0.1, 0.0), false), 1u);
  EXPECT_EQ(crossing(Vec3(0.1, 0.1, 0.01), false), 0u);
  // Folded flat about a shared edge, and spread flat.
  TriangleMesh hinge = {{Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0.3, 0.8, 0)}, {{0, 1, 2}, {1, 0, 3}}, {}};
  EXPECT_EQ(inspectMesh(hinge).self_intersections, 1u);
  hinge.vertices[3].y() = -0.8;
  EXPECT_EQ(inspectMesh(hinge).self_intersections, 0u);
}

TEST(MeshCheck, EmptyIsRefused) {
  expectRefused(TriangleMesh(), "empty");
  TriangleMesh cloud;
  cloud.vertices = sphereMesh(0.1, 0.1).vertices;
  expectRefused(cloud, "empty");
}

TEST(MeshCheck, NonFiniteIsRefused) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, infinity, -infinity}) {
    TriangleMesh mesh = sphereMesh(0.1, 0.05);
    mesh.vertices[7].y() = bad;
    expectRefused(mesh, "vertex 7 is not finite");
    EXPECT_EQ(inspectMesh(mesh).non_finite_vertices, 1u);
  }
}

TEST(MeshCheck, IndicesOutOfRangeAreRefused) {
  TriangleMesh mesh = shapes::tetrahedron();
  mesh.triangles.push_back({0, 1, 4});
  expectRefused(mesh, "triangle 4 names vertex 4, but the surface has the vertices 0 to 3");
  EXPECT_EQ(inspectMesh(mesh).bad_indices, 1u);
}

TEST(MeshCheck, NonManifoldIsRefused) {
  // Two cubes that share an edge.
  TriangleMesh mesh = boxMesh(Vec3(1, 1, 1), 1, 1, 1);
  shapes::append(mesh, boxMesh(Vec3(1, 1, 1), 1, 1, 1), Vec3(1, 1, 0));
  expectRefused(mesh, "not manifold: 1 edge is shared by up to 4 triangles");
  // A fin on a closed surface.
  TriangleMesh fin = shapes::tetrahedron();
  fin.vertices.push_back(Vec3(0.1, 0.1, 0.1));
  fin.triangles.push_back({0, 1, 4});
  expectRefused(fin, "not manifold: 1 edge is shared by up to 3 triangles");
  EXPECT_EQ(inspectMesh(fin).non_manifold_edges, 1u);
  EXPECT_FALSE(inspectMesh(fin).closed());
}

TEST(MeshCheck, AMoebiusStripIsRefused) {
  TriangleMesh strip;
  const int n = 12;
  for (int k = 0; k < n; ++k) {
    const double angle = 2.0 * 3.14159265358979323846 * k / n;
    const Vec3 out(std::cos(angle), std::sin(angle), 0.0);
    const Vec3 across = 0.3 * (std::cos(angle / 2.0) * out + std::sin(angle / 2.0) * Vec3::UnitZ());
    strip.vertices.push_back(out + across);
    strip.vertices.push_back(out - across);
  }
  for (Index k = 0; k < static_cast<Index>(n); ++k) {
    const bool last = k + 1 == static_cast<Index>(n);
    const Index a = 2 * k, b = a + 1, c = last ? 1 : a + 2, d = last ? 0 : a + 3;
    strip.triangles.push_back({a, b, c});
    strip.triangles.push_back({b, d, c});
  }
  expectRefused(strip, "one side only");
}

TEST(MeshCheck, NoAreaIsRefused) {
  expectRefused({Points(6, Vec3(1, 2, 3)), {{0, 1, 2}, {3, 4, 5}}, {}}, "no triangle has an area");
  expectRefused({{Vec3(0, 0, 0), Vec3(1, 1, 1), Vec3(2, 2, 2), Vec3(3, 3, 3)}, {{0, 1, 2}, {1, 2, 3}}, {}},
                "no triangle has an area");
}

TEST(MeshCheck, DegenerateAndDuplicateTrianglesAreDropped) {
  TriangleMesh mesh = sphereMesh(0.1, 0.05);
  const TriangleMesh clean = mesh;
  mesh.triangles.push_back({3, 3, 5});
  mesh.triangles.push_back({mesh.triangles[4][1], mesh.triangles[4][2], mesh.triangles[4][0]});
  mesh.vertices.push_back(Vec3(1, 1, 1));
  const MeshReport report = inspectMesh(mesh);
  EXPECT_EQ(report.degenerate_triangles, 1u);
  EXPECT_EQ(report.duplicate_triangles, 1u);
  const Result<RepairedMesh> repaired = repairMesh(mesh);
  ASSERT_TRUE(repaired.ok());
  EXPECT_EQ(repaired->mesh.triangles, clean.triangles);
  EXPECT_EQ(repaired->mesh.vertices, clean.vertices);
  EXPECT_TRUE(says(*repaired, "two equal corners"));
  EXPECT_TRUE(says(*repaired, "there twice"));
  EXPECT_TRUE(says(*repaired, "no triangle uses"));
}

TEST(MeshCheck, AFlatTriangleAtATJunctionIsStraightened) {
  // A cube with a vertex in the middle of one edge: one side uses it, the other closes the gap with a flat triangle.
  TriangleMesh mesh = boxMesh(Vec3(1, 1, 1), 1, 1, 1);
  const Triangle t = mesh.triangles[0];
  const Index middle = static_cast<Index>(mesh.vertices.size());
  mesh.vertices.push_back(0.5 * (mesh.vertices[t[0]] + mesh.vertices[t[1]]));
  mesh.triangles[0] = {t[0], middle, t[2]};
  mesh.triangles.push_back({middle, t[1], t[2]});
  mesh.triangles.push_back({t[0], t[1], middle});
  EXPECT_EQ(inspectMesh(mesh).degenerate_triangles, 1u);
  const Result<RepairedMesh> repaired = repairMesh(mesh);
  ASSERT_TRUE(repaired.ok()) << repaired.error().detail;
  EXPECT_TRUE(repaired->solid);
  EXPECT_TRUE(says(*repaired, "straightened 1 triangle")) << notes(*repaired);
  EXPECT_EQ(inspectMesh(repaired->mesh).degenerate_triangles, 0u);
  EXPECT_NEAR(signedVolume(repaired->mesh), 1.0, 1e-15);
}

TEST(MeshCheck, ConesThatTouchInAPointAreParted) {
  TriangleMesh mesh = shapes::tetrahedron();
  TriangleMesh other = shapes::turnedInsideOut(mesh);
  for (Vec3& p : other.vertices) p = -p;
  shapes::append(mesh, other);
  const Result<RepairedMesh> repaired = repairMesh(mesh);
  ASSERT_TRUE(repaired.ok());
  EXPECT_TRUE(repaired->solid);
  EXPECT_TRUE(says(*repaired, "touches itself in a point")) << notes(*repaired);
  EXPECT_EQ(repaired->mesh.vertices.size(), 8u);
  EXPECT_NEAR(signedVolume(repaired->mesh), 2.0 * signedVolume(shapes::tetrahedron()), 1e-15);
}

TEST(MeshCheck, RealMeshes) {
  const TriangleMesh liver = shapes::realMesh("liver-smooth.obj"), torus = shapes::realMesh("torus2_for_collision.obj");
  if (liver.empty() || torus.empty()) GTEST_SKIP() << "no real meshes beside the checkout";
  const Result<RepairedMesh> crossing = repairMesh(liver), embedded = repairMesh(torus);
  ASSERT_TRUE(crossing.ok()) << crossing.error().detail;
  EXPECT_TRUE(crossing->solid) << notes(*crossing);
  EXPECT_TRUE(crossing->self_intersecting);
  EXPECT_EQ(crossing->mesh.triangles.size(), liver.triangles.size());
  ASSERT_TRUE(embedded.ok()) << embedded.error().detail;
  EXPECT_TRUE(embedded->solid);
  EXPECT_FALSE(embedded->self_intersecting);
  EXPECT_TRUE(embedded->notes.empty()) << notes(*embedded);
}

}  // namespace mesh_check_test
}  // namespace meshless
