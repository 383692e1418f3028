#include "geometry/mesh/unite_parts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mend.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "support/mesh_laws.h"
#include "support/plane_cut.h"
#include "support/random.h"
#include "support/shapes.h"

namespace meshless {
namespace unite_parts_test {

TriangleMesh together(const std::vector<std::pair<TriangleMesh, Vec3>>& parts) {
  TriangleMesh all;
  for (const auto& [mesh, shift] : parts) shapes::append(all, mesh, shift);
  return all;
}

std::string notesOf(const RepairedMesh& mesh) {
  std::string all;
  for (const std::string& note : mesh.notes) all += note + "; ";
  for (const std::string& warning : mesh.warnings) all += "warning: " + warning + "; ";
  return all;
}

bool says(const RepairedMesh& mesh, const std::string& words) { return notesOf(mesh).find(words) != std::string::npos; }

/// What mend makes of it: closed, oriented, free of crossings, of that volume within that share.
RepairedMesh mended(const TriangleMesh& mesh, double volume, double share, const std::string& what) {
  const auto repaired = repairMesh(mesh, MeshRepair::kMend);
  EXPECT_TRUE(repaired.ok()) << what;
  if (!repaired.ok()) return {};
  EXPECT_TRUE(repaired->solid) << what;
  EXPECT_TRUE(laws::isClosedOriented(repaired->mesh)) << what;
  // Where it touches itself each side has vertices of its own, at the same places.
  const MeshReport report = inspectMesh(withMergedVertices(repaired->mesh));
  EXPECT_EQ(report.degenerate_triangles, 0u) << what;
  EXPECT_EQ(report.self_intersections, 0u) << what << ": " << notesOf(*repaired);
  EXPECT_NEAR(report.signed_volume, volume, share * std::abs(volume)) << what << ": " << notesOf(*repaired);
  return *repaired;
}

TriangleMesh ball(double radius = 0.1) { return sphereMesh(radius, 0.2 * radius); }
double volumeOfBall(double radius = 0.1) { return signedVolume(ball(radius)); }

/// Every triangle with vertices of its own, as STL has them.
TriangleMesh soupOf(const TriangleMesh& mesh) {
  TriangleMesh soup;
  for (const Triangle& t : mesh.triangles) {
    const Index n = static_cast<Index>(soup.vertices.size());
    for (const Index v : t) soup.vertices.push_back(mesh.vertices[v]);
    soup.triangles.push_back({n, n + 1, n + 2});
  }
  return soup;
}

TEST(UniteParts, SpheresHaveTheVolumeThatIsInOneOfThem) {
  for (const double d : {0.03, 0.08, 0.1, 0.17})
    for (const Vec3& way : {Vec3(1, 0, 0), Vec3(Vec3(1, 1, 0).normalized()), Vec3(Vec3(0.3, -0.7, 0.5).normalized())})
      for (const Pose& pose : {Pose{}, shapes::anyPose()}) {
        const TriangleMesh two = shapes::moved(together({{ball(), Vec3::Zero()}, {ball(), d * way}}), pose);
        // Of two spheres, r = 1 and d apart: pi (4 + d)(2 - d)^2 / 12 is in both.
        const double x = d / 0.1, both = (4.0 + x) * (2.0 - x) * (2.0 - x) / 16.0;
        const auto one = mended(two, (2.0 - both) * volumeOfBall(), 4e-3, "spheres " + std::to_string(d));
        EXPECT_TRUE(says(one, "2 parts that overlap were united: volume ")) << notesOf(one);
        EXPECT_EQ(one.components, 1u);
      }
}

// The oracle counts cubes of a grid. Faces lie in one plane, edges on each other, boxes in boxes, more often than not.
TEST(UniteParts, BoxesHaveTheVolumeOfTheCubesThatTheyFill) {
  test::Random random(7);
  constexpr double kCube = 1.0 / 64.0;
  for (int trial = 0; trial < 60; ++trial) {
    TriangleMesh boxes;
    std::set<std::array<int, 3>> filled;
    const int count = random.integer(2, 5);
    for (int k = 0; k < count; ++k) {
      std::array<int, 3> low, size;
      for (int d = 0; d < 3; ++d) {
        low[d] = random.integer(0, 5);
        size[d] = random.integer(1, 4);
      }
      for (int i = 0; i < size[0]; ++i)
        for (int j = 0; j < size[1]; ++j)
          for (int l = 0; l < size[2]; ++l) filled.insert({low[0] + i, low[1] + j, low[2] + l});
      const Vec3 extent = kCube * Vec3(size[0], size[1], size[2]);
      shapes::append(boxes, boxMesh(extent, 1, 1, 1), kCube * Vec3(low[0], low[1], low[2]) + 0.5 * extent);
    }
    mended(boxes, kCube * kCube * kCube * static_cast<double>(filled.size()), 1e-9, "trial " + std::to_string(trial));
  }
}

TEST(UniteParts, BoxesThatShareAFaceAreOne) {
  const TriangleMesh box = boxMesh(Vec3(0.1, 0.1, 0.1), 0.05);
  for (const Vec3& shift : {Vec3(0.1, 0, 0), Vec3(0.1, 0.03, 0), Vec3(0.1, 0.03, 0.02), Vec3(0.05, 0, 0)}) {
    const auto one =
        mended(together({{box, Vec3::Zero()}, {box, shift}}), 1e-3 + 1e-2 * std::min(shift.x(), 0.1), 1e-9, "boxes");
    EXPECT_EQ(one.components, 1u) << shift.transpose();
  }
}

TEST(UniteParts, AsStlHasThem) {
  const TriangleMesh two = together({{ball(), Vec3::Zero()}, {ball(), Vec3(0.07, 0.02, 0)}, {ball(), Vec3(1, 0, 0)}});
  const double volume = signedVolume(repairMesh(two, MeshRepair::kMend)->mesh);
  EXPECT_LT(volume, 2.7 * volumeOfBall());
  mended(soupOf(two), volume, 1e-12, "soup");
}

TEST(UniteParts, PartsThatMeetNothingStayAsTheyAre) {
  const TriangleMesh far = together({{ball(), Vec3::Zero()}, {ball(0.05), Vec3(0.3, 0, 0)}});
  const auto same = mended(far, volumeOfBall() + volumeOfBall(0.05), 1e-12, "far");
  EXPECT_EQ(same.mesh.vertices, far.vertices);
  EXPECT_EQ(same.mesh.triangles, far.triangles);
  EXPECT_TRUE(same.notes.empty()) << notesOf(same);

  // Beside others that overlap, too.
  TriangleMesh three = together({{ball(), Vec3(0.0, 1.0, 0.0)}, {ball(), Vec3(0.05, 1.0, 0.0)}});
  shapes::append(three, ball(0.05));
  const auto two = mended(three, signedVolume(repairMesh(three, MeshRepair::kMend)->mesh), 1e-12, "beside");
  EXPECT_EQ(two.components, 2u);
  for (const Vec3& p : ball(0.05).vertices)
    EXPECT_EQ(std::count(two.mesh.vertices.begin(), two.mesh.vertices.end(), p), 1) << p.transpose();
}

TEST(UniteParts, InwardsIsACavityAndOutwardsIsTissue) {
  const TriangleMesh hole = shapes::turnedInsideOut(ball(0.04)), lump = ball(0.04);
  const double all = volumeOfBall(), inner = volumeOfBall(0.04);
  for (const bool inside_out : {false, true}) {
    const auto turned = [&](TriangleMesh mesh) { return inside_out ? shapes::turnedInsideOut(std::move(mesh)) : mesh; };
    EXPECT_EQ(mended(turned(together({{ball(), Vec3::Zero()}, {hole, Vec3(0.02, 0, 0)}})), all - inner, 1e-9, "cavity")
                  .components,
              2u);
    const auto swallowed =
        mended(turned(together({{lump, Vec3(0.02, 0, 0)}, {ball(), Vec3::Zero()}})), all, 1e-9, "lump");
    EXPECT_EQ(swallowed.components, 1u);
    EXPECT_TRUE(says(swallowed, "warning: 1 part inside of another is turned as it is")) << notesOf(swallowed);
    // An island in a cavity, a cavity of a part that is swallowed.
    mended(turned(together({{ball(), Vec3::Zero()}, {hole, Vec3::Zero()}, {ball(0.02), Vec3::Zero()}})),
           all - inner + volumeOfBall(0.02), 1e-9, "island");
    mended(turned(together(
               {{ball(), Vec3::Zero()}, {lump, Vec3::Zero()}, {shapes::turnedInsideOut(ball(0.02)), Vec3::Zero()}})),
           all, 1e-9, "cavity of a part inside");
  }
  // With none it is a cavity, however it is turned.
  const auto kept = repairMesh(together({{ball(), Vec3::Zero()}, {lump, Vec3::Zero()}}), MeshRepair::kNone);
  EXPECT_NEAR(signedVolume(kept->mesh), all - inner, 1e-9 * all);
}

// Walls of segmentations are thin, and their cavities reach through them; what lies mostly outside is a lobe that is
// turned anyhow.
TEST(UniteParts, ACavityThatReachesThroughTheSurfaceStaysAHoleAndALobeIsTissue) {
  const double all = volumeOfBall(0.04), inner = volumeOfBall(0.03);
  for (const bool inside_out : {false, true}) {
    const auto repaired = [&](const TriangleMesh& other, double shift) {
      const TriangleMesh both = together({{ball(0.04), Vec3::Zero()}, {other, Vec3(shift, 0, 0)}});
      return *repairMesh(inside_out ? shapes::turnedInsideOut(both) : both, MeshRepair::kMend);
    };
    const TriangleMesh hole = shapes::turnedInsideOut(ball(0.03));
    const RepairedMesh through = repaired(hole, 0.0103), inside = repaired(hole, 0.003),
                       tissue = repaired(ball(0.03), 0.0103), lobe = repaired(hole, 0.05);
    EXPECT_TRUE(says(through,
                     "warning: a part of 111 ml that is turned inwards is a hole, and reaches through the "
                     "surface: 0.0461 ml of its 111 ml"))
        << notesOf(through);
    EXPECT_EQ(through.warnings.size(), 1u) << notesOf(through);
    EXPECT_NEAR(signedVolume(through.mesh), all - inner, 1e-3 * all) << "what lies outside is not taken off";
    EXPECT_TRUE(inside.warnings.empty()) << notesOf(inside);
    EXPECT_NEAR(signedVolume(inside.mesh), all - inner, 1e-9 * all);
    EXPECT_TRUE(tissue.warnings.empty()) << notesOf(tissue);
    EXPECT_TRUE(says(lobe, "warning: a part of 111 ml is turned against a larger one that it reaches into"))
        << notesOf(lobe);
    EXPECT_GT(signedVolume(lobe.mesh), 1.2 * all);
  }
}

TEST(UniteParts, CavitiesThatOverlapAreOneAndAThirdPartFillsThem) {
  const TriangleMesh hole = shapes::turnedInsideOut(ball(0.03)), outer = ball();
  const double all = volumeOfBall(), inner = volumeOfBall(0.03);
  const double both = signedVolume(
      repairMesh(together({{ball(0.03), Vec3::Zero()}, {ball(0.03), Vec3(0.02, 0.01, 0)}}), MeshRepair::kMend)->mesh);
  EXPECT_EQ(mended(together({{outer, Vec3::Zero()}, {hole, Vec3::Zero()}, {hole, Vec3(0.02, 0.01, 0)}}), all - both,
                   1e-9, "cavities")
                .components,
            2u);
  // A lump in the tissue that reaches into a cavity; the same from outside.
  const double into = all - (both - inner);
  mended(together({{outer, Vec3::Zero()}, {hole, Vec3::Zero()}, {ball(0.03), Vec3(0.02, 0.01, 0)}}), into, 1e-9,
         "lump");
  // One that a part from outside covers whole is gone.
  const TriangleMesh cover = ball(0.06), small = shapes::turnedInsideOut(ball(0.02));
  const TriangleMesh covered = together({{outer, Vec3::Zero()}, {cover, Vec3(0.06, 0, 0)}});
  TriangleMesh with_cavity = covered;
  shapes::append(with_cavity, small, Vec3(0.05, 0, 0));
  mended(with_cavity, signedVolume(repairMesh(covered, MeshRepair::kMend)->mesh), 1e-9, "covered");
  const TriangleMesh rod = boxMesh(Vec3(0.3, 0.01, 0.01), 0.01);
  const double rod_alone =
      signedVolume(repairMesh(together({{outer, Vec3::Zero()}, {rod, Vec3::Zero()}}), MeshRepair::kMend)->mesh);
  const double in_hole =
      signedVolume(rod) + inner -
      signedVolume(repairMesh(together({{ball(0.03), Vec3::Zero()}, {rod, Vec3::Zero()}}), MeshRepair::kMend)->mesh);
  const auto filled = mended(together({{outer, Vec3::Zero()}, {hole, Vec3::Zero()}, {rod, Vec3::Zero()}}),
                             rod_alone - inner + in_hole, 1e-9, "rod");
  EXPECT_TRUE(says(filled, "is a hole, but 5.91 ml of its 111 ml (5.3 %) lie in the tissue of")) << notesOf(filled);
}

TEST(UniteParts, WhatIsCutAfterwardsAddsUp) {
  TriangleMesh organ = liverMesh();
  const Box box = boundsOf(organ.vertices);
  shapes::append(organ, sphereMesh(0.03, 0.005),
                 0.5 * (box.min + box.max) + Vec3(0.0, 0.0, 0.4 * (box.max.z() - box.min.z())));
  const auto one = repairMesh(organ, MeshRepair::kMend);
  ASSERT_TRUE(one.ok());
  ASSERT_EQ(one->components, 1u) << notesOf(*one);
  const double volume = signedVolume(one->mesh);
  for (const Vec3& normal : {Vec3(1, 0, 0), Vec3(Vec3(0.4, 0.6, 0.7).normalized())}) {
    const auto pieces = cutByPlane(one->mesh, {normal, 0.5 * (box.min + box.max)});
    ASSERT_TRUE(pieces.ok()) << pieces.error().detail;
    double sum = 0.0;
    for (const CutPiece& piece : pieces->pieces) {
      EXPECT_TRUE(laws::isClosedOriented(piece.mesh));
      EXPECT_GT(signedVolume(piece.mesh), 0.0);
      sum += signedVolume(piece.mesh);
    }
    EXPECT_NEAR(sum, volume, 1e-9 * volume);
  }
}

TEST(UniteParts, APartThatCrossesItselfIsWhatItWindsAround) {
  TriangleMesh knot = ball();
  knot.vertices[0] = -1.5 * knot.vertices[0];  // drawn out through the other side
  const TriangleMesh two = together({{knot, Vec3::Zero()}, {ball(0.05), Vec3(0.1, 0, 0)}, {ball(), Vec3(1, 0, 0)}});
  ASSERT_TRUE(repairMesh(two)->self_intersecting);
  for (const TriangleMesh& mesh : {knot, two}) {
    const auto one = repairMesh(mesh, MeshRepair::kMend);
    ASSERT_TRUE(one.ok()) << one.error().detail;
    EXPECT_FALSE(one->self_intersecting) << notesOf(*one);
    EXPECT_TRUE(laws::isClosedOriented(one->mesh));
    EXPECT_TRUE(says(*one, "the surface crossed itself, ")) << notesOf(*one);
    // The tip that came out is wound around the wrong way.
    EXPECT_TRUE(says(*one, "warning: 0.425 ml of its ")) << notesOf(*one);
    EXPECT_TRUE(says(*one, " are wound around inside out, and were left out")) << notesOf(*one);
    const SolidQuery before(mesh), after(one->mesh);
    test::Random random(3);
    for (int k = 0; k < 2000; ++k) {
      const Vec3 p = random.vector(0.16);
      EXPECT_EQ(before.contains(p), after.contains(p)) << p.transpose();
    }
  }
}

TEST(UniteParts, NoneSaysWhatWould) {
  const auto none = repairMesh(together({{ball(), Vec3::Zero()}, {ball(), Vec3(0.05, 0, 0)}}), MeshRepair::kNone);
  ASSERT_TRUE(none.ok());
  EXPECT_TRUE(none->self_intersecting);
  EXPECT_TRUE(says(*none, "it has 2 parts: repair mend unites those that overlap")) << notesOf(*none);
}

TEST(UniteParts, ScaleAndOrderChangeNothing) {
  const TriangleMesh a =
      together({{ball(), Vec3::Zero()}, {ball(0.07), Vec3(0.06, 0.05, 0.04)}, {ball(0.05), Vec3(-0.1, 0, 0)}});
  const TriangleMesh b =
      together({{ball(0.05), Vec3(-0.1, 0, 0)}, {ball(0.07), Vec3(0.06, 0.05, 0.04)}, {ball(), Vec3::Zero()}});
  const double volume = signedVolume(repairMesh(a, MeshRepair::kMend)->mesh);
  mended(b, volume, 1e-9, "order");
  for (const double scale : {1e-3, 1e3})
    mended(shapes::moved(a, Pose{}, scale), volume * scale * scale * scale, 1e-9, "scale");
}

}  // namespace unite_parts_test
}  // namespace meshless
