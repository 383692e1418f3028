// Bodies of several clusters that come to rest wound up in themselves, a cross section turned inside out, are led back
// to their rest shape once nothing holds them; what is held keeps its shape, whatever that is.
#include <gtest/gtest.h>

#include "meshless_surgery/world/saved_world.h"
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

// Of a hundred random starts a third ended wound up; ten of each grid in the short form.
TEST_P(WoundUp, LetGoGoesBack) {
  const auto& [kind, start] = GetParam();
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kNone;
  const unsigned seeds = kind.elastic ? 2 : static_cast<unsigned>(std::clamp(10.0 * share(), 2.0, 100.0));
  int unwound = 0;
  for (const std::array<int, 3> grid : {std::array<int, 3>{2, 2, 2}, std::array<int, 3>{4, 2, 2}}) {
    const PreparedBody whole = test::prepared(blockOfClusters(kind, grid));
    for (unsigned seed = 0; seed < seeds; ++seed) {
      SCOPED_TRACE("seed " + std::to_string(seed) + ", " + std::to_string(whole.model->clusters.size()) + " clusters");
      World world(settings);
      ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(started(whole, start, seed))).ok());
      bool was_unwinding = false;
      double before = 0.0, farthest = 1.0;  // before: energy [J] as unwinding began
      for (int step = 0; step < 3600 && !(farthest < kRestored); ++step) {
        world.step();
        const WorldSnapshot seen = world.snapshot({false, true, true, false});
        const BodySnapshot& body = seen.bodies[0];
        const double energy = deformationEnergy(*body.model, body.material, 1.0 / settings.step_rate, body.particles) +
                              body.measures.kinetic_energy;
        const bool unwinding = seen.report.unwinding > 0;
        if (unwinding && !was_unwinding) {
          before = energy;
          ++unwound;
        }
        if (was_unwinding && !unwinding) EXPECT_LT(energy, before);
        was_unwinding = unwinding;
        farthest = distanceFromRest(*body.model, body.particles);
      }
      EXPECT_LT(farthest, kRestored);
    }
  }
  RecordProperty("unwound", unwound);
}

INSTANTIATE_TEST_SUITE_P(Stress, WoundUp, testing::ValuesIn(crossed(kindsOfManyClusters(), allStarts())),
                         crossedName<Start>);

Kind rigidClusters() {
  for (const Kind& kind : kindsOfManyClusters())
    if (kind.mode == MatchMode::kRigid) return kind;
  return {};
}

WorldSettings inSpace() {
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kNone;
  return settings;
}

/// A world whose body is about to be led back. It flies, and turns.
World aboutToUnwind(const Vec3& velocity, const Vec3& spin) {
  const PreparedBody whole = test::prepared(blockOfClusters(rigidClusters(), {2, 2, 2}));
  for (unsigned seed = 0; seed < 50; ++seed) {
    PreparedBody body = started(whole, allStarts()[1], seed);
    const RigidMotion motion = rigidMotionOf(*body.model, body.state.positions, body.state.velocities);
    for (std::size_t i = 0; i < body.state.velocities.size(); ++i)
      body.state.velocities[i] = velocity + spin.cross(body.state.positions[i] - motion.centre);
    World world(inSpace());
    EXPECT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(std::move(body))).ok());
    for (int step = 0; step < 600; ++step) {
      world.step();
      if (world.snapshot({}).report.unwinding) return world;
    }
  }
  ADD_FAILURE() << "none of fifty starts wound up";
  return World(inSpace());
}

TEST(Unwinding, KeepsMomentum) {
  World world = aboutToUnwind(Vec3(0.3, -0.2, 0.1), Vec3(0.5, 1.0, -0.7));
  const BodyMeasures before = world.snapshot({true, false, true, false}).bodies.at(0).measures;
  int steps = 0;
  do {
    world.step();
    ++steps;
    const BodyMeasures now = world.snapshot({true, false, true, false}).bodies.at(0).measures;
    ASSERT_LT((now.linear_momentum - before.linear_momentum).norm(), 1e-9 * before.linear_momentum.norm());
    // Counted from where it was before a substep to where it is after: it turns a little in between.
    ASSERT_LT((now.angular_momentum - before.angular_momentum).norm(), 1e-3 * before.angular_momentum.norm());
  } while (world.snapshot({}).report.unwinding && steps < 600);
  EXPECT_GT(steps, 5);  // it does not jump
  EXPECT_LT(steps, 60);
}

TEST(Unwinding, GoesOnAfterSaveAndLoad) {
  World world = aboutToUnwind(Vec3::Zero(), Vec3::Zero());
  for (int step = 0; step < 3; ++step) world.step();
  const Result<DecodedWorld> saved = decode(encode(*world.capture()));
  ASSERT_TRUE(saved.ok()) << saved.error().detail;
  World other{WorldSettings()};
  other.restore(*saved->world);
  for (int step = 0; step < 60; ++step) {
    world.step();
    other.step();
    ASSERT_EQ(world.snapshot({}).report.unwinding, other.snapshot({}).report.unwinding) << "step " << step;
    ASSERT_EQ(world.stateHash(), other.stateHash()) << "step " << step;
  }
}

// A pick that holds a wound body may hold it so for good: then that is its shape.
TEST(Unwinding, WaitsUntilNothingHolds) {
  World world = aboutToUnwind(Vec3::Zero(), Vec3::Zero());
  PickCommand pick;
  pick.point = world.snapshot({true, false, true, false}).bodies.at(0).measures.centre_of_mass;
  pick.max_distance = 1.0;
  const PickId held = test::replyOf<PickReply>(world.apply(pick)).pick;
  for (int step = 0; step < 120; ++step) {
    world.step();
    ASSERT_EQ(world.snapshot({}).report.unwinding, 0u) << "step " << step;
  }
  ASSERT_TRUE(world.apply(ReleaseCommand{held}).ok());
  double farthest = 1.0;
  for (int step = 0; step < 600 && !(farthest < kRestored); ++step) {
    world.step();
    const BodySnapshot body = world.snapshot({false, true, false, false}).bodies.at(0);
    farthest = distanceFromRest(*body.model, body.particles);
  }
  EXPECT_LT(farthest, kRestored);
}

// A long bar bent by half a turn in all: none of its clusters by much against the next.
TEST(Unwinding, LeavesAloneWhatIsBent) {
  BodyDef def = blockOf(rigidClusters(), "bar");
  def.mesh = boxMesh(Vec3(0.4, 0.05, 0.05), 16, 2, 2);
  def.clusters.grid = {8, 1, 1};
  const PreparedBody whole = test::prepared(def);
  PreparedBody body = whole;
  const Vec3 centre = rigidMotionOf(*body.model, body.state.positions, body.state.velocities).centre;
  for (Vec3& p : body.state.positions) {
    const Vec3 q = p - centre;
    const double radius = 0.4 / M_PI, angle = q.x() / radius;
    p = centre + Vec3((radius - q.y()) * std::sin(angle), radius - (radius - q.y()) * std::cos(angle), q.z());
  }
  updateSurface(*body.model, body.state);
  World world(inSpace());
  ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(std::move(body))).ok());
  for (int step = 0; step < 300; ++step) {
    world.step();
    ASSERT_EQ(world.snapshot({}).report.unwinding, 0u) << "step " << step;
  }
}

}  // namespace wound_up_test
}  // namespace meshless::stress
