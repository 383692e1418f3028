// Bars that springs tear through each other in one place, each among all others: a frame asks about their points
// about as often as there are points, not once for each pair.
#include <gtest/gtest.h>

#include "meshless_surgery/world/saved_world.h"
#include "support/stress.h"

namespace meshless::stress {
namespace {

constexpr int kBars = 40;
constexpr double kStep = 1.0 / 120.0;  // [s]

// In one place; a spring of 1e4 N/m holds each.
std::vector<PickId> spawnBars(Twins& twins, test::Random& random, double youngs_modulus) {
  std::vector<PickId> held;
  for (int n = 0; n < kBars; ++n) {
    BodyDef def = test::defOf(boxMesh(Vec3(0.3, 0.01, 0.01), 6, 1, 1), "bar" + std::to_string(n));
    def.pose.translation = random.vector(0.02);
    def.pose.rotation = Eigen::Quaterniond(random.rotation());
    def.spacing = 0.01;
    def.material.youngs_modulus = youngs_modulus;
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
  const std::vector<PickId> held = spawnBars(twins, random, 0.0);
  std::size_t asked = 0, traced = 0, contacts = 0;
  for (int k = 0; k < 12; ++k) {
    for (const PickId pick : held) ASSERT_TRUE(twins.apply(MovePickCommand{pick, random.vector(0.03)}).ok());
    ASSERT_TRUE(twins.step(Vec3::Zero(), 5.0)) << k;
    const ContactCounters counters = twins.world().snapshot({}).report.contact_counters;
    asked = std::max(asked, counters.queries);
    traced = std::max(traced, counters.traced);
    if (k > 0) contacts = std::max(contacts, counters.contacts);
  }
  // 8,040 points; with all of them in all pairs 580,000 and 230,000.
  EXPECT_LT(asked, 150000U);
  EXPECT_LT(traced, 60000U);
  EXPECT_GT(contacts, 500U);

  ASSERT_TRUE(twins.apply(ClearPicksCommand{}).ok());
  // Let go, they come to rest. Overlap that was not noticed is depenetrated and bends them a little: 0.01 J of 4.2 J.
  double first = 0.0, energy = 0.0;
  const int resting = std::max(5, static_cast<int>(60 * std::min(1.0, share())));
  for (int k = 0; k < resting; ++k) {
    ASSERT_TRUE(twins.step(Vec3::Zero(), 5.0)) << k;
    energy = 0.0;
    for (const BodySnapshot& body : twins.seen().bodies)
      energy += body.measures.kinetic_energy + deformationEnergy(*body.model, body.material, kStep, body.particles);
    if (k == 0) first = energy;
    EXPECT_LE(energy, first) << k;
  }
  if (resting == 60) EXPECT_LT(energy, 0.03 * first);
}

// Each of the many substeps that stiff bodies would have costs what the heap costs: they get fewer, and are softer.
TEST(Heap, OfStiffBarsLeavesThemFewerSubsteps) {
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kRestShape;
  Twins twins(settings);
  test::Random random(12);
  const std::vector<PickId> held = spawnBars(twins, random, 1e5);
  const auto substeps = [&twins] { return twins.world().snapshot({}).report.substeps; };
  std::size_t alone = 0, in_heap = 1000000;
  for (int k = 0; k < 8; ++k) {
    for (const PickId pick : held) ASSERT_TRUE(twins.apply(MovePickCommand{pick, random.vector(0.03)}).ok());
    ASSERT_TRUE(twins.step(Vec3::Zero(), 5.0)) << k;
    if (k == 0) alone = substeps();
    in_heap = std::min(in_heap, substeps());
  }
  bool said = false;
  for (const Event& event : twins.world().takeEvents())
    said = said || (event.type == EventType::kOverBudget && event.text.find("heap") != std::string::npos);
  EXPECT_GT(alone, 20U);
  EXPECT_LE(in_heap, 10U);
  EXPECT_TRUE(said);
  // Saved in the heap, a world goes on as it would have.
  const auto saved = decode(encode(*twins.world().capture(), "here"));
  ASSERT_TRUE(saved.ok());
  World again(settings);
  again.restore(*saved->world);
  ASSERT_TRUE(twins.step(Vec3::Zero(), 5.0));
  again.step();
  EXPECT_EQ(again.stateHash(), twins.world().stateHash());
}

// What a heap leaves is for those in it: a tower beside it is swept as often as it needs to stand.
TEST(Heap, TakesNoSubstepsFromATowerBesideIt) {
  WorldSettings settings;
  settings.ground = -0.5;
  settings.contact = ContactMethod::kRestShape;
  const auto substepsOf = [&settings](bool with_heap, std::size_t& caught) {
    Twins twins(settings);
    for (int n = 0; n < 8; ++n) {
      BodyDef def = test::defOf(boxMesh(Vec3(0.05, 0.05, 0.05), 1, 1, 1), "cube" + std::to_string(n));
      def.pose.translation = Vec3(1.0, 0.0, -0.475 + 0.05 * n);
      twins.spawn(test::shared(def));
    }
    test::Random random(12);
    const std::vector<PickId> held = with_heap ? spawnBars(twins, random, 1e5) : std::vector<PickId>();
    std::size_t least = 1000000;
    for (int k = 0; k < 8; ++k) {
      for (const PickId pick : held) EXPECT_TRUE(twins.apply(MovePickCommand{pick, random.vector(0.03)}).ok());
      EXPECT_TRUE(twins.step(Vec3::Zero(), 5.0)) << k;
      const StepReport report = twins.world().snapshot({}).report;
      if (k >= 2) least = std::min(least, report.substeps);
      caught = std::max(caught, report.contact_counters.caught);
    }
    return least;
  };
  std::size_t caught_alone = 0, caught = 0;
  const std::size_t alone = substepsOf(false, caught_alone), beside = substepsOf(true, caught);
  EXPECT_GE(alone, 8U);
  EXPECT_EQ(caught_alone, 0U);
  EXPECT_GT(caught, 100U);
  EXPECT_GE(beside, alone);
}

}  // namespace
}  // namespace meshless::stress
