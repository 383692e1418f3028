// Graspers that latch: what they have grasped stays in the jaws until they open. In the world at its defaults.
#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/world/saved_world.h"
#include "meshless_surgery/world/world.h"
#include "support/bodies.h"

namespace meshless {
namespace latch_test {

const Quat kDown(Eigen::AngleAxisd(0.5 * M_PI, Vec3::UnitY()));
const Vec3 kSize(0.03, 0.01, 0.03);

void run(World& world, double seconds) {
  for (int step = 0; step < std::lround(seconds * world.settings().step_rate); ++step) world.step();
}

void lead(World& world, const Vec3& to, double seconds, double jaw, const Quat& turn = kDown) {
  const Instrument before = world.snapshot({}).instruments.at(0);
  const int steps = std::max(1, static_cast<int>(std::lround(seconds * world.settings().step_rate)));
  for (int step = 1; step <= steps; ++step) {
    const double share = static_cast<double>(step) / steps;
    LeadInstrumentCommand command;
    command.name = "left";
    command.pose = Pose{before.target.rotation.slerp(share, turn),
                        before.target.translation + share * (to - before.target.translation)};
    command.jaw = before.jaw_target + share * (jaw - before.jaw_target);
    ASSERT_TRUE(world.apply(command).ok());
    world.step();
  }
}

bool said(World& world, EventType type) {
  const std::vector<Event> events = world.takeEvents();
  return std::any_of(events.begin(), events.end(), [type](const Event& e) { return e.type == type; });
}

double heightOf(World& world) {
  const WorldSnapshot shot = world.snapshot({false, false, true});
  return shot.bodies[0].measures.centre_of_mass.z();
}

/// Jaws that have closed on a block.
World closed(bool latch, double youngs = 1e4, double friction = 0.0) {
  World world{WorldSettings()};
  BodyDef def = test::defOf(boxMesh(kSize, 0.005), "block");
  def.pose.translation.z() = 0.016;
  def.material.youngs_modulus = youngs;
  def.material.poissons_ratio = 0.4;
  def.material.density = 1000.0;
  def.material.damping = 5.0;
  def.material.friction = friction;
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  InstrumentDef grasper;
  grasper.name = "left";
  grasper.type = InstrumentType::kGrasper;
  grasper.pose = {kDown, Vec3(0, 0, 0.06)};
  grasper.friction = friction;
  grasper.latch = latch;
  EXPECT_TRUE(world.apply(AttachInstrumentCommand{grasper}).ok());
  run(world, 0.3);
  lead(world, Vec3(0, 0, 0.06), 0.3, 1.2);
  lead(world, Vec3(0, 0, 0.02), 0.5, 1.2);
  lead(world, Vec3(0, 0, 0.02), 0.5, 0.0);
  return world;
}

TEST(Latch, HoldsWhatFrictionDoesNotUntilTheJawsOpen) {
  for (const bool latch : {false, true}) {
    World world = closed(latch);
    EXPECT_TRUE(said(world, EventType::kGrasped));
    lead(world, Vec3(0, 0, 0.12), 1.0, 0.0);
    run(world, 2.0);
    if (!latch) {
      EXPECT_LT(heightOf(world), 0.03);
      continue;
    }
    EXPECT_GT(heightOf(world), 0.08);
    EXPECT_FALSE(said(world, EventType::kDropped));
    constexpr int kSteps = 120;  // in the mean, as it swings
    double force = 0.0;          // [N] downwards
    for (int step = 0; step < kSteps; ++step) {
      world.step();
      force -= world.snapshot({}).instruments[0].force.z() / kSteps;
    }
    const double weight = kSize.prod() * 1000.0 * 9.81;
    EXPECT_NEAR(force, weight, 0.05 * weight);
    EXPECT_EQ(world.snapshot({}).instruments[0].holds, "block");
    EXPECT_TRUE(world.snapshot({}).picks.empty());  // it is nobody's pick
    ASSERT_TRUE(world.apply(ClearPicksCommand{}).ok());
    run(world, 0.5);
    EXPECT_GT(heightOf(world), 0.08);
    lead(world, Vec3(0, 0, 0.12), 0.3, 1.2);
    EXPECT_TRUE(said(world, EventType::kReleased));
    run(world, 1.0);
    EXPECT_LT(heightOf(world), 0.03);
  }
}

// Thrown about, so that friction of 0.3 alone lets go: what was grasped goes along, neither gains energy nor comes off.
TEST(Latch, StaysInJawsThatAreThrownAbout) {
  for (const double youngs : {3e3, 1e4, 1e5}) {
    SCOPED_TRACE(youngs);
    World world = closed(true, youngs, 0.3);
    for (int k = 0; k < 8; ++k)
      lead(world, Vec3(0.05 * (k % 2), 0.05 * (k % 3), 0.1 + 0.05 * (k % 2)), 0.15, 0.0,
           kDown * Quat(Eigen::AngleAxisd(0.5 * (k % 2), Vec3::UnitZ())));
    lead(world, Vec3(0, 0, 0.12), 0.5, 0.0);
    run(world, 3.0);
    const WorldSnapshot shot = world.snapshot({false, true, true});
    EXPECT_EQ(shot.instruments[0].holds, "block");
    EXPECT_LT(shot.bodies[0].measures.kinetic_energy, 1e-6);
    EXPECT_NEAR(shot.bodies[0].measures.volume, kSize.prod(), 0.2 * kSize.prod());
    EXPECT_NEAR(heightOf(world), 0.115, 0.02);
    for (const Event& event : world.takeEvents()) EXPECT_NE(event.type, EventType::kFault) << event.text;
  }
}

TEST(Latch, ItIsSavedAndUndone) {
  World world = closed(true);
  lead(world, Vec3(0, 0, 0.12), 0.5, 0.0);
  const auto decoded = decode(encode(*world.capture()));
  ASSERT_TRUE(decoded.ok()) << decoded.error().detail;
  World other{WorldSettings()};
  other.restore(*decoded->world);
  EXPECT_EQ(world.stateHash(), other.stateHash());
  for (World* one : {&world, &other}) run(*one, 0.5);
  EXPECT_EQ(world.stateHash(), other.stateHash());
  // A cut beside the jaws: the piece in them stays there. What was cut comes back into jaws that have let go, and
  // falls.
  CutCommand cut;
  cut.blades.origin = Vec3(0.011, -1, 0.1);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3::UnitZ();
  ASSERT_TRUE(world.apply(cut).ok());
  run(world, 1.0);
  EXPECT_EQ(world.snapshot({}).instruments[0].holds.rfind("block.", 0), 0u);
  lead(world, Vec3(0, 0, 0.12), 0.3, 1.2);
  lead(world, Vec3(0, 0, 0.2), 0.3, 1.2);
  ASSERT_TRUE(world.apply(UndoCutCommand{}).ok());
  EXPECT_EQ(world.bodyCount(), 1u);
  run(world, 1.5);
  EXPECT_LT(heightOf(world), 0.03);
  test::replyOf<Done>(world.apply(DetachInstrumentCommand{"left"}));
  run(world, 0.1);
}

TEST(Latch, IsOfGraspersAlone) {
  InstrumentDef def;
  def.name = "left";
  def.type = InstrumentType::kScissors;
  def.latch = true;
  World world{WorldSettings()};
  const auto reply = world.apply(AttachInstrumentCommand{def});
  ASSERT_FALSE(reply.ok());
  EXPECT_NE(reply.error().detail.find("accepted: of graspers alone"), std::string::npos) << reply.error().detail;
}

}  // namespace latch_test
}  // namespace meshless
