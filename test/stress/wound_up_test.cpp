// Bodies that were wound up in themselves, or turned inside out, go back to their rest shape once nothing holds them.
#include <gtest/gtest.h>

#include "support/stress_cases.h"

namespace meshless::stress {
namespace wound_up_test {

constexpr double kRestored = 1e-3;  // of the size

struct Start {
  std::string name;
  std::function<Vec3(const Vec3& q, test::Random& random)> place;  // of a particle at q from the middle
};

void PrintTo(const Start& start, std::ostream* out) { *out << start.name; }

std::vector<Start> allStarts() {
  return {{"every particle somewhere", [](const Vec3&, test::Random& random) -> Vec3 { return random.vector(0.1); }},
          {"inside out", [](const Vec3& q, test::Random& random) -> Vec3 { return random.vector(0.01) - q; }},
          {"twisted by two turns", [](const Vec3& q, test::Random& random) -> Vec3 {
             return Eigen::AngleAxisd(q.x() / 0.2 * 4.0 * M_PI, Vec3::UnitX()) * q + random.vector(0.005);
           }}};
}

BodyDef blockOfClusters(const Kind& kind, std::array<int, 3> grid) {
  BodyDef def = blockOf(kind, "block");
  if (!kind.elastic) def.clusters.grid = grid;
  return def;
}

PreparedBody started(const PreparedBody& whole, const Start& start, unsigned seed) {
  PreparedBody body = whole;
  Points& x = body.state.positions;
  test::Random random(seed);
  const Vec3 centre = rigidMotionOf(*body.model, x, body.state.velocities).centre;
  for (Vec3& p : x) p = centre + start.place(p - centre, random);
  updateSurface(*body.model, body.state);
  return body;
}

std::vector<Kind> kindsOfManyClusters() {
  std::vector<Kind> kinds;
  for (const Kind& kind : allKinds())
    if (kind.many_clusters) kinds.push_back(kind);
  return kinds;
}

class WoundUp : public testing::TestWithParam<std::tuple<Kind, Start>> {};

TEST_P(WoundUp, LetGoGoesBack) {
  const auto& [kind, start] = GetParam();
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kNone;
  const unsigned seeds = kind.elastic ? 2 : static_cast<unsigned>(std::clamp(10.0 * share(), 2.0, 100.0));
  for (const std::array<int, 3> grid : {std::array<int, 3>{2, 2, 2}, std::array<int, 3>{4, 2, 2}}) {
    const PreparedBody whole = test::prepared(blockOfClusters(kind, grid));
    for (unsigned seed = 0; seed < seeds; ++seed) {
      SCOPED_TRACE("seed " + std::to_string(seed) + ", " + std::to_string(whole.model->clusters.size()) + " clusters");
      World world(settings);
      ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(started(whole, start, seed))).ok());
      double farthest = 1.0;
      for (int step = 0; step < 3600 && !(farthest < kRestored); ++step) {
        world.step();
        const WorldSnapshot seen = world.snapshot({false, true, true, false});
        const BodySnapshot& body = seen.bodies[0];
        farthest = distanceFromRest(*body.model, body.particles);
      }
      EXPECT_LT(farthest, kRestored);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Stress, WoundUp, testing::ValuesIn(crossed(kindsOfManyClusters(), allStarts())),
                         crossedName<Start>);

}  // namespace wound_up_test
}  // namespace meshless::stress
