#include "meshless_surgery/geometry/mesh/mend.h"

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "support/shapes.h"

namespace meshless {
namespace mend_test {

constexpr MeshRepair kAll[] = {MeshRepair::kNone, MeshRepair::kMend, MeshRepair::kWrap};

std::string notesOf(const RepairedMesh& mesh) {
  std::string all;
  for (const std::string& note : mesh.notes) all += note + "; ";
  return all;
}

bool says(const RepairedMesh& mesh, const std::string& words) { return notesOf(mesh).find(words) != std::string::npos; }

/// What it has become: closed, with the volume `expected` within that share, and free of crossings where it was
/// wrapped.
void expectSolid(const Result<RepairedMesh>& repaired, double expected, double share, const std::string& what) {
  ASSERT_TRUE(repaired.ok()) << what << ": " << repaired.error().detail;
  EXPECT_TRUE(repaired->solid) << what << ": " << notesOf(*repaired);
  const MeshReport report = inspectMesh(repaired->mesh, false);
  EXPECT_TRUE(report.closed()) << what;
  EXPECT_EQ(report.degenerate_triangles, 0u) << what;
  EXPECT_NEAR(report.signed_volume, expected, share * expected) << what << ": " << notesOf(*repaired);
}

void expectRefused(const TriangleMesh& mesh, MeshRepair how, const std::string& words) {
  const auto repaired = repairMesh(mesh, how);
  ASSERT_FALSE(repaired.ok()) << "should say: " << words;
  EXPECT_EQ(repaired.error().code, ErrorCode::kUnsuitableShape);
  EXPECT_NE(repaired.error().detail.find(words), std::string::npos) << repaired.error().detail;
}

const TriangleMesh& ball() {
  static const TriangleMesh mesh = sphereMesh(0.1, 0.012);
  return mesh;
}

/// Without its triangles above that height.
TriangleMesh openAbove(double z) {
  TriangleMesh open = ball();
  open.triangles.clear();
  for (const Triangle& t : ball().triangles)
    if (std::max({ball().vertices[t[0]].z(), ball().vertices[t[1]].z(), ball().vertices[t[2]].z()}) < z)
      open.triangles.push_back(t);
  return open;
}

/// A third triangle at an edge.
TriangleMesh withFin(TriangleMesh mesh) {
  const Triangle t = mesh.triangles[mesh.triangles.size() / 2];
  mesh.vertices.push_back(1.3 * mesh.vertices[t[0]]);
  mesh.triangles.push_back({t[0], t[1], static_cast<Index>(mesh.vertices.size() - 1)});
  return mesh;
}

/// Two boxes, the second one shifted; equal places are one vertex.
TriangleMesh boxesApart(const Vec3& shift) {
  TriangleMesh pair = boxMesh(Vec3(0.1, 0.1, 0.1), 0.05);
  const TriangleMesh box = pair;
  shapes::append(pair, box, shift);
  return withMergedVertices(pair);
}

TEST(Mend, SoundSurfacesStayAsTheyAreWhateverIsAsked) {
  for (const auto& [name, mesh] : shapes::allShapes()) {
    for (const MeshRepair how : kAll) {
      const auto repaired = repairMesh(mesh, how);
      ASSERT_TRUE(repaired.ok()) << name;
      EXPECT_EQ(repaired->mesh.vertices, mesh.vertices) << name;
      EXPECT_EQ(repaired->mesh.triangles, mesh.triangles) << name;
      EXPECT_TRUE(repaired->notes.empty()) << name << ": " << notesOf(*repaired);
    }
  }
}

TEST(Mend, ALargeHoleIsFilled) {
  const TriangleMesh open = openAbove(0.07);  // a rim of 0.45 m: too long for repairMesh
  ASSERT_FALSE(repairMesh(open)->solid);
  expectRefused(open, MeshRepair::kNone, "the surface is not closed: ");
  const double volume = signedVolume(ball());
  for (const MeshRepair how : {MeshRepair::kMend, MeshRepair::kWrap}) {
    const auto repaired = repairMesh(open, how);
    // The cap is flat: without its spherical segment, which has 6 % of the volume.
    expectSolid(repaired, 0.94 * volume, 0.05, "open");
    EXPECT_TRUE(says(*repaired, "filled 1 hole of ")) << notesOf(*repaired);
    EXPECT_TRUE(says(*repaired, "ml, the surface now encloses")) << notesOf(*repaired);
  }
}

// A share of next to nothing is no number: "+4.1e+17 %".
TEST(Mend, AChangeOfVolumeIsAShareOnlyWhereItIsOne) {
  for (const bool flat : {false, true}) {
    TriangleMesh mesh = boxMesh(Vec3(0.1, 0.1, 0.1), 1, 1, 1);
    if (flat)  // encloses nothing, but for rounding
      mesh = shapes::moved(
          {{Vec3(0, 0, 0), Vec3(0.1, 0, 0), Vec3(0.1, 0.1, 0), Vec3(0, 0.1, 0)}, {{0, 1, 2}, {0, 2, 3}}, {}},
          shapes::anyPose());
    else
      shapes::append(mesh, boxMesh(Vec3(0.1, 0.1, 0.1), 1, 1, 1), Vec3(0.05, 0, 0));
    const auto repaired = repairMesh(mesh, MeshRepair::kWrap);
    ASSERT_TRUE(repaired.ok()) << repaired.error().detail;
    EXPECT_TRUE(says(*repaired, "ml, the surface now encloses")) << notesOf(*repaired);
    EXPECT_EQ(says(*repaired, " %)"), !flat) << notesOf(*repaired);
  }
}

// The time that a patch takes grows with the square of its rim.
TEST(Mend, AHoleOfThousandsOfEdgesIsLeftOpen) {
  for (const Index edges : {100u, 3001u}) {
    TriangleMesh cup;  // with a ninth of its area open
    for (const double z : {0.0, -4.0})
      for (Index k = 0; k < edges; ++k)
        cup.vertices.emplace_back(std::cos(2.0 * M_PI * k / edges), std::sin(2.0 * M_PI * k / edges), z);
    for (Index k = 0; k < edges; ++k) {
      const Index next = (k + 1) % edges;
      cup.triangles.push_back({k, edges + k, next});
      cup.triangles.push_back({next, edges + k, edges + next});
    }
    for (Index low = edges, high = 2 * edges - 1; low + 1 < high; ++low, --high) {
      cup.triangles.push_back({low, high, low + 1});
      if (low + 2 < high) cup.triangles.push_back({low + 1, high, high - 1});
    }
    const auto mended = repairMesh(cup, MeshRepair::kMend);
    ASSERT_TRUE(mended.ok());
    EXPECT_EQ(mended->solid, edges == 100u) << edges << ": " << notesOf(*mended);
  }
}

TEST(Mend, AnOpenHalfStaysAShell) {
  const TriangleMesh half = openAbove(0.01);
  const auto plain = repairMesh(half);
  const auto mended = repairMesh(half, MeshRepair::kMend);
  ASSERT_TRUE(mended.ok());
  EXPECT_FALSE(mended->solid);
  EXPECT_EQ(mended->mesh.triangles, plain->mesh.triangles);
  EXPECT_EQ(mended->notes, plain->notes);
  // Wrapped it is a thick skin.
  const auto wrapped = repairMesh(half, MeshRepair::kWrap);
  ASSERT_TRUE(wrapped.ok());
  EXPECT_TRUE(wrapped->solid);
  EXPECT_LT(signedVolume(wrapped->mesh), 0.2 * signedVolume(ball()));
}

TEST(Mend, AFinIsTakenOff) {
  const TriangleMesh fin = withFin(ball());
  ASSERT_FALSE(repairMesh(fin).ok());
  expectRefused(fin, MeshRepair::kNone, "shared by up to 3 triangles");
  const auto mended = repairMesh(fin, MeshRepair::kMend);
  expectSolid(mended, signedVolume(ball()), 1e-9, "fin");
  EXPECT_EQ(mended->mesh.triangles.size(), ball().triangles.size());
  EXPECT_TRUE(says(*mended, "dropped 1 open piece")) << notesOf(*mended);
  expectSolid(repairMesh(fin, MeshRepair::kWrap), signedVolume(ball()), 0.05, "wrapped fin");
}

TEST(Mend, BodiesThatShareAnEdgeOrAFaceAreMended) {
  const double volume = 2e-3;
  for (const Vec3& shift : {Vec3(0.1, 0.1, 0.0), Vec3(0.1, 0.0, 0.0), Vec3(0.1, 0.1, 0.1)}) {
    const TriangleMesh pair = boxesApart(shift);
    expectSolid(repairMesh(pair, MeshRepair::kMend), volume, 1e-9, "pair");
    expectSolid(repairMesh(pair, MeshRepair::kWrap), volume, 0.1, "wrapped pair");
  }
  EXPECT_EQ(inspectMesh(repairMesh(boxesApart(Vec3(0.1, 0.1, 0.0)), MeshRepair::kMend)->mesh).components, 2u);
  expectRefused(boxesApart(Vec3(0.1, 0.1, 0.0)), MeshRepair::kNone, "shared by up to 4 triangles");
}

TEST(Mend, AllAtOnce) {
  TriangleMesh dirty = withFin(openAbove(0.08));
  for (std::size_t f = 0; f < dirty.triangles.size(); f += 3) std::swap(dirty.triangles[f][0], dirty.triangles[f][1]);
  TriangleMesh soup;  // each triangle with vertices of its own, and some of them twice
  for (std::size_t f = 0; f < dirty.triangles.size(); ++f)
    for (int times = 0; times < (f % 7 == 0 ? 2 : 1); ++times) {
      const Index n = static_cast<Index>(soup.vertices.size());
      for (const Index v : dirty.triangles[f]) soup.vertices.push_back(dirty.vertices[v]);
      soup.triangles.push_back({n, n + 1, n + 2});
    }
  soup.triangles.push_back({0, 0, 1});
  expectRefused(soup, MeshRepair::kNone, "not manifold");
  expectSolid(repairMesh(soup, MeshRepair::kMend), 0.97 * signedVolume(ball()), 0.03, "all");
  expectSolid(repairMesh(soup, MeshRepair::kWrap), 0.97 * signedVolume(ball()), 0.05, "all, wrapped");
}

TEST(Mend, CrossingsAreWrappedAway) {
  TriangleMesh crossing = ball();
  shapes::append(crossing, ball(), Vec3(0.08, 0.0, 0.0));
  const auto none = repairMesh(crossing, MeshRepair::kNone);
  ASSERT_TRUE(none.ok());
  EXPECT_TRUE(none->self_intersecting);
  EXPECT_TRUE(says(*none, "crosses itself"));
  const auto wrapped = repairMesh(crossing, MeshRepair::kWrap);
  // Of two spheres, r = 1 and d = 0.8 apart: pi (4 + d / 2)(2 - d)^2 / 12 is in both.
  const double both = M_PI / 12.0 * 4.4 * 1.2 * 1.2 * 1e-3;
  expectSolid(wrapped, 2.0 * signedVolume(ball()) - both, 0.05, "crossing");
  EXPECT_FALSE(wrapped->self_intersecting);
  EXPECT_EQ(inspectMesh(wrapped->mesh).self_intersections, 0u);
  EXPECT_TRUE(says(*wrapped, "wrapped it")) << notesOf(*wrapped);
}

TEST(Mend, AMoebiusStripAndWhatHasNoAreaAreRefused) {
  TriangleMesh strip;
  constexpr int kTurns = 24;
  for (int k = 0; k < kTurns; ++k) {
    const double angle = 2.0 * M_PI * k / kTurns;
    const Vec3 out(std::cos(angle), std::sin(angle), 0.0), up = Vec3::UnitZ();
    const Vec3 across = std::cos(0.5 * angle) * out + std::sin(0.5 * angle) * up;
    strip.vertices.push_back(out + 0.2 * across);
    strip.vertices.push_back(out - 0.2 * across);
  }
  for (Index k = 0; k < kTurns; ++k) {
    const bool last = k + 1 == kTurns;
    const Index a = 2 * k, b = 2 * k + 1, c = last ? 1 : 2 * k + 2, d = last ? 0 : 2 * k + 3;
    strip.triangles.push_back({a, c, b});
    strip.triangles.push_back({b, c, d});
  }
  expectRefused(strip, MeshRepair::kNone, "one side only");
  expectRefused(strip, MeshRepair::kMend, "repair wrap may");
  EXPECT_TRUE(repairMesh(strip, MeshRepair::kWrap).ok());
  TriangleMesh flat = ball();
  for (Vec3& p : flat.vertices) p.y() = p.z() = 0.0;
  TriangleMesh broken = ball();
  broken.vertices[3].x() = std::nan("");
  TriangleMesh wild = ball();
  wild.triangles[5][1] = 1000000;
  for (const MeshRepair how : kAll) {
    expectRefused({}, how, "empty");
    expectRefused(flat, how, "no triangle has an area");
    expectRefused(broken, how, "vertex 3 is not finite");
    expectRefused(wild, how, "names vertex 1000000");
  }
}

TEST(Mend, ScaleChangesNothing) {
  for (const double scale : {1e-3, 1e3}) {
    TriangleMesh scaled = withFin(openAbove(0.08));
    for (Vec3& p : scaled.vertices) p *= scale;
    const double expected = 0.97 * signedVolume(ball()) * scale * scale * scale;
    for (const MeshRepair how : {MeshRepair::kMend, MeshRepair::kWrap})
      expectSolid(repairMesh(scaled, how), expected, 0.05, "scaled");
  }
}

}  // namespace mend_test
}  // namespace meshless
