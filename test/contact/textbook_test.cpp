#include "meshless_surgery/contact/textbook.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/geometry/mesh/tetrahedralize.h"

namespace meshless {
namespace textbook_test {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

ContactMesh meshOf(std::vector<Tetrahedron> tetrahedra) {
  ContactMesh mesh;
  mesh.faces = boundaryFaces(tetrahedra);
  mesh.edges = tetrahedronEdges(tetrahedra);
  mesh.tetrahedra = std::move(tetrahedra);
  return mesh;
}

/// Owns what a ContactBody views.
struct Body {
  ContactMesh mesh;
  Points positions;
};

/// A lattice of n^3 cells, each of Kuhn's six tetrahedra, centred at the origin.
Body lattice(const Vec3& size, int n) {
  Body body;
  const auto at = [&](int i, int j, int k) { return static_cast<Index>((i * (n + 1) + j) * (n + 1) + k); };
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j)
      for (int k = 0; k <= n; ++k) body.positions.push_back(size.cwiseProduct(Vec3(i, j, k) / n - Vec3::Constant(0.5)));
  std::vector<Tetrahedron> tetrahedra;
  const int orders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < n; ++k)
        for (int o = 0; o < 6; ++o) {
          std::array<int, 3> corner{i, j, k};
          Tetrahedron t{at(i, j, k), 0, 0, 0};
          for (int step = 0; step < 3; ++step) {
            ++corner[orders[o][step]];
            t[step + 1] = at(corner[0], corner[1], corner[2]);
          }
          if (o >= 3) std::swap(t[2], t[3]);  // odd orders turn the other way
          tetrahedra.push_back(t);
        }
  body.mesh = meshOf(std::move(tetrahedra));
  return body;
}

/// A ball of random points inside and an icosphere around them.
Body ball(double radius, int inner, unsigned seed) {
  Body body;
  body.positions = sphereMesh(radius, 0.5 * radius).vertices;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> any(-radius, radius);
  while (inner > 0) {
    const Vec3 p(any(random), any(random), any(random));
    if (p.norm() > 0.7 * radius) continue;
    body.positions.push_back(p);
    --inner;
  }
  body.mesh = meshOf(tetrahedralizeHull(body.positions));
  return body;
}

void move(Body& body, const Pose& pose, double scale = 1.0) {
  for (Vec3& p : body.positions) p = pose * (scale * p);
}

std::vector<ContactBody> views(std::vector<Body>& bodies) {
  std::vector<ContactBody> all;
  for (Body& body : bodies) {
    ContactBody view;
    view.mesh = &body.mesh;
    view.positions = &body.positions;
    view.bounds = boundsOf(body.positions);
    all.push_back(view);
  }
  return all;
}

std::vector<Penetration> find(std::vector<Body>& bodies, ContactCounters* counters = nullptr) {
  ContactCounters own;
  return findPenetrations(views(bodies), counters ? *counters : own);
}

bool sane(const std::vector<Penetration>& found) {
  for (const Penetration& p : found) {
    if (!std::isfinite(p.depth) || p.depth < 0.0 || !p.direction.allFinite()) return false;
    const double length = p.direction.norm();
    if (length != 0.0 && std::abs(length - 1.0) > 1e-12) return false;
  }
  return true;
}

/// A small cube of edge 0.06 above a wide slab with its top at z = 0, sunk into it by `depth`.
std::vector<Body> sunkCube(double depth, int cells, int slab_cells = 2) {
  std::vector<Body> bodies{lattice(Vec3(0.06, 0.06, 0.06), cells), lattice(Vec3(0.2, 0.2, 0.1), slab_cells)};
  move(bodies[0], {Quat::Identity(), Vec3(0.013, 0.017, 0.03 - depth)});
  move(bodies[1], {Quat::Identity(), Vec3(0, 0, -0.05)});
  return bodies;
}

Pose anyPose() { return {Quat(Eigen::AngleAxisd(1.1, Vec3(1, -2, 0.5).normalized())), Vec3(0.3, -0.2, 0.7)}; }

