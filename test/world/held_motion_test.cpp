// Clamps that move, in the world at its defaults.
#include <cmath>
#include <sstream>

#include <gtest/gtest.h>

#include "meshless_surgery/base/random.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/world/command_log.h"
#include "meshless_surgery/world/saved_world.h"
#include "meshless_surgery/world/world.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"

namespace meshless {
namespace held_motion_test {

const Vec3 kSize(0.2, 0.04, 0.04);  // [m]
constexpr double kYoungs = 2e4, kFree = 0.16;

HeldRegion heldBox(const Vec3& low, const Vec3& high) {
  HeldRegion held(low, high);
  held.in_world = false;
  return held;
}

// Held at both ends: 0 at the lower x, 1 at the upper.
BodyDef bar() {
  BodyDef def = test::defOf(boxMesh(kSize, 0.01), "bar");
  def.pose.translation = Vec3(0.1, 0.2, 0.5);
  def.material.youngs_modulus = kYoungs;
  def.material.poissons_ratio = 0.3;
  def.material.density = 1000.0;
  def.material.damping = 10.0;
  def.fixed = {heldBox(Vec3(-1, -1, -1), Vec3(-0.08, 1, 1)), heldBox(Vec3(0.08, -1, -1), Vec3(1, 1, 1))};
  return def;
}

World worldOf(const BodyDef& def) {
  World world{test::weightless()};
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  return world;
}

void run(World& world, double seconds) {
  for (int step = 0; step < seconds * world.settings().step_rate; ++step) world.step();
}

MoveClampCommand moving(std::uint32_t clamp, const Vec3& shift, double time, const Quat& turn = Quat::Identity()) {
  MoveClampCommand command;
  command.body = "bar";
  command.clamp = clamp;
  command.shift = shift;
  command.turn = turn;
  command.time = time;
  return command;
}

std::vector<Wrench> clamps(World& world) { return world.load("bar", {})->clamps; }

TEST(HeldMotion, ABarThatIsDrawnOutByItsEndPullsBackAsYoungSays) {
  World world = worldOf(bar());
  const auto reply = test::replyOf<MoveClampReply>(world.apply(moving(1, Vec3(0.01 * kFree, 0.0, 0.0), 0.5)));
  EXPECT_NEAR((reply.middle - Vec3(0.1 + 0.08 + 0.01 * kFree, 0.2, 0.5)).norm(), 0.0, 1e-9);
  run(world, 4.0);
  const double expected = kYoungs * kSize.y() * kSize.z() * 0.01;
  const std::vector<Wrench> loads = clamps(world);
  ASSERT_EQ(loads.size(), 2u);
  // Its ends cannot become narrower, which stiffens it a little.
  EXPECT_NEAR(loads[1].force.x(), expected, 0.03 * expected);
  EXPECT_NEAR(loads[0].force.x(), -loads[1].force.x(), 0.005 * expected);
  EXPECT_LT(loads[1].force.tail<2>().norm(), 0.001 * expected);
}

TEST(HeldMotion, ABarThatIsTwistedTurnsBackAsSaintVenantSays) {
  World world = worldOf(bar());
  const double angle = 0.1;
  test::replyOf<MoveClampReply>(
      world.apply(moving(1, Vec3::Zero(), 0.5, Quat(Eigen::AngleAxisd(angle, Vec3::UnitX())))));
  run(world, 4.0);
  const double a = kSize.y(), shear = kYoungs / 2.6;
  const double expected = shear * 0.1406 * a * a * a * a * angle / kFree;
  const std::vector<Wrench> loads = clamps(world);
  const Vec3 middle = Vec3(0.18, 0.2, 0.5);
  EXPECT_NEAR((loads[1].torque - middle.cross(loads[1].force)).x(), expected, 0.06 * expected);
}

double endOf(World& world) {
  const WorldSnapshot shot = world.snapshot({true, false, false});
  return boundsOf(shot.bodies[0].surface).max.x();
}

TEST(HeldMotion, ItGoesEvenlyWakesAndSleepsAgain) {
  World world = worldOf(bar());
  run(world, 2.0);
  EXPECT_TRUE(world.snapshot({}).bodies[0].asleep);
  const double from = endOf(world);
  test::replyOf<MoveClampReply>(world.apply(moving(1, Vec3(0.02, 0.0, 0.0), 1.0)));
  EXPECT_FALSE(world.snapshot({}).bodies[0].asleep);
  for (const double part : {0.25, 0.5, 0.75, 1.0}) {
    run(world, 0.25);
    EXPECT_NEAR(endOf(world) - from, 0.02 * part, 1e-6);
  }
  run(world, 6.0);
  EXPECT_TRUE(world.snapshot({}).bodies[0].asleep);
  EXPECT_NEAR(endOf(world) - from, 0.02, 1e-9);
  // However slowly: what is on its way does not sleep.
  test::replyOf<MoveClampReply>(world.apply(moving(1, Vec3(0.0201, 0.0, 0.0), 10.0)));
  run(world, 10.0);
  EXPECT_NEAR(endOf(world) - from, 0.0201, 1e-9);
  test::replyOf<MoveClampReply>(world.apply(moving(1, Vec3::Zero(), 0.0)));
  world.step();
  EXPECT_NEAR(endOf(world), from, 1e-9);
}

// As a robot's arm would carry it: turned about the world's origin, in all pieces that a cut leaves, without a word.
TEST(HeldMotion, AStreamLeadsAllThatABodyHasBecome) {
  World world = worldOf(bar());
  CutCommand cut;
  cut.blades.origin = Vec3(-1.0, 0.2, 0.4);
  cut.blades.x_axis = Vec3::UnitX();
  cut.blades.y_axis = Vec3::UnitZ();
  ASSERT_TRUE(world.apply(cut).ok());
  ASSERT_EQ(world.bodyCount(), 2u);
  run(world, 1.0);
  const auto held = [&world] {
    Points places;
    for (const BodySnapshot& body : world.snapshot({false, true, false}).bodies)
      for (Index i = 0; i < body.particles.size(); ++i)
        if (body.model->fixed[i] && body.model->holderOf(i) == 1) places.push_back(body.particles[i]);
    return places;
  };
  const Points before = held();
  ASSERT_GT(before.size(), 20u);
  (void)world.takeEvents();
  const Pose arm = {Quat(Eigen::AngleAxisd(0.1, Vec3(1, 2, 3).normalized())), Vec3(0.01, -0.02, 0.03)};
  MoveClampCommand lead = moving(1, arm.translation, 0.03, arm.rotation);
  lead.streamed = true;
  test::replyOf<MoveClampReply>(world.apply(lead));
  EXPECT_LT((world.clampMotion("bar", 1).translation - arm.translation).norm(), 1e-12);
  EXPECT_LT(world.clampMotion("bar", 1).rotation.angularDistance(arm.rotation), 1e-9);
  run(world, 1.0);
  const Points after = held();
  ASSERT_EQ(after.size(), before.size());
  for (Index i = 0; i < before.size(); ++i) EXPECT_LT((after[i] - arm * before[i]).norm(), 1e-9);
  for (const Event& event : world.takeEvents()) EXPECT_NE(event.type, EventType::kClampMoved);
  // A frame that stands still wakes nobody, and one that jumps is not followed faster than a hand goes.
  run(world, 8.0);
  test::replyOf<MoveClampReply>(world.apply(lead));
  for (const BodySnapshot& body : world.snapshot({}).bodies) EXPECT_TRUE(body.asleep);
  lead.shift += Vec3(0.5, 0.0, 0.0);
  test::replyOf<MoveClampReply>(world.apply(lead));
  run(world, 0.25);
  EXPECT_NEAR((held()[0] - after[0]).x(), 0.25 * kFollowSpeed, 0.01);
  // Of what the scene does not have nothing is led.
  lead.body = "nobody";
  EXPECT_TRUE(world.apply(lead).ok());
}

TEST(HeldMotion, ItIsSavedReplayedAndUndoneToTheBit) {
  World world = worldOf(bar());
  std::string log;
  world.record([&log](std::string bytes) { log += bytes; });
  test::replyOf<MoveClampReply>(
      world.apply(moving(1, Vec3(0.02, 0.01, 0.0), 1.0, Quat(Eigen::AngleAxisd(1.0, Vec3::UnitX())))));
  run(world, 0.3);
  const auto saved = world.capture();
  const auto decoded = decode(encode(*saved));
  ASSERT_TRUE(decoded.ok()) << decoded.error().detail;
  World other{WorldSettings()};
  other.restore(*decoded->world);
  const std::uint64_t before = world.stateHash();
  EXPECT_EQ(other.stateHash(), before);
  CutCommand cut;
  cut.blades.origin = Vec3(0.1, 0.2, 0.4);
  cut.blades.x_axis = Vec3::UnitZ();
  cut.blades.y_axis = Vec3::UnitY();
  const Points whole = world.snapshot({false, true, false}).bodies[0].particles;
  for (World* one : {&world, &other}) {
    ASSERT_TRUE(one->apply(cut).ok());
    run(*one, 0.4);
    EXPECT_EQ(one->bodyCount(), 2u);
  }
  EXPECT_EQ(world.stateHash(), other.stateHash());
  // Each piece hangs on its clamp, and the moved one goes on.
  const double end = endOf(world);
  run(world, 0.4);
  EXPECT_GT(std::abs(boundsOf(world.snapshot({true, false, false}).bodies[1].surface).max.x() - end) +
                std::abs(boundsOf(world.snapshot({true, false, false}).bodies[0].surface).max.x() - end),
            1e-4);
  ASSERT_TRUE(world.apply(UndoCutCommand{}).ok());
  ASSERT_EQ(world.bodyCount(), 1u);
  EXPECT_EQ(world.snapshot({false, true, false}).bodies[0].particles, whole);
  run(world, 2.0);  // the rest of the way
  EXPECT_NEAR(endOf(world), 0.2 + 0.02, 1e-9);
  world.record(nullptr);
  std::istringstream recorded(log);
  const Result<ReplayReport> replayed = replay(recorded);
  ASSERT_TRUE(replayed.ok()) << replayed.error().detail;
  EXPECT_EQ(replayed->hash, world.stateHash());
}

TEST(HeldMotion, WhatCannotBeIsRefusedAndChangesNothing) {
  BodyDef free = bar();
  free.name = "free";
  free.fixed.clear();
  free.pose.translation.z() = 2.0;
  World world = worldOf(bar());
  ASSERT_TRUE(world.addSceneBody(test::shared(free)).ok());
  const std::uint64_t hash = world.stateHash();
  const auto refused = [&](MoveClampCommand command, ErrorCode code, const std::string& said) {
    const auto reply = world.apply(command);
    ASSERT_FALSE(reply.ok());
    EXPECT_EQ(reply.error().code, code);
    EXPECT_NE(reply.error().detail.find(said), std::string::npos) << reply.error().detail;
    EXPECT_EQ(world.stateHash(), hash);
  };
  MoveClampCommand command = moving(1, Vec3::Zero(), 1.0);
  command.body = "none";
  refused(command, ErrorCode::kUnknownName, "there is no body 'none'");
  command.body = "free";
  refused(command, ErrorCode::kMissed, "nothing holds 'free'");
  refused(moving(2, Vec3::Zero(), 1.0), ErrorCode::kMissed, "accepted: 0, 1");
  refused(moving(1, Vec3(2e3, 0, 0), 1.0), ErrorCode::kInvalidArgument, "accepted: up to 1000 m");
  refused(moving(1, Vec3(NAN, 0, 0), 1.0), ErrorCode::kInvalidArgument, "shift is not finite");
  refused(moving(1, Vec3::Zero(), -1.0), ErrorCode::kInvalidArgument, "accepted: 0 to 3600 s");
  refused(moving(1, Vec3::Zero(), 1.0, Quat(0, 0, 0, 0)), ErrorCode::kInvalidArgument, "accepted: 1");
}

// A cloth has no cells: its particles are held, and are led alike.
TEST(HeldMotion, AClothIsDrawnOutByItsEdge) {
  BodyDef def;
  def.name = "bar";
  constexpr Index kSide = 11;
  for (Index i = 0; i < kSide; ++i)
    for (Index j = 0; j < kSide; ++j) def.mesh.vertices.emplace_back(0.01 * i - 0.05, 0.01 * j - 0.05, 0.0);
  for (Index i = 0; i + 1 < kSide; ++i)
    for (Index j = 0; j + 1 < kSide; ++j) {
      const Index a = i * kSide + j, b = a + kSide;
      def.mesh.triangles.push_back({a, b, b + 1});
      def.mesh.triangles.push_back({a, b + 1, a + 1});
    }
  def.solid = false;
  def.material = bar().material;
  def.fixed = {heldBox(Vec3(-1, -1, -1), Vec3(-0.045, 1, 1)), heldBox(Vec3(0.045, -1, -1), Vec3(1, 1, 1))};
  World world = worldOf(def);
  const double from = endOf(world);
  test::replyOf<MoveClampReply>(world.apply(moving(1, Vec3(0.01, 0.0, 0.0), 0.5)));
  run(world, 3.0);
  EXPECT_NEAR(endOf(world) - from, 0.01, 1e-9);
}

// What is led hits what lies in its way, however suddenly.
TEST(HeldMotion, ALedBlockPushesWhatSleepsBesideIt) {
  for (const double time : {0.0, 0.3}) {
    WorldSettings settings;
    settings.gravity.setZero();
    settings.ground.reset();
    World world{settings};
    BodyDef led = bar();
    led.fixed = {heldBox(Vec3(-1, -1, -1), Vec3(0.05, 1, 1))};
    BodyDef beside = bar();
    beside.name = "beside";
    beside.fixed.clear();
    beside.pose.translation.x() += 0.21;
    ASSERT_TRUE(world.addSceneBody(test::shared(led)).ok());
    ASSERT_TRUE(world.addSceneBody(test::shared(beside)).ok());
    run(world, 1.0);
    const auto middle = [&] { return world.snapshot({false, false, true}).bodies[1].measures.centre_of_mass.x(); };
    const double from = middle();
    test::replyOf<MoveClampReply>(world.apply(moving(0, Vec3(0.03, 0.0, 0.0), time)));
    run(world, 1.0);
    EXPECT_GT(middle() - from, 0.015) << time;
  }
}

// Whatever the hand does: jumps of metres within a step, turns inside out, entries one upon the other, and back.
TEST(HeldMotion, RandomOrgansComeBackFromWhateverTheirClampsDo) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed * 5003);
    BodyDef def = test::defOf(*randomOrgan(seed, random.whole(0, 2), 0.1, 1500), "bar");
    const Box box = boundsOf(def.mesh.vertices);
    const double part = random.between(0.15, 0.35);
    Vec3 low = box.max, high = box.min;
    low.x() = box.max.x() - part * (box.max.x() - box.min.x());
    high.x() = box.min.x() + part * (box.max.x() - box.min.x());
    def.fixed = {heldBox(box.min - Vec3::Ones(), Vec3(high.x(), 1, 1)), heldBox(Vec3(low.x(), -1, -1), Vec3(1, 1, 1))};
    def.material.youngs_modulus = random.logBetween(2e3, 1e5);
    def.material.poissons_ratio = random.between(0.3, 0.48);
    def.material.damping = random.between(5.0, 10.0);
    World world = worldOf(def);
    const double rest = world.snapshot({false, false, true}).bodies[0].measures.volume;
    for (int k = 0; k < 12; ++k) {
      const double far = random.logBetween(1e-3, 1.0), time = random.chance(0.5) ? 0.0 : random.between(0.0, 0.2);
      const Quat turn(Eigen::AngleAxisd(random.between(-3.1, 3.1), random.inCube(1.0).normalized()));
      test::replyOf<MoveClampReply>(
          world.apply(moving(static_cast<std::uint32_t>(random.whole(0, 1)), random.inCube(far), time, turn)));
      run(world, random.between(0.02, 0.3));
    }
    for (const std::uint32_t clamp : {0u, 1u})
      test::replyOf<MoveClampReply>(world.apply(moving(clamp, Vec3::Zero(), 0.5)));
    run(world, 8.0);
    const WorldSnapshot shot = world.snapshot({true, true, true});
    for (const Vec3& p : shot.bodies[0].particles) ASSERT_TRUE(p.allFinite());
    EXPECT_NEAR(shot.bodies[0].measures.volume, rest, 0.02 * rest);
    for (const Event& event : world.takeEvents()) EXPECT_NE(event.type, EventType::kFault) << event.text;
  }
}

}  // namespace held_motion_test
}  // namespace meshless
