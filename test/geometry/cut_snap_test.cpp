// Cuts that move vertices onto their plane instead of making short edges.
#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/surgery/cut.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "shapes/random_organ.h"
#include "support/mesh_laws.h"

namespace meshless {
namespace cut_snap_test {

CutOptions snapping(double within) {
  CutOptions options;
  options.cap_points = kUsualCapPoints;
  options.snap = within;
  options.check_pieces = true;
  return options;
}

std::size_t edgesShorterThan(double length, const CutSurface& cut) {
  std::size_t count = 0;
  for (const CutPiece& piece : cut.pieces)
    for (const Triangle& t : piece.mesh.triangles)
      for (int k = 0; k < 3; ++k)
        count += (piece.mesh.vertices[t[(k + 1) % 3]] - piece.mesh.vertices[t[k]]).norm() < length;
  return count / 2;
}

double volumeOf(const CutSurface& cut) {
  double volume = 0.0;
  for (const CutPiece& piece : cut.pieces) volume += signedVolume(piece.mesh);
  return volume;
}

// Three cuts after each other, each through all pieces.
std::vector<TriangleMesh> cutThrice(const TriangleMesh& mesh, double within, std::uint64_t seed,
                                    std::size_t& short_edges) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const Box box = boundsOf(mesh.vertices);
  std::vector<TriangleMesh> all{mesh};
  for (std::uint32_t n = 0; n < 3; ++n) {
    const Plane plane{Vec3(normal(random), normal(random), normal(random)).normalized(), 0.5 * (box.min + box.max)};
    CutOptions options = snapping(within);
    options.cap_patch = n + 1;
    std::vector<TriangleMesh> next;
    for (const TriangleMesh& whole : all) {
      const Result<CutSurface> cut = cutByPlane(whole, plane, options);
      if (!cut) {
        EXPECT_EQ(cut.error().code, ErrorCode::kMissed) << cut.error().detail;
        next.push_back(whole);
        continue;
      }
      short_edges += edgesShorterThan(0.5e-3, *cut);
      for (const CutPiece& piece : cut->pieces) {
        EXPECT_TRUE(laws::isClosedOriented(piece.mesh));
        next.push_back(piece.mesh);
      }
    }
    all = std::move(next);
  }
  return all;
}

TEST(CutSnap, LeavesFewShortEdgesAndTheShapeAsItIs) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    const Result<TriangleMesh> organ = randomOrgan(seed, static_cast<int>(seed % 3), 0.2, 4120);
    ASSERT_TRUE(organ.ok());
    std::size_t before = 0, after = 0;
    const std::vector<TriangleMesh> plain = cutThrice(*organ, 0.0, seed, before);
    const std::vector<TriangleMesh> snapped = cutThrice(*organ, 2e-3, seed, after);
    EXPECT_GT(before, 60u);
    EXPECT_LT(after, before / 4);
    ASSERT_EQ(snapped.size(), plain.size());
    double sum = 0.0;
    for (std::size_t p = 0; p < plain.size(); ++p) {
      const double was = signedVolume(plain[p]);
      EXPECT_NEAR(signedVolume(snapped[p]), was, 1e-3 * was + 1e-4 * surfaceArea(plain[p])) << p;
      sum += signedVolume(snapped[p]);
    }
    EXPECT_NEAR(sum, signedVolume(*organ), 3e-4 * sum);
  }
}