TEST(Penetrations, ASunkCubeHasItsDepthAlongTheFaceNormal) {
  for (const int cells : {1, 2, 4, 6})
    for (const double depth : {0.0005, 0.004, 0.012, 0.025}) {
      std::vector<Body> bodies = sunkCube(depth, cells);
      const std::vector<Penetration> found = find(bodies);
      ASSERT_TRUE(sane(found));
      std::size_t expected = 0, seen = 0;
      for (const Vec3& p : bodies[0].positions) expected += p.z() < 0.0;
      for (const Penetration& p : found) {
        if (p.body_a != 0) continue;
        ++seen;
        const double own = -bodies[0].positions[p.particle].z();
        EXPECT_NEAR(p.depth, own, 0.05 * own) << cells << " cells, sunk by " << depth;
        EXPECT_GT(p.direction.z(), std::cos(0.05));
      }
      EXPECT_EQ(seen, expected);
      EXPECT_GE(seen, static_cast<std::size_t>((cells + 1) * (cells + 1)));
    }
}

TEST(Penetrations, LeaveABallAlongItsRadius) {
  // A corner of a cube dips into a ball from many sides: its edges leave through different faces.
  std::mt19937 random(5);
  std::normal_distribution<double> any;
  const double radius = 0.1, depth = 0.01;
  Body round;
  round.positions = sphereMesh(radius, 0.01).vertices;
  round.positions.push_back(Vec3::Zero());
  round.mesh = meshOf(tetrahedralizeHull(round.positions));
  for (int k = 0; k < 50; ++k) {
    const Vec3 outwards = Vec3(any(random), any(random), any(random)).normalized();
    std::vector<Body> bodies{lattice(Vec3(0.05, 0.05, 0.05), 1), round};
    const Vec3 corner = bodies[0].positions[0];
    const Quat turn = Quat::FromTwoVectors(corner, -outwards);
    move(bodies[0], {turn, (radius - depth) * outwards - turn * corner});
    const std::vector<Penetration> found = find(bodies);
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found[0].body_a, 0u);
    EXPECT_EQ(found[0].particle, 0u);
    EXPECT_NEAR(found[0].depth, depth, 0.1 * depth);
    EXPECT_GT(found[0].direction.dot(outwards), 0.99);
  }
}

TEST(Penetrations, AreTheSameInTurnedScaledAndFarInput) {
  const Pose pose = anyPose();
  std::vector<Body> plain{lattice(Vec3(0.1, 0.1, 0.1), 3), ball(0.06, 20, 7)};
  move(plain[1], {Quat(Eigen::AngleAxisd(0.4, Vec3(3, 1, 2).normalized())), Vec3(0.021, -0.013, 0.083)});
  const std::vector<Penetration> expected = find(plain);
  ASSERT_GT(expected.size(), 5u);
  for (const double scale : {1e-3, 1.0, 1e4})
    for (const double away : {0.0, 1e5}) {
      std::vector<Body> bodies = plain;
      const Pose turned{pose.rotation, scale * (pose.translation + Vec3(away, -away, away))};
      for (Body& body : bodies) move(body, turned, scale);
      const std::vector<Penetration> found = find(bodies);
      ASSERT_EQ(found.size(), expected.size()) << "scale " << scale << ", away " << away;
      const double digits = away > 0.0 ? 1e-5 : 1e-9;
      for (std::size_t k = 0; k < found.size(); ++k) {
        EXPECT_EQ(found[k].particle, expected[k].particle);
        EXPECT_EQ(found[k].body_a, expected[k].body_a);
        EXPECT_NEAR(found[k].depth / scale, expected[k].depth, 0.1 * digits);
        EXPECT_LT((found[k].direction - pose.rotation * expected[k].direction).norm(), 100.0 * digits);
      }
    }
}

