// Which features meet, and on which side they are.
#include "meshless_surgery/contact/feature_pairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "meshless_surgery/geometry/mesh/primitives.h"

namespace meshless {
namespace feature_pairs_test {

/// A surface whose vertices are particles, somewhere.
struct Placed {
  Placed(TriangleMesh of_mesh, const Vec3& at, const Vec3& velocity = Vec3::Zero(), double h = 0.01)
      : mesh(std::move(of_mesh)), surface(mesh, ownSupports(static_cast<Index>(mesh.vertices.size()))) {
    for (Vec3& p : mesh.vertices) p += at;
    const Points velocities(mesh.vertices.size(), velocity);
    placeFrame(surface, mesh.vertices.data(), velocities.data(), h, frame);
    placeNormalBoxes(surface, frame);
  }
  TriangleMesh mesh;
  ContactSurface surface;
  SurfaceFrame frame;
};

PairSearch between(const Placed& a, const Placed& b) {
  PairSearch search;
  search.a = {&a.surface, &a.frame};
  search.b = {&b.surface, &b.frame};
  search.h = 0.01;
  search.length = std::min(a.surface.edge_length, b.surface.edge_length);
  return search;
}

std::vector<FeaturePair> vertexFace(const PairSearch& search, std::vector<RememberedSide>* sides = nullptr) {
  SearchScratch scratch;
  findVertexFace(search, scratch);
  if (sides) *sides = scratch.sides;
  return scratch.pairs;
}

TEST(FeaturePairs, AVertexAboveAFaceMeetsItWithTheGapBetweenThem) {
  const Placed low(boxMesh(Vec3(1, 1, 1), 4, 4, 4), Vec3::Zero());
  const Placed high(boxMesh(Vec3(0.4, 0.4, 0.4), 1, 1, 1), Vec3(0.03, 0.02, 0.71));
  const std::vector<FeaturePair> pairs = vertexFace(between(high, low));
  ASSERT_EQ(pairs.size(), 4u) << "the lower corners";
  for (const FeaturePair& pair : pairs) {
    EXPECT_NEAR((pair.normal - Vec3::UnitZ()).norm(), 0.0, 1e-12);
    EXPECT_NEAR(pair.gap, 0.01, 1e-12);
    double of_a = 0.0, of_b = 0.0;
    for (int k = 0; k < 4; ++k) (k < pair.of_a ? of_a : of_b) += pair.shares[k];
    EXPECT_NEAR(of_a, 1.0, 1e-12);
    EXPECT_NEAR(of_b, -1.0, 1e-12);
  }
}

TEST(FeaturePairs, NothingIsMetBeyondTheMarginAndTheWayOfTheFrame) {
  const Placed low(boxMesh(Vec3(1, 1, 1), 4, 4, 4), Vec3::Zero());
  const Vec3 at(0.03, 0.02, 0.8);
  EXPECT_TRUE(vertexFace(between(Placed(boxMesh(Vec3(0.4, 0.4, 0.4), 1, 1, 1), at), low)).empty());
  EXPECT_EQ(vertexFace(between(Placed(boxMesh(Vec3(0.4, 0.4, 0.4), 1, 1, 1), at, Vec3(0, 0, -10)), low)).size(), 4u);
}

// What parts, or goes along the plane across what is between two features, brings them no nearer.
TEST(FeaturePairs, PartingAndSlidingAreNoApproach) {
  const Placed low(boxMesh(Vec3(1, 1, 1), 20, 20, 20), Vec3::Zero());
  const auto foundOf = [&low](const Vec3& velocity) {
    const Placed high(boxMesh(Vec3(0.4, 0.4, 0.4), 8, 8, 8), Vec3(0.013, 0.009, 0.76), velocity);
    const PairSearch search = between(high, low);
    SearchScratch scratch;
    findVertexFace(search, scratch);
    return scratch.pairs.size();
  };
  const auto still = foundOf(Vec3::Zero());
  EXPECT_EQ(foundOf(Vec3(0, 0, 10)), still);
  EXPECT_EQ(foundOf(Vec3(10, 0, 0)), still);
  EXPECT_GT(foundOf(Vec3(0, 0, -10)), still);
}

TEST(FeaturePairs, AVertexInsideGoesOutByTheNearFaceThatItOpposes) {
  const Placed low(boxMesh(Vec3(1, 1, 1), 4, 4, 4), Vec3::Zero());
  const Placed high(boxMesh(Vec3(0.4, 0.4, 0.4), 1, 1, 1), Vec3(0.03, 0.02, 0.65));
  std::vector<RememberedSide> sides;
  const std::vector<FeaturePair> pairs = vertexFace(between(high, low), &sides);
  ASSERT_EQ(pairs.size(), 4u);
  for (const FeaturePair& pair : pairs) {
    EXPECT_NEAR((pair.normal - Vec3::UnitZ()).norm(), 0.0, 1e-12);
    EXPECT_NEAR(pair.gap, -0.05, 1e-12);
  }
  ASSERT_EQ(sides.size(), 4u);
  EXPECT_NEAR(sides[0].depth, 0.05, 1e-12);
}

// Turned inside out, its faces oppose nothing: what it touches is held by the side that it was on.
TEST(FeaturePairs, WhatTouchesInsideOutIsHeldOnTheSideWhereItWas) {
  const Placed low(boxMesh(Vec3(1, 1, 1), 4, 4, 4), Vec3::Zero());
  TriangleMesh inside_out = boxMesh(Vec3(0.4, 0.4, 0.4), 1, 1, 1);
  for (Vec3& p : inside_out.vertices) p.z() = -p.z();
  const auto heldAt = [&](double height, const std::vector<RememberedSide>& known, std::vector<RememberedSide>& now) {
    const Placed high(inside_out, Vec3(0.03, 0.02, 0.7 + height));
    PairSearch search = between(high, low);
    search.first = false;
    search.remembered = known.data();
    search.remembered_count = known.size();
    SearchScratch scratch;
    findVertexFace(search, scratch);
    now = scratch.sides;
    std::size_t above = 0;
    for (const FeaturePair& pair : scratch.pairs) above += pair.normal.z() > 0.999;
    return above;
  };
  std::vector<RememberedSide> sides, later;
  EXPECT_EQ(heldAt(0.01, {}, sides), 0u);
  ASSERT_EQ(sides.size(), 4u) << "though no row pushes them";
  for (const double height : {0.01, 1e-6, -0.01}) {
    EXPECT_GE(heldAt(height, sides, later), 4u) << height;
    EXPECT_EQ(later.size(), 4u) << "for as long as they touch";
  }
}

// The halves of a cut block lie on each other: each of the twin faces is outside of the other.
TEST(FeaturePairs, TwinFacesOfACutAreOnTheRightSides) {
  const Placed left(boxMesh(Vec3(1, 1, 1), 4, 4, 4), Vec3(-0.5, 0, 0));
  const Placed right(boxMesh(Vec3(1, 1, 1), 4, 4, 4), Vec3(0.5, 0, 0));
  for (const bool of_left : {true, false}) {
    const std::vector<FeaturePair> pairs = vertexFace(of_left ? between(left, right) : between(right, left));
    std::size_t met = 0;
    for (const FeaturePair& pair : pairs) {
      EXPECT_NEAR(pair.gap, 0.0, 1e-9);
      if (pair.order != 0) continue;
      EXPECT_NEAR((pair.normal - (of_left ? -1.0 : 1.0) * Vec3::UnitX()).norm(), 0.0, 1e-9);
      ++met;
    }
    EXPECT_EQ(met, 25u);
  }
}

// The middle of the top is drawn down through the body and out of its bottom: faces of this spike look into it. Who is
// beside it is outside, though behind the nearest face.
TEST(FeaturePairs, WhoIsOutsideBesideAFoldedSpikeIsNotTakenForOneInside) {
  TriangleMesh mesh = boxMesh(Vec3(1, 1, 1), 4, 4, 4);
  const auto top = std::find_if(mesh.vertices.begin(), mesh.vertices.end(),
                                [](const Vec3& p) { return (p - Vec3(0, 0, 0.5)).norm() < 1e-9; });
  ASSERT_NE(top, mesh.vertices.end());
  top->z() = -0.9;
  const Placed spike(mesh, Vec3::Zero());
  const Placed beside(boxMesh(Vec3(0.2, 0.2, 0.2), 2, 2, 2), Vec3(0.15, 0.0, -0.72));
  std::vector<RememberedSide> sides;
  const std::vector<FeaturePair> pairs = vertexFace(between(beside, spike), &sides);
  ASSERT_FALSE(pairs.empty());
  for (const FeaturePair& pair : pairs) {
    EXPECT_GE(pair.gap, 0.0);
    EXPECT_GT(pair.normal.x(), 0.0);
  }
  for (const RememberedSide& side : sides) EXPECT_EQ(side.depth, 0.0);
}

// A bar lies across another: between their ends nothing but points on their ridges meets the other's faces.
TEST(FeaturePairs, LongRidgesMeetByPointsOneSpacingApart) {
  const Placed low(boxMesh(Vec3(2, 0.2, 0.2), 1, 1, 1), Vec3::Zero());
  const Placed high(boxMesh(Vec3(0.2, 2, 0.2), 1, 1, 1), Vec3(0.013, 0.02, 0.21));
  PairSearch search = between(high, low);
  EXPECT_TRUE(vertexFace(search).empty()) << "without a spacing";
  for (const double spacing : {0.15, 0.05}) {
    search.spacing = spacing;
    const std::vector<FeaturePair> pairs = vertexFace(search);
    std::size_t down = 0;
    std::set<std::array<Index, 2>> names;
    for (const FeaturePair& pair : pairs) {
      ASSERT_EQ(pair.of_a, 2);
      if (pair.normal.z() < 0.99) continue;
      ++down;
      names.insert(pair.features);
      EXPECT_NEAR(pair.gap, 0.01, 1e-12);
      Vec3 between = Vec3::Zero();
      for (int k = 0; k < 5; ++k) between += pair.shares[k] * (k < 2 ? high : low).frame.vertices[pair.vertices[k]];
      EXPECT_NEAR((between - Vec3(0, 0, 0.01)).norm(), 0.0, 1e-12);
    }
    EXPECT_EQ(names.size(), down) << "each has a name of its own";
    EXPECT_NEAR(static_cast<double>(down), 2.0 * 0.2 / spacing, 2.0) << "two ridges cross a width of 0.2";
  }
}

TEST(FeaturePairs, AThinSlabDoesNotMeetItsOwnOtherSide) {
  const Placed slab(boxMesh(Vec3(1, 1, 0.01), 8, 8, 1), Vec3::Zero());
  PairSearch search = between(slab, slab);
  search.self = PairSearch::Self::kAll;
  EXPECT_TRUE(vertexFace(search).empty());
}

// Rows there would keep it so, however thick it is at rest.
TEST(FeaturePairs, ASlabThatIsTurnedInsideOutDoesNotMeetItself) {
  for (const double thick : {0.01, 1.0}) {
    Placed slab(boxMesh(Vec3(1, 1, thick), 8, 8, 1), Vec3::Zero());
    Points inverted = slab.mesh.vertices;
    for (Vec3& p : inverted) p.z() *= -0.01 / thick;
    const Points still(inverted.size(), Vec3::Zero());
    placeFrame(slab.surface, inverted.data(), still.data(), 0.01, slab.frame);
    placeNormalBoxes(slab.surface, slab.frame);
    PairSearch search = between(slab, slab);
    search.self = PairSearch::Self::kAll;
    EXPECT_TRUE(vertexFace(search).empty()) << thick;
  }
}

// Two flaps of one surface, one over the other: each vertex that is near enough meets the other flap.
TEST(FeaturePairs, ASurfaceMeetsItselfWhereItsFlapsFaceEachOther) {
  TriangleMesh flaps = boxMesh(Vec3(1, 1, 0.1), 8, 8, 1);
  const TriangleMesh upper = boxMesh(Vec3(1, 1, 0.1), 8, 8, 1);
  const Index lower = static_cast<Index>(flaps.vertices.size());
  for (const Vec3& p : upper.vertices) flaps.vertices.push_back(p + Vec3(0.03, 0.02, 0.11));
  for (const Triangle& t : upper.triangles) flaps.triangles.push_back({t[0] + lower, t[1] + lower, t[2] + lower});
  const Placed both(flaps, Vec3::Zero());
  PairSearch search = between(both, both);
  search.self = PairSearch::Self::kAll;
  const std::vector<FeaturePair> pairs = vertexFace(search);
  EXPECT_GT(pairs.size(), 100u) << "of 2 x 81 vertices";
  for (const FeaturePair& pair : pairs) {
    EXPECT_NEAR(pair.gap, 0.01, 1e-12);
    EXPECT_NE(pair.vertices[0] < lower, pair.vertices[1] < lower);
  }
}

TEST(FeaturePairs, ASphereMeetsEachFeatureOnce) {
  const Placed block(boxMesh(Vec3(1, 1, 1), 2, 2, 2), Vec3::Zero());
  PairSearch search = between(block, block);
  std::vector<FeaturePair> pairs;
  findSphere(search, Vec3(0.0, 0.0, 0.59), 0.1, Vec3::Zero(), pairs);
  ASSERT_EQ(pairs.size(), 1u) << "the vertex below it, around which there are six faces";
  EXPECT_NEAR(pairs[0].gap, -0.01, 1e-12);
  EXPECT_NEAR((pairs[0].normal + Vec3::UnitZ()).norm(), 0.0, 1e-12);
}

// What lies on a sphere with its corners does not lie in it, however coarse its faces are.
TEST(FeaturePairs, FacesWhoseCornersLieOnASphereHaveTheirChordToGo) {
  const double radius = 0.5, top = 0.5;
  TriangleMesh mesh = boxMesh(Vec3(1, 1, 1), 10, 10, 10);
  const Vec3 centre(0.02, 0.03, top + radius);
  for (Vec3& v : mesh.vertices)
    if (v.z() > top - 1e-9 && (v - centre).head<2>().norm() < 0.3)
      v.z() = centre.z() - std::sqrt(radius * radius - (v - centre).head<2>().squaredNorm());
  const Placed block(mesh, Vec3::Zero());
  PairSearch search = between(block, block);
  std::vector<FeaturePair> pairs;
  findSphere(search, centre, radius, Vec3::Zero(), pairs);
  int flat = 0;
  for (const FeaturePair& pair : pairs) {
    if (pair.of_a == 1 || !(pair.gap < -1e-4)) continue;
    ++flat;
    EXPECT_NEAR(pair.gap + pair.chord, 0.0, 0.1 * pair.chord);
  }
  EXPECT_GT(flat, 0);
  // A sphere that is smaller than a face is stopped by it as it is.
  pairs.clear();
  findSphere(search, Vec3(0.45, 0.44, -0.02 - 0.5), 0.03, Vec3::Zero(), pairs);
  for (const FeaturePair& pair : pairs) EXPECT_EQ(pair.chord, 0.0) << pair.gap;
  EXPECT_FALSE(pairs.empty());
}

}  // namespace feature_pairs_test
}  // namespace meshless
