// Instruments that touch tissue, in the world at its defaults.
#include <cmath>
#include <functional>
#include <sstream>

#include <gtest/gtest.h>

#include "meshless_surgery/base/random.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/world/command_log.h"
#include "meshless_surgery/world/saved_world.h"
#include "meshless_surgery/world/world.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"
#include "support/stress.h"

namespace meshless {
namespace instrument_test {

const Quat kDown(Eigen::AngleAxisd(0.5 * M_PI, Vec3::UnitY()));  // its shaft comes from above

Pose at(const Vec3& place, const Quat& turn = kDown) { return {turn, place}; }

InstrumentDef instrument(InstrumentType type, const Vec3& place, const std::string& name = "left") {
  InstrumentDef def;
  def.name = name;
  def.type = type;
  def.pose = at(place);
  return def;
}

void attach(World& world, const InstrumentDef& def) {
  const auto reply = world.apply(AttachInstrumentCommand{def});
  ASSERT_TRUE(reply.ok()) << reply.error().detail;
}

void run(World& world, double seconds) {
  for (int step = 0; step < std::lround(seconds * world.settings().step_rate); ++step) world.step();
}

Instrument stateOf(World& world, std::size_t n = 0) { return world.snapshot({}).instruments.at(n); }

// The hand goes there evenly, as a stream says it.
void lead(World& world, const Vec3& to, double seconds, std::optional<double> jaw = {}, const Quat& turn = kDown,
          const std::string& name = "left", const std::function<void()>& each = {}) {
  Pose from;
  double open = 0.0;
  for (const Instrument& i : world.snapshot({}).instruments)
    if (i.def.name == name) from = i.target, open = i.jaw_target;
  const int steps = std::max(1, static_cast<int>(std::lround(seconds * world.settings().step_rate)));
  for (int step = 1; step <= steps; ++step) {
    const double share = static_cast<double>(step) / steps;
    LeadInstrumentCommand command;
    command.name = name;
    command.pose = Pose{from.rotation.slerp(share, turn), from.translation + share * (to - from.translation)};
    if (jaw) command.jaw = open + share * (*jaw - open);
    const auto reply = world.apply(command);
    ASSERT_TRUE(reply.ok()) << reply.error().detail;
    world.step();
    if (each) each();
  }
}

bool said(World& world, EventType type) {
  const std::vector<Event> events = world.takeEvents();
  return std::any_of(events.begin(), events.end(), [type](const Event& e) { return e.type == type; });
}

BodyDef softBlock(const Vec3& size, double edge, double youngs, const Vec3& place) {
  BodyDef def = test::defOf(boxMesh(size, edge), "block");
  def.pose.translation = place;
  def.material.youngs_modulus = youngs;
  def.material.poissons_ratio = 0.4;
  def.material.density = 1000.0;
  def.material.damping = 5.0;
  return def;
}

TEST(Instruments, WhereNothingIsInTheWayAnInstrumentIsWhereItsHandIs) {
  World world{WorldSettings()};
  attach(world, instrument(InstrumentType::kGrasper, Vec3(0, 0, 0.2)));
  double farthest = 0.0;
  lead(world, Vec3(0.3, 0.1, 0.3), 0.5, 1.0, Quat::Identity(), "left", [&] {
    const Instrument now = stateOf(world);
    farthest = std::max({farthest, (now.pose.translation - now.target.translation).norm(),
                         now.pose.rotation.angularDistance(now.target.rotation), std::abs(now.jaw - now.jaw_target)});
  });
  EXPECT_LT(farthest, 1e-9);
  EXPECT_TRUE(stateOf(world).force.isZero(0.0));
  // A pose that jumps is gone to at max_speed.
  LeadInstrumentCommand command;
  command.name = "left";
  command.pose = at(Vec3(1.3, 0.1, 0.3));
  ASSERT_TRUE(world.apply(command).ok());
  run(world, 0.5);
  EXPECT_NEAR(stateOf(world).pose.translation.x(), 0.8, 0.01);
  run(world, 0.6);
  EXPECT_NEAR(stateOf(world).pose.translation.x(), 1.3, 1e-6);
}

TEST(Instruments, AProbePressesWithTheForceOfItsSpringAndNoMoreThanItMay) {
  World world{WorldSettings()};
  ASSERT_TRUE(world.addSceneBody(test::shared(softBlock(Vec3(0.1, 0.1, 0.05), 0.01, 2e4, Vec3(0, 0, 0.026)))).ok());
  InstrumentDef probe = instrument(InstrumentType::kProbe, Vec3(0, 0, 0.08));
  probe.shaft_radius = 0.005;
  attach(world, probe);
  run(world, 0.5);
  const double weight = 1000.0 * 0.1 * 0.1 * 0.05 * 9.81;
  lead(world, Vec3(0, 0, 0.045), 1.0);
  run(world, 2.0);
  Instrument now = stateOf(world);
  const double pressed = probe.stiffness * (now.pose.translation.z() - now.target.translation.z());
  EXPECT_GT(pressed, 0.5);
  EXPECT_NEAR(now.force.z(), pressed, 0.01 * pressed);
  double ground = 0.0;
  const WorldSnapshot shot = world.snapshot({false, false, false, true});
  for (const ContactPoint& point : shot.contacts)
    if (point.normal.z() > 0.5) ground += point.pressed();
  EXPECT_NEAR(ground, weight + pressed, 0.001 * ground);
  lead(world, Vec3(0, 0, -0.2), 1.0);
  run(world, 2.0);
  now = stateOf(world);
  EXPECT_NEAR(now.force.z(), probe.max_force, 0.02 * probe.max_force);
}

TEST(Instruments, TheGroundHoldsAnInstrumentWithAsMuchAsItsHandPresses) {
  World world{WorldSettings()};
  const InstrumentDef probe = instrument(InstrumentType::kProbe, Vec3(0, 0, 0.05));
  attach(world, probe);
  lead(world, Vec3(0, 0, -0.002), 0.2);
  run(world, 0.5);
  EXPECT_NEAR(stateOf(world).pose.translation.z(), 0.0, 1e-9);
  EXPECT_NEAR(stateOf(world).force.z(), 0.002 * probe.stiffness, 1e-3);
  lead(world, Vec3(0, 0, -0.2), 0.2);
  run(world, 0.5);
  EXPECT_NEAR(stateOf(world).pose.translation.z(), 0.0, 1e-9);
  EXPECT_NEAR(stateOf(world).force.z(), probe.max_force, 1e-3);
}

TEST(Instruments, ObstaclesHoldAnInstrumentWithAsMuchAsItsHandPresses) {
  World world{test::weightless()};
  for (const double z : {0.0, 0.3}) {
    ObstacleDef box;
    box.name = z > 0.0 ? "upper" : "lower";
    box.mesh = boxMesh(Vec3(0.1, 0.1, 0.04), 0.02);
    for (Vec3& p : box.mesh.vertices) p.z() += z;
    ASSERT_TRUE(world.addObstacle(box).ok());
  }
  const InstrumentDef probe = instrument(InstrumentType::kProbe, Vec3(0.01, 0.02, 0.05));
  InstrumentDef within = probe;
  within.name = "within";
  within.pose.translation.z() = 0.01;
  const auto refused = world.apply(AttachInstrumentCommand{within});
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().detail.find("inside of obstacle 'lower'"), std::string::npos) << refused.error().detail;
  InstrumentDef across = probe;  // its shaft does not go through the upper one
  across.shaft_length = 0.15;
  attach(world, across);
  lead(world, Vec3(0.01, 0.02, 0.0175), 0.2);
  run(world, 0.3);
  EXPECT_NEAR(stateOf(world).pose.translation.z(), 0.02, 2e-4);
  EXPECT_NEAR(stateOf(world).force.z(), 0.0025 * probe.stiffness, 0.5);
  lead(world, Vec3(-0.02, 0.01, -0.3), 0.4);
  run(world, 0.3);
  EXPECT_NEAR(stateOf(world).pose.translation.z(), 0.02, 5e-4);
  EXPECT_NEAR(stateOf(world).pose.translation.x(), -0.02, 1e-3);
  EXPECT_NEAR(stateOf(world).force.z(), probe.max_force, 0.05 * probe.max_force);
  // Beside it, and up: nothing is in the way.
  lead(world, Vec3(-0.02, 0.01, 0.1), 0.4);
  EXPECT_NEAR(stateOf(world).pose.translation.z(), 0.1, 1e-4);
}

TEST(Instruments, JawsThatPullAStripSlipAtTwiceTheFrictionOfTheirGrip) {
  constexpr double kWay = 2e-4;  // [m] in 50 ms
  for (const double friction : {0.1, 0.2, 0.4, 0.7, 1.0}) {
    World world{test::weightless()};
    BodyDef strip = softBlock(Vec3(0.08, 0.009, 0.003), 0.003, 2e5, Vec3::Zero());
    strip.material.friction = friction;
    HeldRegion held(Vec3(-0.02, -1, -1), Vec3(1, 1, 1));
    held.in_world = false;
    strip.fixed = {held};
    ASSERT_TRUE(world.addSceneBody(test::shared(strip)).ok());
    const Quat turn(Eigen::AngleAxisd(0.5 * M_PI, Vec3::UnitX()));  // along x, jaws open to z
    InstrumentDef def = instrument(InstrumentType::kGrasper, Vec3(-0.09, 0, 0));
    def.pose.rotation = turn;
    def.friction = friction;
    def.jaw_length = 0.03;
    def.grip = 1.0;
    attach(world, def);
    lead(world, Vec3(-0.09, 0, 0), 0.3, 0.8, turn);
    lead(world, Vec3(-0.025, 0, 0), 0.5, 0.8, turn);
    lead(world, Vec3(-0.025, 0, 0), 0.5, 0.0, turn);
    run(world, 0.5);
    EXPECT_EQ(stateOf(world).holds, "block");
    double sum = 0.0, end = 0.0;
    int count = 0;
    for (int k = 0; k < 90 && count < 15; ++k) {
      lead(world, Vec3(-0.025 - kWay * (k + 1), 0, 0), 0.05, 0.0, turn);
      const WorldSnapshot shot = world.snapshot({true});
      const Instrument& now = shot.instruments[0];
      const double moved = std::exchange(end, boundsOf(shot.bodies[0].surface).min.x()) - end;
      if (k == 0 || moved > 0.2 * kWay) continue;  // it goes along
      const double half = 0.5 * now.jaw, along = now.force.x() / (2.0 * now.gripped);
      sum += (along + std::sin(half)) / std::cos(half), ++count;  // jaws are a wedge
    }
    EXPECT_EQ(count, 15);
    EXPECT_NEAR(sum / count, friction, 0.05 * friction);
  }
}

TEST(Instruments, JawsLiftABlockByFrictionHoldItAndLetItFall) {
  World world{WorldSettings()};
  ASSERT_TRUE(world.addSceneBody(test::shared(softBlock(Vec3(0.03, 0.01, 0.03), 0.005, 1e4, Vec3(0, 0, 0.016)))).ok());
  attach(world, instrument(InstrumentType::kGrasper, Vec3(0, 0, 0.06)));
  run(world, 0.3);
  lead(world, Vec3(0, 0, 0.06), 0.3, 1.2);
  lead(world, Vec3(0, 0, 0.02), 0.5, 1.2);
  lead(world, Vec3(0, 0, 0.02), 0.5, 0.0);
  run(world, 0.3);
  EXPECT_TRUE(said(world, EventType::kGrasped));
  lead(world, Vec3(0, 0, 0.12), 1.0, 0.0);
  run(world, 3.0);
  Instrument now = stateOf(world);
  const auto middle = [&] {
    const WorldSnapshot shot = world.snapshot({true});
    Vec3 sum = Vec3::Zero();
    for (const Vec3& p : shot.bodies[0].surface) sum += p / static_cast<double>(shot.bodies[0].surface.size());
    return sum;
  };
  EXPECT_NEAR(-now.force.z(), 0.03 * 0.01 * 0.03 * 1000.0 * 9.81, 1e-3);
  EXPECT_GT(middle().z(), 0.08);
  EXPECT_FALSE(said(world, EventType::kDropped));
  lead(world, Vec3(0, 0, 0.12), 0.3, 1.2);
  run(world, 1.0);
  EXPECT_LT(middle().z(), 0.03);
  EXPECT_TRUE(said(world, EventType::kReleased));
}

// Of tissue in the jaws, of how small it gets, and of what it throws about.
struct Worst {
  double deepest = 0.0;  // [m] of a vertex inside of an instrument
  double least = 1.0;    // of the volume at rest
  double fastest = 0.0;  // [m/s] a second after the last drag
};

Worst dragsOf(std::uint64_t seed, int drags) {
  Random random(seed);
  World world{WorldSettings()};
  const auto mesh = randomOrgan(seed, static_cast<int>(seed % 2), 0.08, 1500);
  Worst worst;
  EXPECT_TRUE(mesh.ok());
  if (!mesh.ok()) return worst;
  BodyDef def = test::defOf(*mesh, "block");
  def.pose.translation = Vec3(0, 0, 0.002 - boundsOf(mesh->vertices).min.z());
  def.material.youngs_modulus = random.logBetween(500.0, 2e5);
  def.material.poissons_ratio = random.between(0.3, 0.47);
  def.material.density = 1000.0;
  def.material.friction = random.between(0.0, 1.0);
  const auto body = prepareBody(def);
  EXPECT_TRUE(body.ok());
  if (!body.ok()) return worst;
  EXPECT_TRUE(world.addSceneBody(std::make_shared<PreparedBody>(*body)).ok());
  for (const char* name : {"left", "right"}) {
    InstrumentDef of = instrument(random.chance(0.7) ? InstrumentType::kGrasper : InstrumentType::kProbe,
                                  Vec3(name[0] == 'l' ? -0.1 : 0.1, 0, 0.2), name);
    of.friction = random.between(0.0, 1.0);
    of.grip = random.logBetween(0.5, 20.0);
    attach(world, of);
  }
  const double volume = signedVolume(body->model->surface);
  const Vec3 middle(0, 0, 0.02);
  int frames = 0;
  const auto look = [&] {
    if (++frames % 4 != 0) return;
    const WorldSnapshot shot = world.snapshot({true, true});
    const BodySnapshot& now = shot.bodies[0];
    for (std::size_t n = 0; n < 2; ++n) {
      TriangleMesh metal = shot.instrument_shapes[n]->mesh;
      shot.instrument_shapes[n]->place(shot.instruments[n].pose, shot.instruments[n].jaw, metal.vertices);
      const Box bounds = boundsOf(metal.vertices);
      const SolidQuery solid(metal);
      for (const Vec3& p : now.surface)
        if (bounds.contains(p) && solid.contains(p)) worst.deepest = std::max(worst.deepest, solid.distance(p));
    }
    TriangleMesh tissue = now.model->surface;
    tissue.vertices = now.surface;
    worst.least = std::min(worst.least, signedVolume(tissue) / volume);
    if (!test::allFinite(now.surface)) worst.deepest = std::numeric_limits<double>::infinity();
  };
  for (int drag = 0; drag < drags; ++drag) {
    const std::string name = random.chance(0.5) ? "left" : "right";
    const Instrument now = stateOf(world, name == "left" ? 0 : 1);
    const Vec3 to =
        middle + Vec3(random.between(-0.06, 0.06), random.between(-0.06, 0.06), random.between(-0.02, 0.05));
    const Quat turn = Quat(Eigen::AngleAxisd(random.between(0.2, M_PI - 0.2), Vec3::UnitY())) *
                      Quat(Eigen::AngleAxisd(random.between(-3.0, 3.0), Vec3::UnitX()));
    const double seconds = std::max(0.1, (to - now.target.translation).norm() / random.between(0.05, 0.5));
    std::optional<double> jaw;
    if (now.def.hasJaws()) jaw = random.chance(0.5) ? 0.0 : 1.2;
    lead(world, to, seconds, jaw, turn, name, look);
  }
  run(world, 1.0);
  const WorldSnapshot before = world.snapshot({true});
  world.step();
  const WorldSnapshot after = world.snapshot({true});
  for (std::size_t v = 0; v < after.bodies[0].surface.size(); ++v)
    worst.fastest = std::max(worst.fastest, 120.0 * (after.bodies[0].surface[v] - before.bodies[0].surface[v]).norm());
  return worst;
}

TEST(Instruments, RandomClosingsAndDragsLetNothingThroughTheJaws) {
  for (std::uint64_t seed = 2; seed < 8; ++seed) {
    SCOPED_TRACE(seed);
    const Worst worst = dragsOf(seed, 12);
    EXPECT_LT(worst.deepest, 1e-3);
    EXPECT_GT(worst.least, 0.1);
    EXPECT_LT(worst.fastest, 0.3);
  }
}

// Hundreds, with what was found: 6 of 206 had a vertex more than 1 mm in an instrument, at most 2.2 mm in a shaft.
TEST(Instruments, RandomClosingsAndDrags_Long) {
  const std::uint64_t first = 1000 + static_cast<std::uint64_t>(stress::seed());
  int deep = 0;
  constexpr int kRuns = 40;
  for (std::uint64_t seed = first; seed < first + kRuns; ++seed) {
    SCOPED_TRACE(seed);
    const Worst worst = dragsOf(seed, 16);
    deep += worst.deepest > 1e-3;
    EXPECT_LT(worst.deepest, 2.5e-3);
    EXPECT_GT(worst.least, 0.1);
    EXPECT_LT(worst.fastest, 1.0);
  }
  EXPECT_LE(deep, kRuns / 8);
}

TEST(Instruments, AProbeThatRestsOnTissueLetsItSleepAndWakesItWhenItGoes) {
  World world{WorldSettings()};
  ASSERT_TRUE(world.addSceneBody(test::shared(softBlock(Vec3(0.06, 0.06, 0.03), 0.01, 2e4, Vec3(0, 0, 0.016)))).ok());
  attach(world, instrument(InstrumentType::kProbe, Vec3(0, 0, 0.06)));
  run(world, 1.5);
  ASSERT_TRUE(world.snapshot({}).bodies[0].asleep);
  // Beside it nothing wakes.
  lead(world, Vec3(0.05, 0.05, 0.04), 0.5);
  lead(world, Vec3(0, 0, 0.05), 0.5);
  EXPECT_TRUE(world.snapshot({}).bodies[0].asleep);
  lead(world, Vec3(0, 0, 0.025), 0.5);
  EXPECT_FALSE(world.snapshot({}).bodies[0].asleep);
  run(world, 2.0);
  EXPECT_TRUE(world.snapshot({}).bodies[0].asleep);
  const Vec3 force = stateOf(world).force;
  EXPECT_GT(force.z(), 0.1);
  run(world, 0.5);
  EXPECT_EQ(stateOf(world).force, force);
  lead(world, Vec3(0, 0, 0.026), 0.1);
  EXPECT_FALSE(world.snapshot({}).bodies[0].asleep);
  run(world, 0.1);
  EXPECT_LT(stateOf(world).force.z(), force.z());
}

TEST(Instruments, TissueGoesFromHandToHand) {
  World world{test::weightless()};
  ASSERT_TRUE(world.addSceneBody(test::shared(softBlock(Vec3(0.06, 0.006, 0.02), 0.004, 2e4, Vec3::Zero()))).ok());
  // From both ends; jaws open across.
  const Quat from_left = Quat::Identity(), from_right(Eigen::AngleAxisd(M_PI, Vec3::UnitZ()));
  const auto hand = [&](const std::string& name, double x, double z, double seconds, double jaw) {
    lead(world, Vec3(x, 0, z), seconds, jaw, name == "left" ? from_left : from_right, name);
  };
  for (const std::string name : {"left", "right"}) {
    InstrumentDef def = instrument(InstrumentType::kGrasper, Vec3(name == "left" ? -0.06 : 0.06, 0, 0), name);
    def.pose.rotation = name == "left" ? from_left : from_right;
    attach(world, def);
  }
  const auto middle = [&] {
    const WorldSnapshot shot = world.snapshot({true});
    const Box box = boundsOf(shot.bodies[0].surface);
    return Vec3(0.5 * (box.min + box.max));
  };
  hand("left", -0.06, 0, 0.5, 1.2);
  hand("left", -0.018, 0, 0.3, 1.2);
  hand("left", -0.018, 0, 0.4, 0.0);
  hand("left", -0.018, 0.1, 1.0, 0.0);
  ASSERT_EQ(stateOf(world, 0).holds, "block");
  EXPECT_NEAR(middle().z(), 0.1, 0.01);
  hand("right", 0.06, 0.1, 0.5, 1.2);
  hand("right", 0.018, 0.1, 0.3, 1.2);
  hand("right", 0.018, 0.1, 0.4, 0.0);
  EXPECT_EQ(stateOf(world, 1).holds, "block");
  world.takeEvents();
  hand("left", -0.018, 0.1, 0.3, 1.2);
  hand("left", -0.1, 0.1, 0.5, 1.2);
  EXPECT_EQ(stateOf(world, 0).holds, "");
  EXPECT_TRUE(said(world, EventType::kReleased));
  hand("right", 0.018, 0.2, 1.0, 0.0);
  EXPECT_EQ(stateOf(world, 1).holds, "block");
  EXPECT_NEAR(middle().z(), 0.2, 0.01);
}

TEST(Instruments, AStateAndALogHoldThem) {
  World world{WorldSettings()};
  ASSERT_TRUE(world.addSceneBody(test::shared(softBlock(Vec3(0.03, 0.01, 0.03), 0.005, 1e4, Vec3(0, 0, 0.016)))).ok());
  ASSERT_TRUE(world.addSceneInstrument(instrument(InstrumentType::kGrasper, Vec3(0, 0, 0.06))).ok());
  std::string log;
  world.record([&log](std::string bytes) { log += bytes; });
  attach(world, instrument(InstrumentType::kHook, Vec3(0.2, 0, 0.06), "aside"));
  lead(world, Vec3(0, 0, 0.06), 0.3, 1.2);
  lead(world, Vec3(0, 0, 0.02), 0.5, 1.2);
  lead(world, Vec3(0, 0, 0.02), 0.3, 0.0);
  const auto saved = world.capture();
  const auto decoded = decode(encode(*saved, ""));
  ASSERT_TRUE(decoded.ok()) << decoded.error().detail;
  World other{WorldSettings()};
  other.restore(*decoded->world);
  EXPECT_EQ(other.stateHash(), world.stateHash());
  for (World* w : {&world, &other}) {
    lead(*w, Vec3(0, 0, 0.1), 0.5, 0.0);
    ASSERT_TRUE(w->apply(DetachInstrumentCommand{"aside"}).ok());
    run(*w, 0.5);
  }
  EXPECT_EQ(other.stateHash(), world.stateHash());
  EXPECT_EQ(stateOf(world).holds, "block");
  world.recordHash();
  world.record({});
  std::istringstream stream(log);
  for (const int threads : {1, 2}) {
    stream.clear();
    stream.seekg(0);
    const Result<ReplayReport> replayed = replay(stream, threads);
    ASSERT_TRUE(replayed.ok()) << replayed.error().detail;
    EXPECT_EQ(replayed->hash, world.stateHash());
  }
  // A reset brings back those of the scene alone.
  world.reset();
  const WorldSnapshot shot = world.snapshot({});
  ASSERT_EQ(shot.instruments.size(), 1u);
  EXPECT_EQ(shot.instruments[0].pose.translation, Vec3(0, 0, 0.06));
}

TEST(Instruments, OneThatPressesOnTheGroundBesideTissueIsSavedToTheBit) {
  World world{WorldSettings()};
  ASSERT_TRUE(world.addSceneBody(test::shared(softBlock(Vec3(0.03, 0.03, 0.03), 0.01, 1e4, Vec3(0, 0, 0.03)))).ok());
  InstrumentDef probe = instrument(InstrumentType::kProbe, Vec3(0.018, 0, 0.1));
  attach(world, probe);
  lead(world, Vec3(0.014, 0.003, -0.1), 0.2, {}, Quat(Eigen::AngleAxisd(1.3, Vec3::UnitY())));
  run(world, 0.1);
  EXPECT_GT(stateOf(world).force.z(), 9.0);
  World other{WorldSettings()};
  other.restore(*world.capture());
  for (int step = 0; step < 60; ++step) {
    world.step();
    other.step();
    ASSERT_EQ(world.stateHash(), other.stateHash()) << step;
  }
}

TEST(Instruments, WhoeverIsInOneHandSleepsAndWakesTogether) {
  World world{WorldSettings()};
  for (const double x : {-0.012, 0.012}) {
    BodyDef def = softBlock(Vec3(0.02, 0.03, 0.03), 0.01, 1e4, Vec3(x, 0, 0.016));
    def.name = x < 0 ? "a" : "b";
    ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  }
  InstrumentDef bar = instrument(InstrumentType::kProbe, Vec3(0.06, 0, 0.06));
  bar.pose.rotation = Quat::Identity();  // it lies across both
  attach(world, bar);
  lead(world, Vec3(0.06, 0, 0.03), 0.5, {}, Quat::Identity());
  run(world, 3.0);
  WorldSnapshot shot = world.snapshot({});
  ASSERT_TRUE(shot.bodies[0].asleep && shot.bodies[1].asleep);
  const double both = shot.instruments[0].force.z();
  EXPECT_GT(both, 0.1);
  // Picking one moves the bar, and the other is not left asleep.
  PickCommand pick;
  pick.body = "a";
  pick.point = Vec3(-0.012, 0, 0.03);
  ASSERT_TRUE(world.apply(pick).ok());
  world.step();
  shot = world.snapshot({});
  EXPECT_FALSE(shot.bodies[0].asleep || shot.bodies[1].asleep);
  EXPECT_NEAR(shot.instruments[0].force.z(), both, 0.05 * both);
  // What is removed presses no more.
  run(world, 3.0);
  for (const char* name : {"a", "b"}) ASSERT_TRUE(world.apply(RemoveCommand{name}).ok());
  world.step();
  EXPECT_EQ(stateOf(world).force, Vec3(Vec3::Zero()));
}

TEST(Instruments, WhatCannotBeIsRefusedAndNothingHasChanged) {
  World world{WorldSettings()};
  ASSERT_TRUE(world.addSceneBody(test::shared(softBlock(Vec3(0.06, 0.06, 0.03), 0.01, 2e4, Vec3(0, 0, 0.016)))).ok());
  attach(world, instrument(InstrumentType::kProbe, Vec3(0, 0, 0.1)));
  const std::uint64_t before = world.stateHash();
  const auto refused = [&](const Command& command, const std::string& text) {
    const auto reply = world.apply(command);
    ASSERT_FALSE(reply.ok()) << text;
    EXPECT_NE(reply.error().detail.find(text), std::string::npos) << reply.error().detail;
    EXPECT_EQ(world.stateHash(), before);
  };
  refused(AttachInstrumentCommand{instrument(InstrumentType::kProbe, Vec3(0, 0, 0.2))},
          "there is an instrument 'left'");
  refused(AttachInstrumentCommand{instrument(InstrumentType::kProbe, Vec3(0, 0, 0.01), "b")}, "inside of body 'block'");
  refused(AttachInstrumentCommand{instrument(InstrumentType::kProbe, Vec3(0.2, 0, -0.01), "b")},
          "0.01 m below the ground");
  refused(AttachInstrumentCommand{instrument(InstrumentType::kProbe, Vec3(0.2, 0, 0.1), "a b")},
          "accepted: a letter, then");
  InstrumentDef thread = instrument(InstrumentType::kProbe, Vec3(0, 0, 0.2), "b");
  thread.shaft_radius = 1e-4;
  thread.shaft_length = 10.0;
  refused(AttachInstrumentCommand{thread}, "so long and thin");
  InstrumentDef weak = instrument(InstrumentType::kProbe, Vec3(0, 0, 0.2), "b");
  weak.max_force = std::nan("");
  refused(AttachInstrumentCommand{weak}, "max_force of instrument 'b' is nan; accepted: 0.01 to 10000 N");
  refused(DetachInstrumentCommand{"right"}, "there is no instrument 'right'; instruments are: left");
  refused(LeadInstrumentCommand{"right", {}, {}}, "there is no instrument 'right'");
  refused(LeadInstrumentCommand{"left", {}, 0.5}, "which has no jaws");
  refused(LeadInstrumentCommand{"left", Pose{Quat(0, 0, 0, 0), Vec3::Zero()}, {}},
          "pose is 0 m from the origin, with a quaternion of length 0");
}

}  // namespace instrument_test
}  // namespace meshless