TEST(Penetrations, AgreeWithBruteForceOnWhoIsInside) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  std::size_t total = 0;
  for (int round = 0; round < 60; ++round) {
    std::vector<Body> bodies;
    for (unsigned k = 0; k < 4; ++k) {
      bodies.push_back(k % 2 ? ball(0.05 + 0.01 * k, 15, 100 * round + k)
                             : lattice(Vec3(0.1, 0.08, 0.06) * (0.7 + 0.2 * k), 3));
      const Vec3 axis = Vec3(any(random), any(random), any(random)).normalized();
      move(bodies.back(),
           {Quat(Eigen::AngleAxisd(3.0 * any(random), axis)), 0.08 * Vec3(any(random), any(random), any(random))});
      if (round % 3 == 0)  // torn and partly inverted
        for (Vec3& p : bodies.back().positions) p += 0.02 * Vec3(any(random), any(random), any(random));
    }
    std::set<std::array<Index, 3>> expected, found;
    for (Index a = 0; a < bodies.size(); ++a)
      for (Index b = 0; b < bodies.size(); ++b)
        for (Index k = 0; a != b && k < bodies[a].positions.size(); ++k)
          for (const Tetrahedron& t : bodies[b].mesh.tetrahedra) {
            // By signs of volumes: another way than the implementation's.
            const auto volume = [&](const Vec3& p, const Vec3& q, const Vec3& r, const Vec3& s) {
              return (q - p).cross(r - p).dot(s - p);
            };
            const Points& x = bodies[b].positions;
            const Vec3& p = bodies[a].positions[k];
            const double v = volume(x[t[0]], x[t[1]], x[t[2]], x[t[3]]);
            if (volume(p, x[t[1]], x[t[2]], x[t[3]]) / v > 0 && volume(x[t[0]], p, x[t[2]], x[t[3]]) / v > 0 &&
                volume(x[t[0]], x[t[1]], p, x[t[3]]) / v > 0 && volume(x[t[0]], x[t[1]], x[t[2]], p) / v > 0)
              expected.insert({a, k, b});
          }
    ContactCounters counters;
    const std::vector<Penetration> list = find(bodies, &counters);
    ASSERT_TRUE(sane(list));
    for (const Penetration& p : list) {
      EXPECT_TRUE(found.insert({p.body_a, p.particle, p.body_b}).second) << "listed twice";
      Vec3 again = Vec3::Zero();
      for (int k = 0; k < 4; ++k)
        again += p.weights[k] * bodies[p.body_b].positions[bodies[p.body_b].mesh.tetrahedra[p.tetrahedron][k]];
      EXPECT_LT((again - bodies[p.body_a].positions[p.particle]).norm(), 1e-10);
    }
    EXPECT_EQ(found, expected) << "round " << round;
    EXPECT_EQ(counters.penetrating, expected.size());
    total += expected.size();
  }
  EXPECT_GT(total, 1000u);
}

TEST(Penetrations, AreOrderedAndTheSameEveryTime) {
  std::vector<Body> bodies;
  for (int k = 0; k < 6; ++k) {
    bodies.push_back(lattice(Vec3(0.1, 0.1, 0.1), 2 + k % 3));
    move(bodies.back(), {Quat(Eigen::AngleAxisd(0.3 * k, Vec3(1, k, 2).normalized())), Vec3(0.06 * k, 0, 0)});
  }
  const std::vector<Penetration> first = find(bodies);
  ASSERT_GT(first.size(), 20u);
  for (std::size_t k = 1; k < first.size(); ++k)
    EXPECT_LT((std::array<Index, 3>{first[k - 1].body_a, first[k - 1].particle, first[k - 1].body_b}),
              (std::array<Index, 3>{first[k].body_a, first[k].particle, first[k].body_b}));
  for (int round = 0; round < 3; ++round) {
    std::vector<Body> others{ball(1.0, 50, round), ball(1.0, 50, round + 9)};  // others in between
    find(others);
    const std::vector<Penetration> again = find(bodies);
    ASSERT_EQ(again.size(), first.size());
    for (std::size_t k = 0; k < first.size(); ++k) {
      EXPECT_EQ(again[k].particle, first[k].particle);
      EXPECT_EQ(again[k].tetrahedron, first[k].tetrahedron);
      EXPECT_EQ(again[k].depth, first[k].depth);
      EXPECT_EQ(again[k].direction, first[k].direction);
    }
  }
}

