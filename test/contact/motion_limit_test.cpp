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
    for (int n = 0; n < 2; ++n) inverse[n].assign(previous[n].size(), 1.0);
    for (int n = 0; n < 2; ++n)
      bodies.push_back({&supports[n], positions[n].data(), previous[n].data(), static_cast<Index>(previous[n].size()),
                        true, inverse[n].data()});
  }
  void begin() {
    limit.begin(
        bodies, [this](const LimitedPoint& p) { return previous[p.body][p.vertex]; }, 1e-9);
  }
  std::array<Points, 2> previous, positions;
  std::array<VertexSupports, 2> supports;
  std::array<std::vector<double>, 2> inverse;
  std::vector<LimitedBody> bodies;
  MotionLimit limit;
};

TEST(MotionLimit, AVertexStaysOnItsSideOfAFace) {
  Two two({Vec3(0.2, 0.2, 0.1)}, {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)});
  two.limit.watch(0, 1, {0, 0, 1, 2}, 1);
  two.begin();
  two.positions[0][0].z() = -0.5;
  EXPECT_EQ(two.limit.apply(two.bodies, {0, 1}), 1u);
  const Points& b = two.positions[1];
  EXPECT_GT(two.positions[0][0].z(), 0.6 * b[0].z() + 0.2 * b[1].z() + 0.2 * b[2].z());
  const double momentum = two.positions[0][0].z() - 0.1 + b[0].z() + b[1].z() + b[2].z();
  EXPECT_NEAR(momentum, -0.6, 1e-12) << "equal and opposite";
}

TEST(MotionLimit, SlidingAndPartingAreLeftAlone) {
  for (const Vec3& way : {Vec3(0.3, 0.1, 0.0), Vec3(-5.0, 0.0, 0.0), Vec3(0.0, 0.0, 2.0)}) {
    Two two({Vec3(0.2, 0.2, 0.001)}, {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0)});
    two.limit.watch(0, 1, {0, 0, 1, 2}, 1);
    two.begin();
    two.positions[0][0] += way;
    const Vec3 wanted = two.positions[0][0];
    EXPECT_EQ(two.limit.apply(two.bodies, {0, 1}), 0u);
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
    two.limit.watch(0, 1, corners, of_a);
    two.begin();
    Points way;
    for (int k = 0; k < 4; ++k) way.push_back(random.vector(3.0));
    for (int k = 0; k < 4; ++k)
      two.positions[k < of_a ? 0 : 1][corners[static_cast<std::size_t>(k)]] += way[static_cast<std::size_t>(k)];
    limited += two.limit.apply(two.bodies, {0, 1}) > 0;
    // On the way there, in small steps: they are never at the same place.
    WatchedPair pair;
    pair.of_a = of_a;
    pair.corners = {0, 1, 2, 3};
    double nearest = distanceOfPair(pair, {all[0], all[1], all[2], all[3]}).distance;
    const double start = nearest;
    for (int step = 0; step <= 50; ++step) {
      Points now;
      for (int k = 0; k < 4; ++k) {
        const int b = k < of_a ? 0 : 1;
        const Index i = corners[static_cast<std::size_t>(k)];
        now.push_back(two.previous[b][i] + step / 50.0 * (two.positions[b][i] - two.previous[b][i]));
      }
      nearest = std::min(nearest, distanceOfPair(pair, {now[0], now[1], now[2], now[3]}).distance);
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
    for (const Triangle& t : mesh.triangles) two.limit.watch(0, 1, {v, t[0], t[1], t[2]}, 1);
  two.begin();
  for (Vec3& p : two.positions[0]) p += Vec3(0, 0, -0.3) + random.vector(0.2);
  for (Vec3& p : two.positions[1]) p += random.vector(0.05);
  EXPECT_GT(two.limit.apply(two.bodies, {0, 1}), 30u);
  for (std::size_t v = 0; v < above.size(); ++v)
    for (const Triangle& t : mesh.triangles) {
      WatchedPair pair;
      pair.corners = {0, 1, 2, 3};
      const Points now{two.positions[0][v], two.positions[1][t[0]], two.positions[1][t[1]], two.positions[1][t[2]]};
      const Points old{two.previous[0][v], two.previous[1][t[0]], two.previous[1][t[1]], two.previous[1][t[2]]};
      ASSERT_GE(distanceOfPair(pair, {now[0], now[1], now[2], now[3]}).distance,
                0.099 * 0.1 * distanceOfPair(pair, {old[0], old[1], old[2], old[3]}).distance);
    }
}

}  // namespace
}  // namespace meshless
