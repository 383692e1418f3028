// What was apart at the start of a substep is apart at its end, whatever was asked for.
#include "meshless_surgery/contact/motion_limit.h"

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/primitives.h"
#include "support/random.h"

namespace meshless {
namespace {

/// Two bodies whose vertices are their particles.
struct Two {
  Two(const Points& of_a, const Points& of_b)
      : previous{of_a, of_b},
        positions{of_a, of_b},
        supports{ownSupports(static_cast<Index>(of_a.size())), ownSupports(static_cast<Index>(of_b.size()))} {
    for (int n = 0; n < 2; ++n) {
      const Index count = static_cast<Index>(previous[n].size());
      inverse[n].assign(count, 1.0);
      LimitedBody body;
      body.supports = &supports[n];
      body.positions = positions[n].data();
      body.previous = previous[n].data();
      body.particles = count;
      body.inverse_masses = inverse[n].data();
      for (Index i = 0; i < count; ++i) body.watched.push_back(i);
      body.vertices.resize(count);
      body.edited.assign(count, 0);
      body.is_watched.assign(count, 0);
      bodies.push_back(std::move(body));
    }
  }
  void watch(const std::array<Index, 4>& corners, std::uint8_t of_a) {
    WatchedFeatures watched;
    watched.vertices = corners;
    watched.of_a = of_a;
    set.features.push_back(watched);
  }
  std::size_t limit(bool free = false) {
    set.start();
    LimitScratch scratch;
    return limitMotion({{&set, 0, 1, 1e-9}}, bodies, {0, 1}, free, scratch);
  }
  std::pair<Vec3, Vec3> momentum() const {
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
    for (int n = 0; n < 2; ++n)
      for (std::size_t i = 0; i < previous[n].size(); ++i) {
        const Vec3 way = (positions[n][i] - previous[n][i]) / inverse[n][i];
        linear += way;
        angular += previous[n][i].cross(way);
      }
    return {linear, angular};
  }
  /// Of motion beyond a common shift.
  double energy(const Vec3& shift) const {
    double sum = 0.0;
    for (int n = 0; n < 2; ++n)
      for (std::size_t i = 0; i < previous[n].size(); ++i)
        sum += (positions[n][i] - previous[n][i] - shift).squaredNorm() / inverse[n][i];
    return sum;
  }
  std::array<Points, 2> previous, positions;
  std::array<VertexSupports, 2> supports;
  std::array<std::vector<double>, 2> inverse;
  std::vector<LimitedBody> bodies;
  WatchedSet set;
};

TEST(MotionLimit, AVertexStaysOnItsSideOfAFace) {
  Two two({Vec3(0.2, 0.2, 0.1)}, {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)});
  two.watch({0, 0, 1, 2}, 1);
  two.positions[0][0].z() = -0.5;
  EXPECT_EQ(two.limit(), 1u);
  const Points& b = two.positions[1];
  EXPECT_GT(two.positions[0][0].z(), 0.6 * b[0].z() + 0.2 * b[1].z() + 0.2 * b[2].z());
  const double momentum = two.positions[0][0].z() - 0.1 + b[0].z() + b[1].z() + b[2].z();
  EXPECT_NEAR(momentum, -0.6, 1e-12) << "equal and opposite";
}

TEST(MotionLimit, SlidingAndPartingAreLeftAlone) {
  for (const Vec3& way : {Vec3(0.3, 0.1, 0.0), Vec3(-5.0, 0.0, 0.0), Vec3(0.0, 0.0, 2.0)}) {
    Two two({Vec3(0.2, 0.2, 0.001)}, {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)});
    two.watch({0, 0, 1, 2}, 1);
    two.positions[0][0] += way;
    const Vec3 wanted = two.positions[0][0];
    EXPECT_EQ(two.limit(), 0u);
    EXPECT_EQ(two.positions[0][0], wanted);
  }
}

TEST(MotionLimit, RandomFeaturesNeverPassThroughEachOther) {
  test::Random random(3);
  int limited = 0;
  for (int n = 0; n < 2000; ++n) {
    const std::uint8_t of_a = 1 + n % 2;
    Points all;
    for (int k = 0; k < 4; ++k) all.push_back(random.vector(1.0));
    Two two(Points(all.begin(), all.begin() + of_a), Points(all.begin() + of_a, all.end()));
    std::array<Index, 4> corners{};
    for (int k = 0; k < 4; ++k) corners[static_cast<std::size_t>(k)] = static_cast<Index>(k < of_a ? k : k - of_a);
    two.watch(corners, of_a);
    Points way;
    for (int k = 0; k < 4; ++k) way.push_back(random.vector(3.0));
    for (int k = 0; k < 4; ++k)
      two.positions[k < of_a ? 0 : 1][corners[static_cast<std::size_t>(k)]] += way[static_cast<std::size_t>(k)];
    limited += two.limit() > 0;
    // On the way there, in small steps: they are never at the same place.
    double nearest = distanceOfPair(of_a, {all[0], all[1], all[2], all[3]}).distance;
    const double start = nearest;
    for (int step = 0; step <= 50; ++step) {
      Points now;
      for (int k = 0; k < 4; ++k) {
        const int b = k < of_a ? 0 : 1;
        const Index i = corners[static_cast<std::size_t>(k)];
        now.push_back(two.previous[b][i] + step / 50.0 * (two.positions[b][i] - two.previous[b][i]));
      }
      nearest = std::min(nearest, distanceOfPair(of_a, {now[0], now[1], now[2], now[3]}).distance);
    }
    ASSERT_GE(nearest, 0.099 * start) << n;
  }
  EXPECT_GT(limited, 200);
}