TEST(Penetrations, NoneAndNoWorkWithoutOverlap) {
  std::vector<Body> bodies;
  for (int k = 0; k < 30; ++k) {
    bodies.push_back(lattice(Vec3(0.1, 0.1, 0.1), 1));
    move(bodies.back(), {Quat::Identity(), Vec3(0.11 * (k % 5), 0.11 * (k / 5), 0)});
  }
  ContactCounters counters;
  EXPECT_TRUE(find(bodies, &counters).empty());
  EXPECT_EQ(counters.pairs, 0u);
  EXPECT_EQ(counters.tested, 0u);
  EXPECT_EQ(counters.penetrating, 0u);
  EXPECT_EQ(counters.corrected, 0u);
}

TEST(Penetrations, TouchingIsNotPenetrating) {
  std::vector<Body> bodies{lattice(Vec3(0.25, 0.25, 0.25), 2), lattice(Vec3(0.25, 0.25, 0.25), 2)};
  move(bodies[1], {Quat::Identity(), Vec3(0.125, 0, 0.25)});
  ContactCounters counters;
  EXPECT_TRUE(find(bodies, &counters).empty());
  EXPECT_EQ(counters.pairs, 1u);
  EXPECT_GT(counters.tested, 0u);
}

TEST(Penetrations, OverlappingBoundsAloneAreNone) {
  std::vector<Body> bodies{ball(0.1, 10, 1), ball(0.1, 10, 2)};
  move(bodies[1], {Quat::Identity(), Vec3(0.15, 0.15, 0)});
  ContactCounters counters;
  EXPECT_TRUE(find(bodies, &counters).empty());
  EXPECT_EQ(counters.pairs, 1u);
  EXPECT_EQ(counters.penetrating, 0u);
}

TEST(Penetrations, ABodyInsideAnotherLeavesAllTheSameNearWay) {
  for (const bool with_edges : {true, false}) {
    std::vector<Body> bodies{lattice(Vec3(0.02, 0.02, 0.02), 2), lattice(Vec3(0.2, 0.2, 0.2), 2)};
    move(bodies[0], {Quat(Eigen::AngleAxisd(0.2, Vec3::UnitY())), Vec3(0.01, -0.02, 0.06)});
    if (!with_edges) bodies[0].mesh = ContactMesh{};
    const std::vector<Penetration> found = find(bodies);
    ASSERT_EQ(found.size(), bodies[0].positions.size());
    for (const Penetration& p : found) {
      EXPECT_EQ(p.body_a, 0u);
      EXPECT_GT(p.direction.z(), 1.0 - 1e-9);
      EXPECT_NEAR(p.depth, 0.1 - bodies[0].positions[p.particle].z(), 1e-9);
    }
  }
}

TEST(Penetrations, DepthsOfInnerLayersAreConsistent) {
  // Several layers of particles deep inside: only the layer at the surface has edges that cross it.
  std::vector<Body> bodies = sunkCube(0.035, 6);
  for (const Penetration& p : find(bodies)) {
    if (p.body_a != 0) continue;
    const double own = -bodies[0].positions[p.particle].z();
    EXPECT_NEAR(p.depth, own, 0.05 * own);
    EXPECT_GT(p.direction.z(), std::cos(0.05));
  }
}

