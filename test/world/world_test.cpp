#include "meshless_surgery/world/world.h"

#include <limits>

#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/nearest_on_triangle.h"
#include "support/bodies.h"
#include "support/mesh_laws.h"
#include "support/random.h"

namespace meshless {
namespace world_test {

using test::replyOf;

const double kNan = std::numeric_limits<double>::quiet_NaN();

World ballWorld(WorldSettings settings = {}) {
  World world(settings);
  EXPECT_TRUE(world.addSceneBody(test::shared(test::ball())).ok());
  return world;
}

CutCommand cutAt(const Vec3& origin, const Vec3& normal) {
  CutCommand cut;
  const Vec3 x = normal.unitOrthogonal();
  cut.blades.x_axis = x;
  cut.blades.y_axis = normal.cross(x);
  cut.blades.origin = origin;
  return cut;
}
// Unbounded blades reach from their pivot along +x: put it behind the body.
CutCommand cutThrough(const Vec3& point, const Vec3& normal) {
  CutCommand cut = cutAt(point, normal);
  cut.blades.origin -= 10.0 * cut.blades.x_axis;
  return cut;
}

PickCommand pickNear(const Vec3& p) {
  PickCommand pick;
  pick.point = p;
  return pick;
}

BodySnapshot only(World& world) {
  WorldSnapshot shot = world.snapshot({true, true, true});
  EXPECT_EQ(shot.bodies.size(), 1u);
  return shot.bodies.at(0);
}

void run(World& world, int steps) {
  for (int i = 0; i < steps; ++i) world.step();
}

TEST(WorldSettings, RefuseBadValues) {
  EXPECT_TRUE(WorldSettings().validate().ok());
  WorldSettings s;
  s.step_rate = 0;
  EXPECT_FALSE(s.validate().ok());
  s = {};
  s.gravity.x() = kNan;
  EXPECT_FALSE(s.validate().ok());
  s = {};
  s.substeps = 0;
  EXPECT_FALSE(s.validate().ok());
  s = {};
  s.ground = kNan;
  EXPECT_FALSE(s.validate().ok());
}

TEST(World, RefusedCommandsSayWhyAndChangeNothing) {
  World world = ballWorld();
  run(world, 5);
  const PickReply held = replyOf<PickReply>(world.apply(pickNear(Vec3(0, 0, 0.3))));
  const std::uint64_t before = world.stateHash();
  std::vector<std::pair<Command, std::string>> bad;
  PickCommand pick = pickNear(Vec3(kNan, 0, 0));
  bad.emplace_back(pick, "point");
  pick = pickNear(Vec3(9, 0, 0));
  bad.emplace_back(pick, "no tissue within");
  pick = pickNear(Vec3(0, 0, 0.3));
  pick.body = "lung";
  bad.emplace_back(pick, "lung");
  pick = pickNear(Vec3(0, 0, 0.3));
  pick.stiffness = -1;
  bad.emplace_back(pick, "stiffness");
  pick = pickNear(Vec3(0, 0, 0.3));
  pick.max_distance = kNan;
  bad.emplace_back(pick, "max_distance");
  bad.emplace_back(MovePickCommand{77, Vec3::Zero()}, "77");
  bad.emplace_back(MovePickCommand{held.pick, Vec3(0, kNan, 0)}, "target");
  bad.emplace_back(LockCommand{77, std::nullopt}, "77");
  bad.emplace_back(LockCommand{held.pick, Vec3(kNan, 0, 0)}, "target");
  bad.emplace_back(ReleaseCommand{77}, "77");
  PushCommand push;
  push.radius = -1;
  bad.emplace_back(push, "radius");
  push = {};
  push.position.x() = kNan;
  bad.emplace_back(push, "position");
  push = {};
  push.speed = kNan;
  bad.emplace_back(push, "speed");
  bad.emplace_back(cutThrough(Vec3(0, 0, 5), Vec3::UnitZ()), "met no body");
  CutCommand cut = cutThrough(Vec3(0, 0, 0.2), Vec3::UnitZ());
  cut.bodies = {"spleen"};
  bad.emplace_back(cut, "spleen");
  cut = cutThrough(Vec3(0, 0, 0.2), Vec3::UnitZ());
  cut.blades.length = -1;
  bad.emplace_back(cut, "length");
  for (const double close_time : {kNan, -1.0, 3601.0}) {
    cut = cutThrough(Vec3(0, 0, 0.2), Vec3::UnitZ());
    cut.close_time = close_time;
    bad.emplace_back(cut, "close_time");
  }
  cut = cutThrough(Vec3(0, 0, 0.2), Vec3::UnitZ());
  cut.roughness = -0.01;
  bad.emplace_back(cut, "roughness");
  bad.emplace_back(RemoveCommand{"spleen"}, "spleen");
  bad.emplace_back(SetMaterialCommand{"spleen", [](const Material& m) -> Result<Material> { return m; }}, "spleen");
  bad.emplace_back(SetMaterialCommand{"",
                                      [](const Material& m) -> Result<Material> {
                                        Material worse = m;
                                        worse.alpha = 3;
                                        return worse;
                                      }},
                   "alpha");
  bad.emplace_back(SpawnCommand{test::shared(test::ball())}, "ball");
  for (auto& [command, word] : bad) {
    const Result<Reply> reply = world.apply(command);
    ASSERT_FALSE(reply.ok()) << word;
    EXPECT_NE(reply.error().detail.find(word), std::string::npos) << reply.error().detail;
    EXPECT_EQ(world.stateHash(), before) << word;
  }
}

TEST(World, ABallFallsComesToRestOnTheGroundAndStaysAboveIt) {
  World world = ballWorld();
  double highest_energy = 0.0;
  for (int step = 0; step < 720; ++step) {
    world.step();
    for (const Vec3& p : only(world).surface) ASSERT_GE(p.z(), -4e-4);  // 2.2e-4
    highest_energy = std::max(highest_energy, only(world).measures.kinetic_energy);
  }
  const BodySnapshot ball = only(world);
  EXPECT_LT(ball.measures.kinetic_energy, 1e-4);  // [J] reached: 2e-5
  EXPECT_LT(ball.measures.centre_of_mass.z(), 0.11);
  EXPECT_GT(ball.measures.centre_of_mass.z(), 0.04);
  EXPECT_LE(highest_energy, ball.model->mass * 9.81 * 0.2);
  EXPECT_NEAR(world.simTime(), 6.0, 1e-12);
}

TEST(World, NeedsNothingThatASceneDoesNotUse) {
  World world = ballWorld();
  run(world, 200);
  const StepReport report = world.snapshot({}).report;
  EXPECT_EQ(report.tetrahedralizations, 0u);
  EXPECT_EQ(report.push_contacts, 0u);
  EXPECT_EQ(report.match_counters.quadratic_moments, 0u);
  EXPECT_EQ(report.match_counters.plastic_flows, 0u);
  EXPECT_EQ(report.preserve_counters.gradients, 0u);
  EXPECT_GT(report.ground_contacts, 0u);
  EXPECT_GT(report.match_counters.clusters, 0u);
}

TEST(World, WithoutBetaNoMapIsFitted) {
  BodyDef def = test::ball();
  def.material.mode = MatchMode::kQuadratic;
  def.material.beta = 0.0;
  World world{WorldSettings()};
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  run(world, 20);
  const MatchCounters counters = world.snapshot({}).report.match_counters;
  EXPECT_GT(counters.rotations, counters.linear_fits) << "of cells alone";
  EXPECT_EQ(counters.quadratic_moments, 0u);
}

TEST(World, APlasticBodyKeepsADentUntilReset) {
  BodyDef def = test::ball();
  def.material.plasticity = {0.02, 5.0, 0.8};
  def.material.alpha = 0.5;
  World world(test::weightless());
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  const auto farthest = [&] {
    double off = 0.0;
    const BodySnapshot body = only(world);
    for (std::size_t i = 0; i < body.particles.size(); ++i)
      for (std::size_t k = 0; k < i; ++k)
        off = std::max(off, std::abs((body.particles[i] - body.particles[k]).norm() -
                                     (body.model->rest[i] - body.model->rest[k]).norm()));
    return off;
  };
  const PickReply up = replyOf<PickReply>(world.apply(pickNear(Vec3(0, 0, 0.3))));
  const PickReply down = replyOf<PickReply>(world.apply(pickNear(Vec3(0, 0, 0.1))));
  replyOf<Done>(world.apply(MovePickCommand{up.pick, Vec3(0, 0, 0.45)}));
  replyOf<Done>(world.apply(MovePickCommand{down.pick, Vec3(0, 0, -0.05)}));
  run(world, 240);
  EXPECT_GT(farthest(), 0.02);
  replyOf<Done>(world.apply(ClearPicksCommand{}));
  run(world, 1200);
  EXPECT_GT(farthest(), 0.01) << "the dent stays";
  world.reset();
  run(world, 600);
  EXPECT_LT(farthest(), 1e-3);
}

TEST(World, EqualHistoriesHaveEqualHashes) {
  std::uint64_t hashes[2];
  for (std::uint64_t& hash : hashes) {
    World world = ballWorld();
    ASSERT_TRUE(world.addSceneBody(test::shared(test::block("block", Vec3(0.05, 0, 0.45)))).ok());
    run(world, 60);
    replyOf<PickReply>(world.apply(pickNear(Vec3(0, 0, 0.2))));
    run(world, 20);
    replyOf<CutReply>(world.apply(cutThrough(Vec3(0, 0, 0.08), Vec3(1, 0.2, 0.3).normalized())));
    run(world, 60);
    hash = world.stateHash();
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

// After each command, also before a step has looked who is near whom: numbers of bodies and picks go on over resets.
TEST(World, TheSameHistoryAfterAResetHasTheSameHash) {
  World world{WorldSettings()};
  for (const Vec3& at : {Vec3(0, 0, 0.052), Vec3(0.02, 0.01, 0.16)}) {
    BodyDef def = test::defOf(boxMesh(Vec3(0.2, 0.1, 0.1), 0.03), at.x() > 0.0 ? "high" : "low");
    def.pose.translation = at;
    def.spacing = 0.025;
    def.material.youngs_modulus = 2e4;
    ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  }
  std::vector<std::pair<std::string, std::uint64_t>> hashes[2];
  for (auto& of_round : hashes) {
    world.reset();
    const auto after = [&](const std::string& what, const Command& command) {
      const Result<Reply> reply = world.apply(command);
      EXPECT_TRUE(reply.ok()) << what << ": " << reply.error().detail;
      of_round.emplace_back(what, world.stateHash());
      run(world, 2);
      of_round.emplace_back("steps after the " + what, world.stateHash());
    };
    run(world, 60);
    after("pick", pickNear(Vec3(0.1, 0, 0.2)));
    PushCommand push;
    push.position = Vec3(0.05, 0, 0.23);
    after("push", push);
    InciseCommand incise;
    incise.blade.origin = Vec3(0.07, -0.2, 0.4);
    incise.blade.y_axis = Vec3::UnitZ();
    incise.blade.x_axis = Vec3::UnitY();
    incise.blade.length = 0.21;
    incise.blade.depth = 0.3;
    incise.bodies = {"high"};
    after("incision", incise);
    after("cut", cutThrough(Vec3(0.03, 0, 0.1), Vec3(1, 0.2, 0.3).normalized()));
    after("undo", UndoCutCommand{});
    after("second cut", cutThrough(Vec3(0.03, 0, 0.1), Vec3(1, 0.2, 0.3).normalized()));
    after("removal", RemoveCommand{"low.3"});  // names of pieces that were undone are not used again
    after("spawn", SpawnCommand{test::shared(test::ball("guest", Vec3(0.5, 0, 0.2)))});
    after("release", ClearPicksCommand{});
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

TEST(World, LookingChangesNothing) {
  std::uint64_t hashes[2];
  for (int looking = 0; looking < 2; ++looking) {
    World world = ballWorld();
    replyOf<CutReply>(world.apply(cutThrough(Vec3(0, 0, 0.2), Vec3(1, 0.2, 0.3).normalized())));
    for (int step = 0; step < 120; ++step) {
      world.step();
      if (looking) {
        world.snapshot({true, true, true});
        ASSERT_TRUE(world.inspect("ball.1", step % 2).ok());
      }
    }
    hashes[looking] = world.stateHash();
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

TEST(World, TheImpulseOfLocksAccountsForTheChangeOfMomentum) {
  for (bool elastic : {false, true}) {
    BodyDef def = test::ball();
    if (elastic) {
      def.spacing = 0.03;
      def.material.youngs_modulus = 5000.0;
    }
    WorldSettings settings = test::weightless();
    settings.step_rate = 120;
    World world(settings);
    ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
    const PickReply pick = replyOf<PickReply>(world.apply(pickNear(Vec3(0, 0, 0.3))));
    replyOf<Done>(world.apply(MovePickCommand{pick.pick, Vec3(0.1, 0.2, 0.5)}));
    replyOf<Done>(world.apply(LockCommand{pick.pick, std::nullopt}));
    Vec3 before = only(world).measures.linear_momentum, impulse = Vec3::Zero();
    double largest = 0.0;
    for (int step = 0; step < 240; ++step) {
      world.step();
      impulse += world.snapshot({}).picks.at(0).force / 120.0;
      const Vec3 now = only(world).measures.linear_momentum;
      largest = std::max(largest, now.norm());
      ASSERT_LT((now - before - impulse).norm(), 1e-11 * (1.0 + largest)) << "step " << step;
    }
    EXPECT_GT(largest, 0.1) << "it swings";
  }
}

TEST(World, APickLiftsALockHoldsAndMovingTakesItUpAgain) {
  World world = ballWorld();
  const PickReply pick = replyOf<PickReply>(world.apply(pickNear(Vec3(0, 0, 0.3))));
  EXPECT_NE(pick.pick, 0u);
  EXPECT_EQ(pick.body, "ball");
  ASSERT_TRUE(world.heldPick());
  EXPECT_EQ(world.heldPick()->id, pick.pick);
  replyOf<Done>(world.apply(MovePickCommand{pick.pick, Vec3(0, 0, 0.8)}));
  replyOf<Done>(world.apply(LockCommand{pick.pick, std::nullopt}));
  EXPECT_FALSE(world.heldPick());
  run(world, 600);
  EXPECT_GT(only(world).measures.centre_of_mass.z(), 0.4);
  EXPECT_TRUE(world.snapshot({}).picks.at(0).locked);
  // The spring carries the weight: on average, since the ball still swings.
  double mean = 0.0;
  for (int step = 0; step < 600; ++step) {
    world.step();
    mean += world.snapshot({}).picks.at(0).force.z() / 600;
  }
  EXPECT_NEAR(mean, only(world).model->mass * 9.81, 0.02 * only(world).model->mass * 9.81);
  replyOf<Done>(world.apply(MovePickCommand{pick.pick, Vec3(0.3, 0, 0.8)}));
  ASSERT_TRUE(world.heldPick());
  EXPECT_EQ(world.heldPick()->id, pick.pick);
  run(world, 600);
  EXPECT_GT(only(world).measures.centre_of_mass.x(), 0.1);
  replyOf<Done>(world.apply(ClearPicksCommand{}));
  run(world, 600);
  EXPECT_LT(only(world).measures.centre_of_mass.z(), 0.12);
  const PickReply again = replyOf<PickReply>(world.apply(pickNear(only(world).particles[0])));
  EXPECT_GT(again.pick, pick.pick);
}

TEST(World, ARayGrabsTheSurfaceInFrontOfIt) {
  World world = ballWorld();
  PickCommand ray;
  ray.point = Vec3(0.01, 0.02, 2);
  ray.direction = Vec3(0, 0, -1);
  const PickReply pick = replyOf<PickReply>(world.apply(ray));
  EXPECT_NEAR(pick.position.z(), 0.3, 0.01);
  ray.point.x() = 0.5;
  EXPECT_FALSE(world.apply(ray).ok());
  ray.max_distance = 1.0;
  EXPECT_TRUE(world.apply(ray).ok());
}

TEST(World, ThePushSphereTravelsAtItsSpeedAndNoTissueStaysInside) {
  World world = ballWorld();
  run(world, 360);
  PushCommand push;
  push.radius = 0.04;
  push.position = Vec3(-0.3, 0, 0.05);
  replyOf<Done>(world.apply(push));
  EXPECT_EQ(world.push().position, push.position);
  push.position = Vec3(0.1, 0, 0.05);
  push.speed = 0.2;
  replyOf<Done>(world.apply(push));
  run(world, 60);
  EXPECT_NEAR(world.push().position.x(), -0.2, 1e-9);
  bool touched = false;
  int touching_steps = 0;
  const double start = only(world).measures.centre_of_mass.x();
  for (int step = 0; step < 240; ++step) {
    world.step();
    const BodySnapshot shot = only(world);
    const Vec3 centre = world.push().position;
    for (const Vec3& p : shot.surface) ASSERT_GE((p - centre).norm(), 0.04 - 2e-4);
    for (const Triangle& t : shot.model->surface.triangles)
      ASSERT_GE((nearestOnTriangle(centre, shot.surface[t[0]], shot.surface[t[1]], shot.surface[t[2]]) - centre).norm(),
                0.036);
    for (const Event& e : world.takeEvents()) touched = touched || e.type == EventType::kTouched;
    if (world.push().touching && ++touching_steps == 1) {
      EXPECT_LT(world.push().force.x(), 0.0) << "tissue pushes back";
    }
  }
  EXPECT_TRUE(touched);
  EXPECT_NEAR(world.push().position.x(), 0.1, 1e-9);
  EXPECT_GT(only(world).measures.centre_of_mass.x(), start + 0.02);
  push.enable = false;
  replyOf<Done>(world.apply(push));
  EXPECT_FALSE(world.push().enabled);
}

TEST(World, ACutSeversKeepsMomentumNamesThePiecesAndRetiresTheParent) {
  World world = ballWorld();
  run(world, 100);
  const BodySnapshot before = only(world);
  const CutReply reply = replyOf<CutReply>(world.apply(cutThrough(before.measures.centre_of_mass, Vec3::UnitX())));
  ASSERT_EQ(reply.cut_bodies, std::vector<std::string>{"ball"});
  ASSERT_EQ(reply.new_bodies, (std::vector<std::string>{"ball.1", "ball.2"}));
  EXPECT_GT(reply.cap_area, 0.5 * M_PI * 0.01 * 0.5);
  const WorldSnapshot shot = world.snapshot({true, true, true});
  ASSERT_EQ(shot.bodies.size(), 2u);
  double volume = 0;
  Vec3 momentum = Vec3::Zero();
  for (const BodySnapshot& b : shot.bodies) {
    volume += b.measures.volume;
    momentum += b.measures.linear_momentum;
    TriangleMesh mesh = b.model->surface;
    mesh.vertices = b.surface;
    EXPECT_TRUE(laws::isClosedOriented(mesh));
    EXPECT_EQ(b.material.name, before.material.name);
    EXPECT_TRUE(std::count(b.model->surface.patches.begin(), b.model->surface.patches.end(), 1u) > 0);
  }
  EXPECT_NEAR(volume, before.measures.volume, 1e-2 * volume);
  EXPECT_LT((momentum - before.measures.linear_momentum).norm(), 1e-9);
  // The name is gone for this run.
  EXPECT_FALSE(world.apply(SpawnCommand{test::shared(test::ball())}).ok());
  EXPECT_FALSE(world.inspect("ball", false).ok());
  EXPECT_TRUE(world.inspect("ball.1", false).ok());
  run(world, 300);
  for (const BodySnapshot& b : world.snapshot({true, true, true}).bodies) {
    EXPECT_TRUE(test::allFinite(b.surface));
    EXPECT_LT(std::abs(b.measures.volume / b.model->rest_volume - 1.0), 0.15);  // worst of 20 normals: 0.032
  }
}

TEST(World, OnlyBodiesThatTheBladesMeetAreSevered) {
  World world(test::weightless());
  for (int k = 0; k < 3; ++k)
    ASSERT_TRUE(world.addSceneBody(test::shared(test::ball("b" + std::to_string(k), Vec3(0.4 * k, 0, 0)))).ok());
  CutCommand cut = cutAt(Vec3(-0.2, 0, 0), Vec3::UnitZ());
  cut.blades.x_axis = Vec3::UnitX();
  cut.blades.y_axis = Vec3::UnitY();
  cut.blades.length = 0.7;  // reaches b0 and b1
  cut.blades.width = 0.05;
  EXPECT_EQ(replyOf<CutReply>(world.apply(cut)).cut_bodies, (std::vector<std::string>{"b0", "b1"}));
  cut.blades.length = 0;
  cut.bodies = {"b2"};
  EXPECT_EQ(replyOf<CutReply>(world.apply(cut)).cut_bodies, (std::vector<std::string>{"b2"}));
  EXPECT_EQ(world.snapshot({}).bodies.size(), 6u);
}

TEST(World, SpringsFollowTheirPiece) {
  World world(test::weightless());
  ASSERT_TRUE(world.addSceneBody(test::shared(test::ball("ball", Vec3::Zero()))).ok());
  const PickReply up = replyOf<PickReply>(world.apply(pickNear(Vec3(0, 0, 0.1))));
  const PickReply down = replyOf<PickReply>(world.apply(pickNear(Vec3(0, 0, -0.1))));
  replyOf<Done>(world.apply(LockCommand{up.pick, Vec3(0, 0, 0.3)}));
  replyOf<Done>(world.apply(LockCommand{down.pick, Vec3(0, 0, -0.3)}));
  replyOf<CutReply>(world.apply(cutThrough(Vec3::Zero(), Vec3::UnitZ())));
  run(world, 600);
  const WorldSnapshot shot = world.snapshot({false, false, true});
  ASSERT_EQ(shot.picks.size(), 2u);
  for (const Pick& pick : shot.picks) {
    const std::string body = shot.pick_bodies.at(pick.id);
    for (const BodySnapshot& b : shot.bodies)
      if (b.name == body) {
        EXPECT_EQ(b.measures.centre_of_mass.z() > 0, pick.id == up.pick);
        EXPECT_GT(std::abs(b.measures.centre_of_mass.z()), 0.15);
      }
  }
}

TEST(World, BladesCloseOverSimulatedTime) {
  World world = ballWorld();
  CutCommand cut = cutThrough(Vec3(0, 0, 0.2), Vec3::UnitX());
  cut.close_time = 0.25;
  const CutStarted started = replyOf<CutStarted>(world.apply(cut));
  EXPECT_TRUE(world.scissors().shown);
  run(world, 30);
  EXPECT_FALSE(world.finishedCut(started.ticket).has_value());
  EXPECT_EQ(world.snapshot({}).bodies.size(), 1u);
  run(world, 1);
  const std::optional<Result<CutReply>> reply = world.finishedCut(started.ticket);
  ASSERT_TRUE(reply.has_value());
  ASSERT_TRUE(reply->ok());
  EXPECT_EQ((*reply)->new_bodies.size(), 2u);
  EXPECT_FALSE(world.scissors().shown);
  EXPECT_FALSE(world.finishedCut(started.ticket).has_value()) << "the answer is taken out by asking";
}

TEST(World, OpeningTheScissorsCallsTheCutOff) {
  World world = ballWorld();
  EXPECT_EQ(world.apply(OpenScissorsCommand{}).error().code, ErrorCode::kMissed);
  CutCommand cut = cutThrough(Vec3(0, 0, 0.2), Vec3::UnitX());
  cut.close_time = 0.5;
  const CutStarted first = replyOf<CutStarted>(world.apply(cut));
  const CutStarted second = replyOf<CutStarted>(world.apply(cut));  // while the first closes
  run(world, 20);
  replyOf<Done>(world.apply(OpenScissorsCommand{}));
  run(world, 120);
  for (const CutStarted& started : {first, second}) {
    const std::optional<Result<CutReply>> reply = world.finishedCut(started.ticket);
    ASSERT_TRUE(reply.has_value());
    ASSERT_FALSE(reply->ok());
    EXPECT_NE(reply->error().detail.find("opened before"), std::string::npos);
  }
  EXPECT_EQ(world.snapshot({}).bodies.size(), 1u);
  EXPECT_FALSE(world.scissors().shown);
}

TEST(World, OpeningTheBladesOfOneCutLeavesTheOther) {
  World world = ballWorld();
  CutCommand cut = cutThrough(Vec3(0, 0, 0.2), Vec3::UnitX());
  cut.close_time = 0.5;
  const CutStarted first = replyOf<CutStarted>(world.apply(cut));
  cut.blades.origin.x() += 0.01;
  const CutStarted second = replyOf<CutStarted>(world.apply(cut));
  run(world, 20);
  EXPECT_EQ(world.apply(OpenBladesCommand{second.ticket + 1}).error().code, ErrorCode::kMissed);
  replyOf<Done>(world.apply(OpenBladesCommand{second.ticket}));
  const std::optional<Result<CutReply>> opened = world.finishedCut(second.ticket);
  ASSERT_TRUE(opened.has_value());
  EXPECT_EQ(opened->error().code, ErrorCode::kMissed);
  EXPECT_TRUE(world.scissors().shown);
  EXPECT_NEAR(0.0, world.scissors().blades.origin.x(), 1e-12) << "the blades of the cut that goes on";
  run(world, 60);
  const std::optional<Result<CutReply>> reply = world.finishedCut(first.ticket);
  ASSERT_TRUE(reply.has_value());
  ASSERT_TRUE(reply->ok());
  EXPECT_EQ((*reply)->new_bodies.size(), 2u);
  EXPECT_FALSE(world.scissors().shown);
  EXPECT_EQ(world.apply(OpenBladesCommand{first.ticket}).error().code, ErrorCode::kMissed);
}

TEST(World, AnIncisionOpensABodyAndASecondOneTakesItApart) {
  World world(test::weightless());
  ASSERT_TRUE(world.addSceneBody(test::shared(test::ball("ball", Vec3::Zero()))).ok());
  const PickReply pick = replyOf<PickReply>(world.apply(pickNear(Vec3(0, 0.1, 0))));
  InciseCommand incise;
  incise.blade = {Vec3(-0.2, 0.004, 0.2), Vec3::UnitX(), Vec3::UnitZ(), 0.4, 0.2};
  const double volume = only(world).model->rest_volume;
  const InciseReply opened = replyOf<InciseReply>(world.apply(incise));
  EXPECT_EQ(opened.cut_bodies, std::vector<std::string>{"ball"});
  EXPECT_TRUE(opened.new_bodies.empty());
  EXPECT_GT(opened.opened_area, 0.01);
  EXPECT_EQ(only(world).name, "ball");
  EXPECT_NEAR(only(world).model->rest_volume, volume, 1e-9 * volume);
  bool said = false;
  for (const Event& event : world.takeEvents()) said = said || event.type == EventType::kIncised;
  EXPECT_TRUE(said);
  EXPECT_EQ(world.apply(incise).error().code, ErrorCode::kMissed) << "it is open there";
  run(world, 60);
  EXPECT_TRUE(test::allFinite(only(world).surface));
  incise.blade = {Vec3(-0.2, 0.004, -0.2), Vec3::UnitX(), -Vec3::UnitZ(), 0.4, 0.22};
  const InciseReply apart = replyOf<InciseReply>(world.apply(incise));
  EXPECT_EQ(apart.new_bodies, (std::vector<std::string>{"ball.1", "ball.2"}));
  const WorldSnapshot shot = world.snapshot({true, false, true});
  ASSERT_EQ(shot.bodies.size(), 2u);
  EXPECT_NEAR(shot.bodies[0].model->rest_volume + shot.bodies[1].model->rest_volume, volume, 1e-9 * volume);
  ASSERT_EQ(shot.picks.size(), 1u);
  EXPECT_EQ(shot.picks[0].id, pick.pick) << "the spring follows its piece";
  run(world, 60);

  InciseCommand bad = incise;
  bad.blade.depth = 0.0;
  EXPECT_NE(world.apply(bad).error().detail.find("depth is 0"), std::string::npos);
  bad = incise;
  bad.bodies = {"spleen"};
  EXPECT_EQ(world.apply(bad).error().code, ErrorCode::kUnknownName);
  bad = incise;
  bad.blade.origin.x() = kNan;
  EXPECT_EQ(world.apply(bad).error().code, ErrorCode::kInvalidArgument);
  bad.blade.origin = Vec3(5, 5, 5);
  EXPECT_EQ(world.apply(bad).error().code, ErrorCode::kMissed);
}

TEST(World, ThePushSphereFeelsWhatTheTissueGets) {
  WorldSettings settings = test::weightless();
  settings.sleep = false;
  for (const double speed : {0.1, 0.5}) {
    World world(settings);
    ASSERT_TRUE(world.addSceneBody(test::shared(test::ball("ball", Vec3::Zero()))).ok());
    PushCommand push;
    push.enable = true;
    push.radius = 0.03;
    push.position = Vec3(-0.2, 0.0, 0.0);
    ASSERT_TRUE(world.apply(push).ok());
    push.position = Vec3(-0.04, 0.0, 0.0);
    push.speed = speed;
    ASSERT_TRUE(world.apply(push).ok());
    Vec3 reported = Vec3::Zero();
    for (int step = 0; step < 240; ++step) {
      world.step();
      reported += world.push().force / 120.0;
    }
    const Vec3 momentum = world.snapshot({true, true, true}).bodies[0].measures.linear_momentum;
    ASSERT_GT(momentum.x(), 0.0);
    EXPECT_LE((reported + momentum).norm(), 0.02 * momentum.norm())
        << "reported " << reported.transpose() << ", given " << momentum.transpose();
  }
}

TEST(World, PiecesCanBeCutAHundredTimes) {
  test::Random random(11);
  WorldSettings settings;
  settings.contact = ContactMethod::kNone;  // cuts alone
  World world(settings);
  ASSERT_TRUE(world.addSceneBody(test::shared(test::ball())).ok());
  run(world, 60);
  const double mass = only(world).model->mass;
  const std::size_t particles = only(world).model->rest.size();
  int cuts = 0;
  for (int attempt = 0; attempt < 140 && cuts < 100; ++attempt) {
    WorldSnapshot shot = world.snapshot({true, false, true});
    std::size_t largest = 0;
    for (std::size_t b = 1; b < shot.bodies.size(); ++b)
      if (shot.bodies[b].model->rest_volume > shot.bodies[largest].model->rest_volume) largest = b;
    const BodySnapshot& body = shot.bodies[largest];
    CutCommand cut = cutThrough(solidCentroid(body.surface, body.model->surface.triangles), random.unit());
    cut.bodies = {body.name};
    const Result<Reply> reply = world.apply(cut);
    if (reply.ok()) {
      ++cuts;
    } else {
      // The centroid of a crumpled piece can lie outside of it.
      EXPECT_TRUE(reply.error().code == ErrorCode::kUnsuitableShape || reply.error().code == ErrorCode::kMissed)
          << reply.error().detail;
    }
    world.step();
  }
  EXPECT_EQ(cuts, 100);
  double sum = 0;
  std::size_t count = 0;
  for (const BodySnapshot& b : world.snapshot({true, true, true}).bodies) {
    EXPECT_TRUE(test::allFinite(b.particles));
    EXPECT_TRUE(test::allFinite(b.surface));
    sum += b.model->mass;
    count += b.model->rest.size();
  }
  EXPECT_NEAR(sum, mass, 1e-9 * mass);
  EXPECT_LT(count, particles + 100 * 100);
}

TEST(World, BodiesThatFallOnEachOtherComeToRestOutsideOfEachOther) {
  WorldSettings settings;
  settings.substeps = 2;
  World world(settings);
  for (int k = 0; k < 3; ++k)
    ASSERT_TRUE(
        world.addSceneBody(test::shared(test::block("b" + std::to_string(k), Vec3(0.01 * k, 0, 0.08 + 0.13 * k))))
            .ok());
  std::size_t contacts = 0;
  for (int step = 0; step < 480; ++step) {
    world.step();
    contacts += world.snapshot({}).report.contact_counters.corrected;
  }
  EXPECT_GT(contacts, 100u);
  const WorldSnapshot shot = world.snapshot({true, true, true});
  EXPECT_EQ(shot.report.tetrahedralizations, 0u);
  for (const BodySnapshot& a : shot.bodies) {
    EXPECT_TRUE(test::allFinite(a.particles));
    EXPECT_GT(a.measures.volume, 0.8 * a.model->rest_volume);
    TriangleMesh mesh = a.model->surface;
    mesh.vertices = a.surface;
    const SolidQuery solid(mesh);
    for (const BodySnapshot& b : shot.bodies) {
      if (&a == &b) continue;
      for (const Vec3& p : b.particles)
        if (solid.contains(p)) EXPECT_LT(solid.distance(p), 0.01) << b.name << " in " << a.name;
    }
  }
}

TEST(World, ResetBringsBackTheScene) {
  World world = ballWorld();
  const std::uint64_t start = world.stateHash();
  ASSERT_TRUE(world.apply(SpawnCommand{test::shared(test::block("guest", Vec3(0.5, 0, 0.3)))}).ok());
  run(world, 50);
  const PickReply pick = replyOf<PickReply>(world.apply(pickNear(Vec3(0, 0, 0.2))));
  replyOf<CutReply>(world.apply(cutThrough(Vec3(0, 0, 0.1), Vec3::UnitX())));
  world.reset();
  EXPECT_EQ(world.stateHash(), start);
  EXPECT_EQ(world.simTime(), 0.0);
  EXPECT_EQ(world.snapshot({}).bodies.at(0).name, "ball");
  EXPECT_GT(replyOf<PickReply>(world.apply(pickNear(Vec3(0, 0, 0.3)))).pick, pick.pick) << "ids are never used twice";
}

TEST(World, SetMaterialChangesOneOrAll) {
  World world(test::weightless());
  ASSERT_TRUE(world.addSceneBody(test::shared(test::ball("a", Vec3(0, 0, 0)))).ok());
  ASSERT_TRUE(world.addSceneBody(test::shared(test::ball("b", Vec3(1, 0, 0)))).ok());
  const auto setAlpha = [](double alpha) {
    return [alpha](const Material& m) -> Result<Material> {
      Material changed = m;
      changed.alpha = alpha;
      changed.mode = MatchMode::kQuadratic;
      return changed;
    };
  };
  replyOf<Done>(world.apply(SetMaterialCommand{"a", setAlpha(0.25)}));
  WorldSnapshot shot = world.snapshot({});
  EXPECT_EQ(shot.bodies[0].material.alpha, 0.25);
  EXPECT_NE(shot.bodies[1].material.alpha, 0.25);
  replyOf<Done>(world.apply(SetMaterialCommand{"", setAlpha(0.5)}));
  shot = world.snapshot({});
  EXPECT_EQ(shot.bodies[0].material.alpha, 0.5);
  EXPECT_EQ(shot.bodies[1].material.alpha, 0.5);
  run(world, 2);
  EXPECT_GT(world.snapshot({}).report.match_counters.quadratic_moments, 0u);
}

// In mid swing, with nothing to touch.
TEST(World, AMaterialSetToWhatItWasChangesNothing) {
  for (const double youngs_modulus : {0.0, 2e3}) {
    BodyDef def = test::block();
    def.material.youngs_modulus = youngs_modulus;
    std::vector<Points> ends;
    for (const bool set : {false, true}) {
      World world(test::weightless());
      ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
      const PickReply pick = replyOf<PickReply>(world.apply(pickNear(Vec3(0.1, 0, 0.2))));
      replyOf<Done>(world.apply(MovePickCommand{pick.pick, Vec3(0.15, 0, 0.23)}));
      run(world, 5);
      replyOf<Done>(world.apply(ReleaseCommand{pick.pick}));
      const Points before = only(world).particles;
      if (set)
        replyOf<Done>(world.apply(SetMaterialCommand{"", [](const Material& m) { return Result<Material>(m); }}));
      run(world, 5);
      ends.push_back(only(world).particles);
      double moved = 0.0;
      for (std::size_t i = 0; i < before.size(); ++i) moved = std::max(moved, (ends.back()[i] - before[i]).norm());
      EXPECT_GT(moved, 1e-3);
    }
    for (std::size_t i = 0; i < ends[0].size(); ++i)
      ASSERT_LT((ends[1][i] - ends[0][i]).norm(), 1e-9) << youngs_modulus;
  }
}

TEST(World, RemovingABodyLetsItsSpringsGo) {
  World world = ballWorld();
  replyOf<PickReply>(world.apply(pickNear(Vec3(0, 0, 0.3))));
  replyOf<Done>(world.apply(RemoveCommand{"ball"}));
  EXPECT_TRUE(world.snapshot({}).picks.empty());
  EXPECT_TRUE(world.snapshot({}).bodies.empty());
  run(world, 3);
}

TEST(World, InspectGivesRestAndPresentShape) {
  World world = ballWorld();
  run(world, 200);
  const BodySnapshot now = *world.inspect("ball", false), rest = *world.inspect("ball", true);
  EXPECT_NEAR(rest.measures.volume, rest.model->rest_volume, 1e-15);
  EXPECT_NE(now.surface[0], rest.surface[0]);
  EXPECT_GT(now.tetrahedra, 0u);
  BodyDef shell = test::ball("shell", Vec3(1, 0, 0.2));
  shell.mesh.triangles.resize(shell.mesh.triangles.size() - 40);
  shell.solid = false;
  ASSERT_TRUE(world.addSceneBody(test::shared(shell)).ok());
  EXPECT_EQ(world.inspect("shell", false)->tetrahedra, 0u);
}

TEST(World, TheRestShapeIsWhereTheBodyWasPut) {
  for (const auto& [elastic, copied] : {std::pair(false, false), {false, true}, {true, false}, {true, true}}) {
    BodyDef def = test::defOf(boxMesh(Vec3(0.1, 0.06, 0.04), 4, 3, 2), "bar");
    if (elastic) def.material.youngs_modulus = 5e3;
    PreparedBody body = test::prepared(def);
    def.pose = {Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized())), Vec3(0.3, -0.2, 0.5)};
    Points put;
    for (const Vec3& v : def.mesh.vertices) put.push_back(def.pose * v);
    World world{WorldSettings()};
    body = copied ? placedCopy(body, "bar", def.pose) : test::prepared(def);
    ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(std::move(body))).ok());
    for (int cut = 0; cut < 2; ++cut) {
      run(world, 30);
      for (const BodySnapshot& body : world.snapshot({}).bodies) {
        const BodySnapshot rest = *world.inspect(body.name, true);
        std::size_t found = 0;
        for (const Vec3& p : rest.surface)
          found += std::any_of(put.begin(), put.end(), [&](const Vec3& q) { return (p - q).norm() < 1e-12; });
        EXPECT_GE(found, cut ? put.size() / 4 : put.size())
            << body.name << ", elastic " << elastic << ", copy " << copied;
        Box of_particles, of_surface;
        for (const Vec3& p : rest.particles) of_particles.extend(p);
        for (const Vec3& p : rest.surface) of_surface.extend(p);
        EXPECT_LT((of_particles.min - of_surface.min).norm() + (of_particles.max - of_surface.max).norm(), 0.05);
      }
      if (cut > 0) continue;
      const Vec3 middle = only(world).measures.centre_of_mass;
      replyOf<CutReply>(world.apply(cutThrough(middle, def.pose.rotation * Vec3::UnitX())));
    }
  }
}

}  // namespace world_test
}  // namespace meshless
