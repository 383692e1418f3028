// Island batches, which take all substeps of a frame by themselves, do to the bit what they do when all bodies take
// each substep together.
#include "support/bodies.h"

namespace meshless {
namespace {

constexpr double kCube = 0.1;  // [m]

// 64 cubes in stacks of two that fall on the ground a little askew: 48 alike, of a model each, and others that are
// matched one by one.
void addStacks(World& world) {
  for (int n = 0; n < 64; ++n) {
    BodyDef def = test::defOf(boxMesh(Vec3::Constant(kCube), 2, 2, 2), "cube" + std::to_string(n));
    const int stack = n / 2;
    def.pose.translation = Vec3(0.17 * (stack % 6), 0.17 * (stack / 6), 0.06 + (n % 2) * 0.11) +
                           Vec3(0.01 * std::sin(7.0 * n), 0.01 * std::cos(5.0 * n), 0.0);
    def.pose.rotation = Quat(Eigen::AngleAxisd(0.1 * std::sin(3.0 * n), Vec3(1.0, 2.0, 3.0).normalized()));
    def.spacing = 0.5 * kCube;
    def.clusters.kind = ClusterOptions::Kind::kOne;
    def.material.alpha = 0.8;
    def.material.damping = 2.0;
    switch (n < 48 ? 4 : n % 4) {
      case 0:
        def.material.youngs_modulus = 2e4;
        def.clusters.kind = ClusterOptions::Kind::kCells;
        break;
      case 1:
        def.clusters.kind = ClusterOptions::Kind::kGrid;
        def.clusters.grid = {2, 2, 2};
        break;
      case 2:
        def.material.mode = MatchMode::kQuadratic;
        break;
      case 3:
        def.material.volume.points = {{0.0, 0.0}, {0.1, 0.5}};
        break;
      default:
        break;
    }
    const Result<SpawnReply> reply = world.addSceneBody(test::shared(def));
    ASSERT_TRUE(reply.ok()) << reply.error().detail;
  }
}

struct Seen {
  std::vector<Points> particles;
  StepReport report;
};

Seen look(World& world) {
  Seen seen;
  WorldSnapshot shot = world.snapshot({false, true, false});
  for (BodySnapshot& body : shot.bodies)
    if (body.name != "far") seen.particles.push_back(std::move(body.particles));
  seen.report = shot.report;
  return seen;
}

TEST(IslandBatches, DoWhatAllDoTogether) {
  WorldSettings settings;
  settings.substeps = 4;
  settings.contact = ContactMethod::kRestShape;
  World by_themselves(settings), together(settings);
  settings.threads = 2;
  World on_threads(settings);
  for (World* world : {&by_themselves, &together, &on_threads}) addStacks(*world);
  // A tool far away: with one in the world all take each substep together.
  BodyDef far = test::block("far", Vec3(50.0, 0.0, 1.0));
  ASSERT_TRUE(together.addSceneBody(test::shared(far)).ok());
  PickCommand pick;
  pick.point = Vec3(50.0, 0.0, 1.05);
  pick.max_distance = 0.1;
  ASSERT_TRUE(together.apply(pick).ok());

  std::size_t in_island_batches = 0;
  for (int step = 0; step < 240; ++step) {
    for (World* world : {&by_themselves, &together, &on_threads}) world->step();
    const Seen one = look(by_themselves), all = look(together), two = look(on_threads);
    in_island_batches += one.report.island_batches > 1 && two.report.island_batches > 1;
    ASSERT_EQ(all.report.island_batches, 0u);
    ASSERT_EQ(one.particles.size(), 64u);
    ASSERT_EQ(one.particles, all.particles) << "step " << step;
    ASSERT_EQ(by_themselves.stateHash(), on_threads.stateHash()) << "step " << step;
    ASSERT_EQ(one.report.contact_counters.corrected, all.report.contact_counters.corrected);
    ASSERT_EQ(one.report.ground_contacts, all.report.ground_contacts);
    ASSERT_EQ(one.report.preserve_counters.gradients, all.report.preserve_counters.gradients);
    ASSERT_EQ(one.report.asleep, all.report.asleep);
  }
  EXPECT_GT(in_island_batches, 60u);
}

}  // namespace
}  // namespace meshless
