// Bars that springs tear through each other in one place, each among all others: a search asks about their points about
// as often as there are points, not once for each pair.
#include <gtest/gtest.h>

#include "support/stress.h"

namespace meshless::stress {
namespace heap_test {

constexpr int kBars = 12;
constexpr double kPoints = 201.0 * kBars;
constexpr double kStep = 1.0 / 120.0;  // [s]

// In one place; a spring of 1e4 N/m holds each.
std::vector<PickId> spawnBars(Twins& twins, test::Random& random) {
  std::vector<PickId> held;
  for (int n = 0; n < kBars; ++n) {
    BodyDef def = test::defOf(boxMesh(Vec3(0.3, 0.01, 0.01), 6, 1, 1), "bar" + std::to_string(n));
    def.pose.translation = random.vector(0.02);
    def.pose.rotation = Eigen::Quaterniond(random.rotation());
    def.spacing = 0.01;
    twins.spawn(test::shared(def));
    PickCommand pick;
    pick.body = def.name;
    pick.point = def.pose.translation;
    pick.max_distance = 0.2;
    pick.stiffness = 1e4;
    held.push_back(test::replyOf<PickReply>(twins.apply(pick)).pick);
  }
  return held;
}

TEST(Heap, OfFastBarsIsQueriedByVertices) {
  Twins twins(test::weightless());
  test::Random random(11);
  const std::vector<PickId> held = spawnBars(twins, random);
  double asked = 0.0;  // of each point in a substep
  std::size_t contacts = 0;
  for (int k = 0; k < 12; ++k) {
    for (const PickId pick : held) ASSERT_TRUE(twins.apply(MovePickCommand{pick, random.vector(0.03)}).ok());
    ASSERT_TRUE(twins.step(Vec3::Zero(), 5.0)) << k;
    const StepReport report = twins.world().snapshot({}).report;
    const ContactCounters& counters = report.contact_counters;
    asked = std::max(asked, static_cast<double>(counters.queries) / static_cast<double>(report.substeps) / kPoints);
    if (k > 0) contacts = std::max(contacts, counters.contacts);
  }
  EXPECT_LT(asked, 20.0);
  EXPECT_GT(contacts, 500U);

  ASSERT_TRUE(twins.apply(ClearPicksCommand{}).ok());
  // Let go, they lose energy. What lies in each other is let out slowly, and stays bent meanwhile.
  double first = 0.0, energy = 0.0;
  const int resting = std::max(5, static_cast<int>(20 * std::min(1.0, share())));
  for (int k = 0; k < resting; ++k) {
    ASSERT_TRUE(twins.step(Vec3::Zero(), 5.0)) << k;
    energy = 0.0;
    for (const BodySnapshot& body : twins.seen().bodies)
      energy += body.measures.kinetic_energy + deformationEnergy(*body.model, body.material, kStep, body.particles);
    if (k == 0) first = energy;
    EXPECT_LE(energy, first) << k;
  }
  if (resting == 20) EXPECT_LT(energy, 0.5 * first);
}

}  // namespace heap_test
}  // namespace meshless::stress
