// Which features meet, and on which side they are.
#include "meshless_surgery/contact/feature_pairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "meshless_surgery/base/random.h"
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

SphereTouch touchOf(const Vec3& centre, double radius, double spacing, double pressed) {
  SphereTouch touch;
  touch.centre = centre;
  touch.radius = radius;
  touch.spacing = spacing;
  touch.modulus = 1e4;
  // Hertz: as hard as makes a contact of that radius.
  touch.force = -4.0 / 3.0 * touch.modulus / radius * pressed * pressed * pressed * Vec3::UnitZ();
  return touch;
}

// Two in the radius of the contact, wherever it lies and however fine the faces are; they share its area out.
TEST(FeaturePairs, ASphereMeetsEvenPointsOfWhatItTouches) {
  Random random(7);
  const double radius = 0.1, deep = 0.004, contact = std::sqrt(2.0 * radius * deep);
  for (const int fineness : {1, 3, 12, 40}) {
    const Placed block(boxMesh(Vec3(1, 1, 1), fineness, fineness, 2), Vec3::Zero());
    const PairSearch search = between(block, block);
    for (int k = 0; k < 20; ++k) {
      const Vec3 below(random.between(-0.4, 0.4), random.between(-0.4, 0.4), 0.5);
      std::vector<FeaturePair> pairs;
      findSphere(search, touchOf(below + (radius - deep) * Vec3::UnitZ(), radius, 0.5, contact), pairs);
      double area = 0.0;
      Vec3 middle = Vec3::Zero();
      int inside = 0;
      std::set<std::array<Index, 2>> names;
      for (const FeaturePair& pair : pairs) {
        EXPECT_TRUE(names.insert(pair.features).second);
        Vec3 at = Vec3::Zero();
        for (int n = 0; n < pair.of_a; ++n) at += pair.shares[n] * block.frame.vertices[pair.vertices[n]];
        EXPECT_NEAR(at.z(), 0.5, 1e-12);
        EXPECT_NEAR(pair.gap, (at - below - (radius - deep) * Vec3::UnitZ()).norm() - radius, 1e-12);
        if (pair.gap > 0.0) continue;
        ++inside;
        area += pair.area;
        middle += pair.area * at;
      }
      EXPECT_GE(inside, 10);
      EXPECT_LE(inside, 30);
      EXPECT_LE(pairs.size(), 60u);
      EXPECT_NEAR(area, M_PI * contact * contact, 0.35 * M_PI * contact * contact);
      EXPECT_LT((middle / area - below).norm(), 0.02 * contact);
    }
  }
}

// Ten spacings across: what carries a surface cannot tell more points from fewer.
TEST(FeaturePairs, ALargeSphereMeetsPointsThatAreLittleNearerThanASpacing) {
  const Placed block(boxMesh(Vec3(1, 1, 1), 10, 10, 10), Vec3::Zero());
  std::vector<FeaturePair> pairs;
  findSphere(between(block, block), touchOf(Vec3(0.0, 0.0, 1000.4999), 1000.0, 0.1, 0.7), pairs);
  EXPECT_GT(pairs.size(), 150u);
  EXPECT_LT(pairs.size(), 300u);
}

// From outside, from inside a hollow, and in a groove whose two walls it touches at once.
TEST(FeaturePairs, ASphereMeetsWhatIsAroundIt) {
  TriangleMesh hollow = boxMesh(Vec3(0.2, 0.2, 0.2), 4, 4, 4);
  for (Triangle& t : hollow.triangles) std::swap(t[1], t[2]);
  const Placed cave(hollow, Vec3::Zero());
  std::vector<FeaturePair> pairs;
  SphereTouch touch = touchOf(Vec3::Zero(), 0.101, 0.05, 0.01);
  findSphere(between(cave, cave), touch, pairs);
  std::array<int, 6> on{};
  for (const FeaturePair& pair : pairs) {
    Index axis = 0;
    pair.normal.cwiseAbs().maxCoeff(&axis);
    ++on[2 * axis + (pair.normal[axis] > 0.0)];
  }
  for (const int count : on) EXPECT_GT(count, 3);

  TriangleMesh groove;
  groove.vertices = {{-0.3, -0.3, 0.3}, {-0.3, 0.3, 0.3}, {0, -0.3, 0}, {0, 0.3, 0}, {0.3, -0.3, 0.3}, {0.3, 0.3, 0.3}};
  groove.triangles = {{0, 2, 1}, {1, 2, 3}, {2, 4, 3}, {3, 4, 5}};
  const Placed walls(groove, Vec3::Zero());
  pairs.clear();
  touch = touchOf(Vec3(0.002, 0.02, std::sqrt(0.5) * 0.19), 0.1, 0.05, 0.02);
  touch.force = Vec3(0.0, 0.0, -1.0);  // of both
  findSphere(between(walls, walls), touch, pairs);
  std::array<int, 2> walls_met{};
  for (const FeaturePair& pair : pairs) ++walls_met[pair.normal.x() > 0.0];
  EXPECT_GT(walls_met[0], 3);
  EXPECT_GT(walls_met[1], 3);
}

// What has no faces is met at its points.
TEST(FeaturePairs, ASphereMeetsPointsOfACloud) {
  TriangleMesh cloud;
  cloud.vertices = {{0, 0, 0}, {0.01, 0, 0}, {1, 0, 0}};
  const Placed points(cloud, Vec3::Zero());
  std::vector<FeaturePair> pairs;
  findSphere(between(points, points), touchOf(Vec3(0, 0, 0.09), 0.1, 0.05, 0.01), pairs);
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_NEAR(pairs[0].gap, -0.01, 1e-12);
}

}  // namespace feature_pairs_test
}  // namespace meshless