// Many pairs that share particles and ask for different shares: all of them stay apart in the end.
TEST(MotionLimit, PairsThatShareParticlesAllStayApart) {
  test::Random random(5);
  const TriangleMesh mesh = boxMesh(Vec3(1, 1, 0.1), 6, 6, 1);
  Points above;
  for (int n = 0; n < 60; ++n)
    above.push_back(Vec3(random.uniform(-0.45, 0.45), random.uniform(-0.45, 0.45), 0.05 + random.uniform(0.001, 0.1)));
  Two two(above, mesh.vertices);
  for (Index v = 0; v < above.size(); ++v)
    for (const Triangle& t : mesh.triangles) two.watch({v, t[0], t[1], t[2]}, 1);
  for (Vec3& p : two.positions[0]) p += Vec3(0, 0, -0.3) + random.vector(0.2);
  for (Vec3& p : two.positions[1]) p += random.vector(0.05);
  EXPECT_GT(two.limit(), 30u);
  for (std::size_t v = 0; v < above.size(); ++v)
    for (const Triangle& t : mesh.triangles) {
      const Points now{two.positions[0][v], two.positions[1][t[0]], two.positions[1][t[1]], two.positions[1][t[2]]};
      const Points old{two.previous[0][v], two.previous[1][t[0]], two.previous[1][t[1]], two.previous[1][t[2]]};
      ASSERT_GE(distanceOfPair(1, {now[0], now[1], now[2], now[3]}).distance,
                0.099 * 0.1 * distanceOfPair(1, {old[0], old[1], old[2], old[3]}).distance);
    }
}

// Where nothing holds the bodies, what is held back goes to all of them.
TEST(MotionLimit, MomentumAndAngularMomentumStayWhereNothingIsHeld) {
  test::Random random(11);
  int limited = 0;
  for (int n = 0; n < 200; ++n) {
    const std::uint8_t of_a = 1 + n % 2;
    Points a, b;
    for (int k = 0; k < 6; ++k) a.push_back(random.vector(1.0)), b.push_back(random.vector(1.0));
    Two two(a, b);
    for (auto& inverse : two.inverse)
      for (double& w : inverse) w = random.uniform(0.5, 20.0);
    two.watch(of_a == 1 ? std::array<Index, 4>{0, 0, 1, 2} : std::array<Index, 4>{0, 1, 0, 1}, of_a);
    for (Points& points : two.positions)
      for (Vec3& p : points) p += random.vector(2.0);
    const auto before = two.momentum();
    limited += two.limit(true) > 0;
    const auto after = two.momentum();
    ASSERT_LT((after.first - before.first).norm(), 1e-12 * 20.0);
    ASSERT_LT((after.second - before.second).norm(), 1e-12 * 20.0);
  }
  EXPECT_GT(limited, 20);
}

// Also where particles are held: they stay behind what all do together, or some would get energy of that motion.
TEST(MotionLimit, NoEnergyIsGainedHoweverFastAllMoveTogether) {
  const TriangleMesh mesh = boxMesh(Vec3(1, 1, 0.1), 6, 6, 1);
  Points relative[2];
  for (const bool together : {false, true}) {
    test::Random random(5);
    Points above;
    for (int n = 0; n < 60; ++n)
      above.push_back(
          Vec3(random.uniform(-0.45, 0.45), random.uniform(-0.45, 0.45), 0.05 + random.uniform(0.001, 0.01)));
    Two two(above, mesh.vertices);
    for (Index v = 0; v < above.size(); ++v)
      for (const Triangle& t : mesh.triangles) two.watch({v, t[0], t[1], t[2]}, 1);
    const Vec3 shift = together ? Vec3(0.5, 0.2, 0.3) : Vec3(Vec3::Zero());
    for (Vec3& p : two.positions[0]) p += shift + Vec3(0, 0, -0.03) + random.vector(0.02);
    for (Vec3& p : two.positions[1]) p += shift + random.vector(0.005);
    const double before = two.energy(shift);
    EXPECT_GT(two.limit(true), 30u);
    EXPECT_LT(two.energy(shift), before);
    for (int n = 0; n < 2; ++n)
      for (const Vec3& p : two.positions[n]) relative[together].push_back(p - shift);
  }
  for (std::size_t i = 0; i < relative[0].size(); ++i) EXPECT_LT((relative[1][i] - relative[0][i]).norm(), 1e-9) << i;
}