TEST(CutSnap, MovesGoAlongFacesAndEdgesAndCornersAreKept) {
  const TriangleMesh box = boxMesh(Vec3(0.1, 0.08, 0.06), 10, 8, 6);
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 40; ++i) {
    const Plane plane{Vec3(normal(random), normal(random), normal(random)).normalized(),
                      0.015 * Vec3(normal(random), normal(random), normal(random))};
    const Result<CutSurface> cut = cutByPlane(box, plane, snapping(2e-3));
    if (!cut) continue;
    // A tenth of a millimetre of an edge or a corner may be given up.
    EXPECT_NEAR(volumeOf(*cut), signedVolume(box), 1e-4 * 0.048 * 2e-3) << i;
    std::size_t corners = 0;
    for (const CutPiece& piece : cut->pieces)
      for (std::size_t v = 0; v < piece.mesh.vertices.size(); ++v) {
        const Vec3 at = piece.mesh.vertices[v].cwiseAbs();
        if (piece.origins.insideCap(v)) continue;
        corners += (at - Vec3(0.05, 0.04, 0.03)).norm() < 1e-4 &&
                   piece.side == (plane.height(piece.mesh.vertices[v]) > 0 ? 1 : -1);
        const VertexOrigin origin = piece.origins[v];
        Vec3 mixed = Vec3::Zero();
        for (int k = 0; k < 4; ++k)
          if (origin.parents[k] != kNoIndex) mixed += origin.weights[k] * box.vertices[origin.parents[k]];
        EXPECT_LT((mixed - piece.mesh.vertices[v]).norm(), 1e-12);
        EXPECT_NEAR((at - Vec3(0.05, 0.04, 0.03)).maxCoeff(), 0.0, 1.01e-4);  // on the box's surface
      }
    EXPECT_EQ(corners, 8u) << i;
  }
}

TEST(CutSnap, NoTriangleTurnsOver) {
  const Result<TriangleMesh> organ = randomOrgan(1, 0, 0.2, 4120);
  ASSERT_TRUE(organ.ok());
  const auto areaOf = [](const TriangleMesh& mesh, const Triangle& t) -> Vec3 {
    return (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
  };
  Points normals(organ->vertices.size(), Vec3::Zero());
  for (const Triangle& t : organ->triangles)
    for (const Index v : t) normals[v] += areaOf(*organ, t);
  const Box box = boundsOf(organ->vertices);
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 20; ++i) {
    const Plane plane{Vec3(normal(random), normal(random), normal(random)).normalized(), 0.5 * (box.min + box.max)};
    CutOptions options = snapping(2e-2);  // farther than its edges are long
    options.cap_patch = 1;
    const Result<CutSurface> cut = cutByPlane(*organ, plane, options);
    ASSERT_TRUE(cut.ok()) << cut.error().detail;
    for (const CutPiece& piece : cut->pieces)
      for (std::size_t t = 0; t < piece.mesh.triangles.size(); ++t) {
        if (piece.mesh.patchOf(t) == options.cap_patch) continue;
        Vec3 outward = Vec3::Zero();
        for (const Index v : piece.mesh.triangles[t]) {
          const VertexOrigin origin = piece.origins[v];
          for (int k = 0; k < 4; ++k)
            if (origin.parents[k] != kNoIndex) outward += origin.weights[k] * normals[origin.parents[k]];
        }
        EXPECT_GT(areaOf(piece.mesh, piece.mesh.triangles[t]).dot(outward), 0.0);
      }
  }
}

TEST(CutSnap, ASliceThatIsThinnerThanItsReachIsCutAllTheSame) {
  const TriangleMesh box = boxMesh(Vec3(0.1, 0.08, 0.06), 10, 8, 6);
  for (const double thickness : {1e-3, 1e-4, 1e-5}) {
    const Result<CutSurface> cut = cutByPlane(box, {Vec3::UnitX(), Vec3(0.05 - thickness, 0, 0)}, snapping(2e-3));
    ASSERT_TRUE(cut.ok()) << cut.error().detail;
    ASSERT_EQ(cut->pieces.size(), 2u);
    const double volume = signedVolume(cut->pieces[1].mesh), expected = thickness * 0.08 * 0.06;
    EXPECT_LT(volume, expected * (1.0 + 1e-9)) << thickness;
    EXPECT_GT(volume, expected * (thickness < 1e-4 ? 0.5 : 1.0 - 1e-9)) << thickness;
  }
}

}  // namespace cut_snap_test
}  // namespace meshless