TEST(Penetrations, DoNotMindFlatInvertedAndHugeTetrahedra) {
  std::vector<Body> healthy = sunkCube(0.01, 3);
  const std::size_t expected = find(healthy).size();
  {  // everything inverted by a reflection: who is inside stays the same
    std::vector<Body> bodies = healthy;
    for (Body& body : bodies)
      for (Vec3& p : body.positions) p.x() = -p.x();
    const std::vector<Penetration> found = find(bodies);
    EXPECT_TRUE(sane(found));
    EXPECT_EQ(found.size(), expected);
  }
  {  // collapsed to a plane, to a line, to a point
    for (int dimension = 2; dimension >= 0; --dimension) {
      std::vector<Body> bodies = healthy;
      for (Vec3& p : bodies[1].positions)
        for (int d = dimension; d < 3; ++d) p[d] = 0.0;
      EXPECT_TRUE(sane(find(bodies)));
    }
  }
  for (const double torn : {1e3, 1e9, 1e150, 1e300}) {  // one particle far away
    std::vector<Body> bodies = healthy;
    bodies[1].positions[13] = Vec3(torn, -torn, torn);
    EXPECT_TRUE(sane(find(bodies))) << torn;
    bodies = healthy;
    bodies[0].positions[5] = Vec3(-torn, torn, torn);
    EXPECT_TRUE(sane(find(bodies))) << torn;
  }
  for (const double broken : {kNan, kInfinity, -kInfinity}) {
    std::vector<Body> bodies = healthy;
    const std::vector<ContactBody> before = views(bodies);
    for (const std::size_t body : {0u, 1u})
      for (const std::size_t particle : {0u, 7u, 13u}) {
        bodies = healthy;
        bodies[body].positions[particle][particle % 3] = broken;
        std::vector<ContactBody> all = views(bodies);
        for (std::size_t k = 0; k < all.size(); ++k) all[k].bounds = before[k].bounds;
        ContactCounters counters;
        const std::vector<Penetration> found = findPenetrations(all, counters);
        EXPECT_TRUE(sane(found));
        for (const Penetration& p : found) EXPECT_FALSE(p.body_a == body && p.particle == particle);
        RowSet set;
        for (const Penetration& p : found) addRow(p, all, 0.5, set);
        for (const ContactRow& row : set.rows) EXPECT_TRUE(row.normal.allFinite() && std::isfinite(row.constant));
      }
  }
}

TEST(Penetrations, NothingToQueryIsFine) {
  ContactCounters counters;
  EXPECT_TRUE(findPenetrations({}, counters).empty());
  std::vector<Body> bodies(3);
  EXPECT_TRUE(find(bodies, &counters).empty());
  Body cube = lattice(Vec3(1, 1, 1), 1);
  bodies = {cube, cube};
  bodies[0].mesh = bodies[1].mesh = ContactMesh{};  // two bodies that nothing can be inside of
  EXPECT_TRUE(find(bodies, &counters).empty());
  EXPECT_EQ(counters.tested, 0u);
}

// --- rows

// A row presses the two apart along the direction of the penetration, by its depth, with impulses that are equal and
// opposite.
TEST(TextbookRows, PressTheParticleAndTheTetrahedronApart) {
  std::vector<Body> bodies{lattice(Vec3(0.1, 0.1, 0.1), 3), ball(0.07, 30, 3)};
  move(bodies[1], {Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized())), Vec3(0.03, 0.02, 0.09)});
  const std::vector<ContactBody> all = views(bodies);
  ContactCounters counters;
  const std::vector<Penetration> found = findPenetrations(all, counters);
  ASSERT_GT(found.size(), 5u);
  RowSet set;
  for (const Penetration& penetration : found) addRow(penetration, all, 0.3, set);
  ASSERT_EQ(set.rows.size(), found.size());
  for (std::size_t n = 0; n < found.size(); ++n) {
    const ContactRow& row = set.rows[n];
    double gap = row.constant, all_of_a = 0.0, all_of_b = 0.0;
    for (Index k = row.begin; k < row.end; ++k) {
      const bool of_a = k < row.middle;
      const RowEntry& entry = set.entries[k];
      const Body& body = bodies[of_a ? found[n].body_a : found[n].body_b];
      gap += entry.coefficient * row.normal.dot(body.positions[entry.particle]);
      (of_a ? all_of_a : all_of_b) += entry.coefficient;
    }
    EXPECT_NEAR(gap, -found[n].depth, 1e-12);
    EXPECT_NEAR(all_of_a, 1.0, 1e-12);
    EXPECT_NEAR(all_of_b, -1.0, 1e-9);
    EXPECT_EQ(row.normal, found[n].direction);
    EXPECT_EQ(row.friction, 0.3);
  }
}

// What has no way out is left alone.
TEST(TextbookRows, AreNotMadeWithoutADirection) {
  std::vector<Body> bodies{lattice(Vec3(0.1, 0.1, 0.1), 1), lattice(Vec3(0.1, 0.1, 0.1), 1)};
  const std::vector<ContactBody> all = views(bodies);
  Penetration lost;
  lost.body_b = 1;
  RowSet set;
  addRow(lost, all, 0.3, set);
  EXPECT_TRUE(set.rows.empty());
}

}  // namespace textbook_test
}  // namespace meshless