TEST(MotionLimit, WhoIsHeldIsNotMovedAndNotPassed) {
  test::Random random(13);
  for (int n = 0; n < 200; ++n) {
    Two two({Vec3(random.uniform(0.1, 0.4), random.uniform(0.1, 0.4), 0.1)},
            {Vec3::Zero(), Vec3::UnitX(), Vec3::UnitY()});
    for (double& w : two.inverse[1]) w = 0.0;
    two.watch({0, 0, 1, 2}, 1);
    two.positions[0][0] += Vec3(random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), -random.uniform(0.2, 3.0));
    EXPECT_EQ(two.limit(), 1u);
    EXPECT_GE(two.positions[0][0].z(), 0.0099);
    EXPECT_EQ(two.positions[1][1], Vec3::UnitX());
  }
}

// A set that has measured how far apart its features are checks them again before they can have met.
TEST(MotionLimit, NothingIsMissedOverManySubsteps) {
  test::Random random(17);
  for (int n = 0; n < 100; ++n) {
    Two two({Vec3(0.2, 0.2, 1.0)}, {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)});
    two.watch({0, 0, 1, 2}, 1);
    two.set.start();
    LimitScratch scratch;
    std::size_t met = 0;
    for (int substep = 0; substep < 100 && met == 0; ++substep) {
      for (Points& points : two.positions)
        for (Vec3& p : points) p += random.vector(0.004);
      two.positions[0][0].z() -= random.uniform(0.0, 0.08);
      met += limitMotion({{&two.set, 0, 1, 1e-9}}, two.bodies, {0, 1}, false, scratch);
      const Points& b = two.positions[1];
      ASSERT_GT(distanceOfPair(1, {two.positions[0][0], b[0], b[1], b[2]}).between.z(), 0.0) << substep;
      for (int k = 0; k < 2; ++k) two.previous[k] = two.positions[k];
    }
    EXPECT_GT(met, 0u);
  }
}

// What has come so near within a frame that nothing tells the sides any more is still on its side.
TEST(MotionLimit, WhatComesToTouchInAFrameIsNotLetThroughInTheNextSubsteps) {
  Two two({Vec3(0.2, 0.2, 0.05)}, {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)});
  for (double& w : two.inverse[1]) w = 0.0;
  two.watch({0, 0, 1, 2}, 1);
  two.set.start();
  LimitScratch scratch;
  for (int substep = 0; substep < 8; ++substep) {
    two.positions[0][0].z() -= 0.02;
    limitMotion({{&two.set, 0, 1, 1e-3}}, two.bodies, {0, 1}, false, scratch);
    ASSERT_GT(two.positions[0][0].z(), -1e-3) << "substep " << substep;
    two.previous[0] = two.positions[0];
  }
}

// It touches one face, slides along it over the next, and is pressed into that. What touches may be inside a little.
TEST(MotionLimit, WhatSlidesFromFaceToFaceIsHeldByTheNext) {
  constexpr double kTouching = 1e-3;
  for (const double height : {0.5 * kTouching, -0.5 * kTouching}) {
    SCOPED_TRACE(height);
    Two two({Vec3(-1.5 * kTouching, 0.3, height)}, {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(-1, 0, 0)});
    for (double& w : two.inverse[1]) w = 0.0;
    two.watch({0, 0, 1, 2}, 1);
    two.watch({0, 0, 2, 3}, 1);
    two.set.features[1].normal = Vec3::UnitZ();
    two.set.features[1].least = -kTouching;
    two.set.start();
    LimitScratch scratch;
    for (int substep = 0; substep < 8; ++substep) {
      two.positions[0][0] += substep == 0 ? Vec3(1.6 * kTouching, 0, 0) : Vec3(0, 0, -0.02);
      limitMotion({{&two.set, 0, 1, kTouching, true}}, two.bodies, {0, 1}, false, scratch);
      ASSERT_GT(two.positions[0][0].z(), -kTouching) << "substep " << substep;
      two.previous[0] = two.positions[0];
    }
    EXPECT_GT(two.positions[0][0].x(), 0.0) << "it came over the next";
  }
}

// A start that was moved with the end, to let something out without speed, counts no more for what stays where it was.
TEST(MotionLimit, WhatIsHeldHasNoSpeed) {
  Two two({Vec3(0.2, 0.2, 0.0)},
          {Vec3(0, 0, -0.1), Vec3(1, 0, -0.1), Vec3(0, 1, -0.1), Vec3(0, 0, 0.1), Vec3(1, 0, 0.1), Vec3(0, 1, 0.1)});
  for (double& w : two.inverse[1]) w = 0.0;  // they close on it, and it cannot move them
  for (Vec3& p : two.positions[1]) p.z() = -p.z();
  two.watch({0, 0, 1, 2}, 1);
  two.watch({0, 3, 4, 5}, 1);
  two.positions[0][0].z() = 0.03;
  for (int n = 0; n < 2; ++n) two.bodies[n].from = two.previous[n];
  two.bodies[0].from[0].z() = 0.03;
  EXPECT_EQ(two.limit(), 2u);
  EXPECT_EQ(two.positions[0][0], two.previous[0][0]);
  EXPECT_EQ(two.bodies[0].from[0], two.positions[0][0]);
}

}  // namespace
}  // namespace meshless
