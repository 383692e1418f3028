// Materials that relax, in the world at its defaults: forces fade, tissue creeps, and what has faded is kept.
#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/world/saved_world.h"
#include "support/bodies.h"

namespace meshless {
namespace creep_test {

constexpr double kYoungs = 2e4;  // [Pa]

// A bar of 20 cm along x, held at its lower end.
BodyDef bar(const std::vector<Relaxation>& relaxation, double poissons_ratio = 0.45) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.2, 0.05, 0.05), 0.0125), "bar");
  def.pose.translation = Vec3(0.0, 0.0, 0.5);
  def.material.youngs_modulus = kYoungs;
  def.material.poissons_ratio = poissons_ratio;
  def.material.damping = 20.0;
  def.material.relaxation = relaxation;
  HeldRegion held(Vec3(-1, -1, -1), Vec3(-0.06, 1, 1));
  held.in_world = false;
  def.fixed = {held};
  return def;
}

World holding(const BodyDef& def, WorldSettings settings = test::weightless()) {
  World world{settings};
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  return world;
}

void run(World& world, double seconds) {
  for (int step = 0; step < std::lround(seconds * world.settings().step_rate); ++step) world.step();
}

double heldForce(World& world) { return world.load("bar", {})->clamps.at(0).force.norm(); }

// Drawn 4 mm across and kept there by a stiff pick: of the force the long-term share is left, and it falls in time.
TEST(Creep, AForceThatIsHeldFadesToItsShare) {
  World world = holding(bar({{0.5, 1.0}}));
  PickCommand pick;
  pick.point = Vec3(0.1, 0.0, 0.5);
  pick.stiffness = 1e5;
  LockCommand lock;
  lock.pick = test::replyOf<PickReply>(world.apply(pick)).pick;
  lock.target = world.snapshot({}).picks[0].position + Vec3(0.0, 0.0, 0.004);
  ASSERT_TRUE(world.apply(lock).ok());
  // E = 9 K G / (3 K + G), of which G falls to a half.
  const double g = kYoungs / 2.9, k = kYoungs / 0.3;
  const auto youngs = [&](double share) { return 9.0 * k * share * g / (3.0 * k + share * g); };
  const auto left = [&](double time) { return youngs(0.5 + 0.5 * std::exp(-time)); };
  run(world, 1.5);  // it has swung out
  const double early = heldForce(world);
  run(world, 1.0);
  EXPECT_NEAR(heldForce(world) / early, left(2.5) / left(1.5), 0.02);
  run(world, 6.0);
  EXPECT_NEAR(heldForce(world) / early, left(8.5) / left(1.5), 0.02);
}

double sagOf(World& world) {
  double lowest = 1e300;
  const WorldSnapshot shot = world.snapshot({true, false, false});
  for (const Vec3& p : shot.bodies[0].surface) lowest = std::min(lowest, p.z());
  return 0.475 - lowest;
}

TEST(Creep, TissueUnderItsWeightCreepsAndSleepsWhenItHasCrept) {
  WorldSettings settings = test::weightless();
  settings.gravity = Vec3(0.0, 0.0, -0.5);
  World stiff = holding(bar({}, 0.0), settings), soft = holding(bar({{0.6, 2.0}}, 0.0), settings);
  run(stiff, 2.0);
  run(soft, 2.0);
  EXPECT_TRUE(stiff.snapshot({}).bodies[0].asleep);
  EXPECT_FALSE(soft.snapshot({}).bodies[0].asleep) << "it creeps";
  const double crept = sagOf(soft);
  EXPECT_GT(crept, 1.1 * sagOf(stiff));
  run(soft, 23.0);
  EXPECT_TRUE(soft.snapshot({}).bodies[0].asleep);
  EXPECT_GT(sagOf(soft), 1.1 * crept);
  // nu = 0: E = 9 K G / (3 K + G) with K = E / 3, G = E / 2, of which 0.4 is left: a half. Of the bar's stiffness a
  // sixteenth is how its four cells bend, which does not relax.
  EXPECT_NEAR(sagOf(soft) / sagOf(stiff), 1.0 / (0.5 * 15.0 / 16.0 + 1.0 / 16.0), 0.05);
}

TEST(Creep, WhatHasFadedIsSavedCutAndUndone) {
  WorldSettings settings = test::weightless();
  settings.gravity = Vec3(0.0, 0.0, -0.5);
  World world = holding(bar({{0.4, 0.5}, {0.3, 5.0}}), settings);
  run(world, 1.0);
  World other = holding(bar({}), settings);
  const Result<DecodedWorld> read = decode(encode(*world.capture()));
  ASSERT_TRUE(read.ok()) << (read.ok() ? "" : read.error().detail);
  other.restore(*read->world);
  EXPECT_EQ(other.stateHash(), world.stateHash());
  const double before = heldForce(world);
  CutCommand cut;
  cut.blades.origin = Vec3(0.09, 0.0, 0.5);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3::UnitZ();
  for (World* one : {&world, &other}) {
    const CutReply reply = test::replyOf<CutReply>(one->apply(cut));
    ASSERT_EQ(reply.new_bodies.size(), 2u);
    // The piece that is held bears as much as before, at once: had it forgotten, three times as much.
    double held = 0.0;
    for (const std::string& name : reply.new_bodies)
      if (const BodyLoad load = *one->load(name, {}); !load.clamps.empty()) held = load.clamps[0].force.norm();
    EXPECT_NEAR(held, before, 0.02 * before);
    run(*one, 0.5);
  }
  EXPECT_EQ(other.stateHash(), world.stateHash());
  ASSERT_TRUE(world.apply(UndoCutCommand{}).ok());
  EXPECT_NEAR(heldForce(world), before, 1e-9 * before);
}

// Set in the middle of a strain: what relaxes from now on begins with the whole stress, and what relaxes no more has
// it.
TEST(Creep, RelaxationIsSetWhileTissueIsStrained) {
  WorldSettings settings = test::weightless();
  settings.gravity = Vec3(0.0, 0.0, -0.5);
  World world = holding(bar({}), settings);
  run(world, 2.0);
  const double sag = sagOf(world), held = heldForce(world);
  SetMaterialCommand set;
  set.body = "bar";
  const auto with = [](const std::vector<Relaxation>& relaxation) {
    return [relaxation](const Material& before) -> Result<Material> {
      Material after = before;
      after.relaxation = relaxation;
      return after;
    };
  };
  set.change = with({{0.5, 1.0}});
  ASSERT_TRUE(world.apply(set).ok());
  run(world, 0.1);
  EXPECT_NEAR(heldForce(world), held, 0.05 * held);
  run(world, 8.0);
  EXPECT_GT(sagOf(world), 1.5 * sag);
  set.change = with({});
  ASSERT_TRUE(world.apply(set).ok());
  run(world, 4.0);
  EXPECT_NEAR(sagOf(world), sag, 0.03 * sag);
  set.change = with({{0.5, 1.0}, {0.2, 1.0}});
  ASSERT_TRUE(world.apply(set).ok());
  run(world, 0.02);
  EXPECT_NEAR(sagOf(world), sag, 0.05 * sag) << "nothing of the first relaxation is left";
}

}  // namespace creep_test
}  // namespace meshless
