// Gravity that changes, bodies that are put elsewhere, and bodies of the scene as it began.
#include <cmath>
#include <set>
#include <tuple>

#include <gtest/gtest.h>

#include "meshless_surgery/base/random.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/world/world.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"

namespace meshless {
namespace place_test {

void run(World& world, double seconds) {
  for (int step = 0; step < seconds * world.settings().step_rate; ++step) world.step();
}

BodySnapshot bodyOf(World& world, const std::string& name) {
  for (BodySnapshot& body : world.snapshot({true, true, true}).bodies)
    if (body.name == name) return body;
  ADD_FAILURE() << "there is no " << name;
  return {};
}

std::set<std::string> names(World& world) {
  std::set<std::string> all;
  for (const BodySnapshot& body : world.snapshot({}).bodies) all.insert(body.name);
  return all;
}

double farthest(const Points& a, const Points& b) {
  if (a.size() != b.size()) return INFINITY;
  double most = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, (a[i] - b[i]).norm());
  return most;
}

void refused(World& world, const Command& command, ErrorCode code, const std::string& said) {
  const std::uint64_t hash = world.stateHash();
  const auto reply = world.apply(command);
  ASSERT_FALSE(reply.ok()) << said;
  EXPECT_EQ(reply.error().code, code) << reply.error().detail;
  EXPECT_NE(reply.error().detail.find(said), std::string::npos) << reply.error().detail;
  EXPECT_EQ(world.stateHash(), hash);
}

Pose poseOf(Random& random, double far) {
  return {Quat(Eigen::AngleAxisd(random.between(-3.1, 3.1), random.inCube(1.0).normalized())), random.inCube(far)};
}

CutCommand cutThrough(const Vec3& at, const std::vector<std::string>& bodies) {
  CutCommand cut;
  cut.blades.origin = at - Vec3(0, 1, 0);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3::UnitZ();
  cut.bodies = bodies;
  return cut;
}

// --- gravity

TEST(SetGravity, WhatFallsFallsSoAndWhatSleepsWakes) {
  World world{WorldSettings()};
  ASSERT_TRUE(world.addSceneBody(test::shared(test::block("lies", Vec3(0, 0, 0.051)))).ok());
  ASSERT_TRUE(world.addSceneBody(test::shared(test::ball("falls", Vec3(1, 0, 20)))).ok());
  run(world, 0.5);
  const double speed = bodyOf(world, "falls").measures.linear_momentum.z() / bodyOf(world, "falls").model->mass;
  EXPECT_NEAR(speed, -9.81 * 0.5, 0.02 * 9.81);
  test::replyOf<Done>(world.apply(SetGravityCommand{Vec3(0, 3.0, 0)}));
  run(world, 1.0);
  const BodySnapshot falls = bodyOf(world, "falls");
  EXPECT_NEAR(falls.measures.linear_momentum.z() / falls.model->mass, speed, 1e-3);
  EXPECT_NEAR(falls.measures.linear_momentum.y() / falls.model->mass, 3.0, 0.02);
  world.reset();
  EXPECT_EQ(world.settings().gravity, Vec3(0, 0, -9.81));
  run(world, 4.0);
  ASSERT_TRUE(bodyOf(world, "lies").asleep);
  test::replyOf<Done>(world.apply(SetGravityCommand{Vec3(0, 0, 2.0)}));
  run(world, 1.0);
  EXPECT_GT(bodyOf(world, "lies").measures.centre_of_mass.z(), 0.8);
}

// Elastic tissue sags by what it weighs: twice as much under twice the gravity, and comes back.
TEST(SetGravity, TissueSagsByIt) {
  WorldSettings settings;
  settings.ground.reset();
  World world{settings};
  BodyDef def = test::defOf(boxMesh(Vec3(0.1, 0.04, 0.04), 0.01), "beam");
  def.material.youngs_modulus = 2e5;
  def.material.poissons_ratio = 0.3;
  def.material.damping = 20.0;
  def.fixed = {HeldRegion(Vec3(-1, -1, -1), Vec3(-0.04, 1, 1))};
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  const auto sag = [&](double gravity) {
    test::replyOf<Done>(world.apply(SetGravityCommand{Vec3(0, 0, -gravity)}));
    run(world, 4.0);
    return -boundsOf(bodyOf(world, "beam").surface).min.z() - 0.02;
  };
  const double once = sag(4.0);
  EXPECT_GT(once, 1e-5);
  EXPECT_NEAR(sag(8.0), 2.0 * once, 0.02 * once);
  EXPECT_NEAR(sag(0.0), 0.0, 0.01 * once);
}

TEST(SetGravity, WhatIsNoneIsRefused) {
  World world{WorldSettings()};
  refused(world, SetGravityCommand{Vec3(0, 0, NAN)}, ErrorCode::kInvalidArgument, "gravity is not finite");
  refused(world, SetGravityCommand{Vec3(0, 2e4, 0)}, ErrorCode::kInvalidArgument, "0 to 1e4 m/s^2");
}

// --- a pose

// A box of 0.1 m of which 6 cm are below the ground, or all of it, is pressed up slowly: who puts it there is told.
TEST(BelowGround, IsSaidWithTheDepth) {
  for (const std::optional<double> ground : {std::optional<double>(0.0), std::optional<double>(-0.5), {}}) {
    WorldSettings settings;
    settings.ground = ground;
    World world{settings};
    const double floor = ground.value_or(0.0);
    const auto said = [&](const std::string& name, double z, bool held) {
      BodyDef def = test::defOf(boxMesh(Vec3(0.1, 0.1, 0.1), 0.02), name);
      def.spacing = 0.02;
      def.pose.translation = Vec3(0.3 * world.bodyCount(), 0, floor + z);
      if (held) def.fixed = {HeldRegion(Vec3(-10, -10, -10), Vec3(10, 10, floor + z))};
      EXPECT_TRUE(world.apply(SpawnCommand{test::shared(def)}).ok()) << name;
      return world.takeEvents().back().text;
    };
    for (const auto& [name, z, held, words] :
         std::vector<std::tuple<std::string, double, bool, std::vector<std::string>>>{
             {"under", -0.2, false, {"0.25 m below the ground", "comes up"}},
             {"deep", -0.01, false, {"0.06 m below the ground", "comes up"}},
             {"held", -0.01, true, {"0.06 m below the ground", "against what holds it"}},
             {"flush", 0.05, false, {}},
             {"a little", 0.035, false, {}}}) {
      const std::string text = said(name, z, held);
      EXPECT_EQ(text.find("below the ground") != std::string::npos, ground && !words.empty()) << text;
      for (const std::string& word : words)
        if (ground) EXPECT_NE(text.find(word), std::string::npos) << text;
      if (ground && !words.empty())
        EXPECT_NE(text.find(ground == 0.0 ? "at z = 0 m" : "at z = -0.5 m"), std::string::npos) << text;
    }
  }
}

// As if it had been spawned there: with its cuts, without its strain, its speed and the hands in it.
TEST(PlaceBody, IsAsIfItHadComeThere) {
  for (std::uint64_t seed = 41; seed <= 46; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    BodyDef def = test::defOf(*randomOrgan(seed, random.whole(0, 2), 0.1, 1200), "organ");
    def.pose = poseOf(random, 0.2);
    if (seed % 2) {
      def.material.youngs_modulus = random.logBetween(2e3, 1e5);
      def.material.poissons_ratio = 0.4;
    }
    const bool held = seed % 3 == 0;
    const Box box = boundsOf(def.mesh.vertices);
    if (held) {
      HeldRegion region(box.min - Vec3::Ones(), Vec3(0.5 * (box.min.x() + box.max.x()), 1, 1));
      region.in_world = false;
      def.fixed = {region};
    }
    World world{test::weightless()};
    ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
    PickCommand pick;
    pick.point = bodyOf(world, "organ").particles.front();
    const PickReply picked = test::replyOf<PickReply>(world.apply(pick));
    test::replyOf<Done>(world.apply(MovePickCommand{picked.pick, picked.position + random.inCube(0.05)}));
    run(world, 0.3);
    const Pose pose = poseOf(random, 3.0);
    test::replyOf<Done>(world.apply(PlaceBodyCommand{"organ", pose}));
    EXPECT_TRUE(world.snapshot({}).picks.empty());

    def.name = "other";
    def.pose = pose;
    World fresh{test::weightless()};
    ASSERT_TRUE(fresh.addSceneBody(test::shared(def)).ok());
    const BodySnapshot there = bodyOf(world, "organ"), wanted = bodyOf(fresh, "other");
    EXPECT_LT(farthest(there.surface, wanted.surface), 1e-9);
    EXPECT_EQ(there.measures.kinetic_energy, 0.0);
    EXPECT_NEAR(there.measures.volume, wanted.measures.volume, 1e-9 * wanted.measures.volume);
    run(world, 1.0);
    EXPECT_LT(farthest(bodyOf(world, "organ").surface, wanted.surface), 1e-5);  // nothing draws it
    const Points rest = world.inspect("organ", true)->surface;
    test::replyOf<Done>(world.apply(PlaceBodyCommand{"organ", poseOf(random, 1.0)}));
    run(world, 0.1);
    EXPECT_EQ(world.inspect("organ", true)->surface, rest);  // what is measured at rest is where it was
    if (!held) continue;
    // What holds it is counted from where it was put first.
    MoveClampCommand home;
    home.body = "organ";
    home.time = 0.5;
    test::replyOf<MoveClampReply>(world.apply(home));
    run(world, 6.0);
    EXPECT_LT(farthest(bodyOf(world, "organ").surface, rest), 2e-3);
  }
}

TEST(PlaceBody, ItsCutsGoAlong) {
  World world{test::weightless()};
  ASSERT_TRUE(world.addSceneBody(test::shared(test::block())).ok());
  test::replyOf<CutReply>(world.apply(cutThrough(Vec3(0.02, 0, 0.2), {})));
  const double volume = bodyOf(world, "block.1").measures.volume;
  test::replyOf<Done>(
      world.apply(PlaceBodyCommand{"block.1", {Quat(Eigen::AngleAxisd(1.0, Vec3::UnitX())), Vec3(0, 0, 9)}}));
  EXPECT_NEAR(bodyOf(world, "block.1").measures.volume, volume, 1e-12);
  const Box other = boundsOf(bodyOf(world, "block.2").surface);
  EXPECT_LT(other.max.z(), 0.3);
  EXPECT_GT(boundsOf(bodyOf(world, "block.1").surface).min.z(), 8.8);
  UndoCutCommand undo;
  ASSERT_TRUE(world.apply(undo).ok());
  EXPECT_EQ(names(world), std::set<std::string>{"block"});
  EXPECT_NEAR(bodyOf(world, "block").measures.centre_of_mass.z(), 0.2, 1e-3);
}

// Lumens are open at rest, and clips close them as slowly as at first.
TEST(PlaceBody, ClipsCloseAnew) {
  World world{test::weightless()};
  TriangleMesh hollow = boxMesh(Vec3(0.06, 0.02, 0.02), 0.004), inside = boxMesh(Vec3(0.04, 0.01, 0.01), 0.004);
  for (Triangle& t : inside.triangles) std::swap(t[1], t[2]);
  const auto first = static_cast<Index>(hollow.vertices.size());
  hollow.vertices.insert(hollow.vertices.end(), inside.vertices.begin(), inside.vertices.end());
  for (const Triangle& t : inside.triangles) hollow.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  BodyDef def = test::defOf(hollow, "duct");
  def.material.youngs_modulus = 2e4;
  def.material.poissons_ratio = 0.4;
  def.material.damping = 10.0;
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  ClipCommand clip;
  clip.point = Vec3(0, 0, 0.01);
  clip.opening = 0.04;
  const ClipReply made = test::replyOf<ClipReply>(world.apply(clip));
  run(world, 1.5);
  const double closed = *world.snapshot({}).attachments[0].jaws;
  EXPECT_LT(closed, 0.2 * made.lumen);
  test::replyOf<Done>(
      world.apply(PlaceBodyCommand{"duct", {Quat(Eigen::AngleAxisd(2.0, Vec3::UnitX())), Vec3(0, 0, 1)}}));
  EXPECT_NEAR(*world.snapshot({}).attachments[0].jaws, made.lumen, 0.05 * made.lumen);
  double most = 0.0;
  for (int step = 0; step < 240; ++step) {
    world.step();
    most = std::max(most, bodyOf(world, "duct").measures.kinetic_energy);
  }
  EXPECT_LT(most, 0.5 * bodyOf(world, "duct").model->mass * 0.02 * 0.02);  // no faster than jaws close
  EXPECT_NEAR(*world.snapshot({}).attachments[0].jaws, closed, 1e-9);
}

// Jaws that hold what is put elsewhere, or as the scene began, have let go of it, and nothing has slipped.
TEST(PlaceBody, JawsLetGoOfIt) {
  for (const bool reset : {false, true}) {
    World world{WorldSettings()};
    BodyDef def = test::defOf(boxMesh(Vec3(0.03, 0.01, 0.03), 0.005), "block");
    def.pose.translation.z() = 0.016;
    def.material.youngs_modulus = 1e4;
    def.material.poissons_ratio = 0.4;
    def.material.damping = 5.0;
    ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
    InstrumentDef grasper;
    grasper.name = "left";
    grasper.type = InstrumentType::kGrasper;
    grasper.pose = {Quat(Eigen::AngleAxisd(0.5 * M_PI, Vec3::UnitY())), Vec3(0, 0, 0.06)};
    ASSERT_TRUE(world.apply(AttachInstrumentCommand{grasper}).ok());
    const auto lead = [&](double z, double jaw, double seconds) {
      const Instrument before = world.snapshot({}).instruments[0];
      const int steps = static_cast<int>(seconds * world.settings().step_rate);
      for (int step = 1; step <= steps; ++step) {
        const double share = static_cast<double>(step) / steps, from = before.target.translation.z();
        LeadInstrumentCommand command;
        command.name = "left";
        command.pose = Pose{grasper.pose.rotation, Vec3(0, 0, from + share * (z - from))};
        command.jaw = before.jaw_target + share * (jaw - before.jaw_target);
        ASSERT_TRUE(world.apply(command).ok());
        world.step();
      }
    };
    run(world, 0.3);
    lead(0.06, 1.2, 0.3);
    lead(0.02, 1.2, 0.5);
    lead(0.02, 0.0, 0.5);
    run(world, 0.3);
    lead(0.12, 0.0, 1.0);
    ASSERT_EQ(world.snapshot({}).instruments[0].holds, "block");
    (void)world.takeEvents();
    if (reset)
      test::replyOf<ResetBodiesReply>(world.apply(ResetBodiesCommand{{"block"}}));
    else
      test::replyOf<Done>(world.apply(PlaceBodyCommand{"block", {Quat::Identity(), Vec3(0.5, 0, 0.016)}}));
    EXPECT_EQ(world.snapshot({}).instruments[0].holds, "");
    run(world, 1.0);
    std::size_t released = 0;
    for (const Event& event : world.takeEvents()) {
      EXPECT_NE(event.type, EventType::kDropped) << event.text;
      released += event.type == EventType::kReleased && event.instrument == "left";
    }
    EXPECT_EQ(released, 1u);
  }
}

TEST(PlaceBody, WhatCannotBeIsRefusedAndChangesNothing) {
  World world{test::weightless()};
  ASSERT_TRUE(world.addSceneBody(test::shared(test::block())).ok());
  BodyDef large = test::defOf(boxMesh(Vec3(1, 1, 1), 4, 4, 4), "large");
  large.pose.translation = Vec3(5, 0, 0);
  ASSERT_TRUE(world.addSceneBody(test::shared(large)).ok());
  const Pose away{Quat::Identity(), Vec3(0, 0, 3)};
  refused(world, PlaceBodyCommand{"none", away}, ErrorCode::kUnknownName, "bodies are: block, large");
  refused(world, PlaceBodyCommand{"block", {Quat::Identity(), Vec3(5, 0, 0)}}, ErrorCode::kInvalidArgument,
          "lies wholly inside");
  refused(world, PlaceBodyCommand{"block", {Quat(2, 0, 0, 0), Vec3::Zero()}}, ErrorCode::kInvalidArgument,
          "accepted: 1");
  refused(world, PlaceBodyCommand{"block", {Quat::Identity(), Vec3(0, 2e6, 0)}}, ErrorCode::kInvalidArgument, "1e6 m");
  refused(world, PlaceBodyCommand{"block", {Quat::Identity(), Vec3(0, NAN, 0)}}, ErrorCode::kInvalidArgument, "finite");
  AttachCommand attach;
  attach.name = "joint";
  attach.body = "block";
  attach.other = kWorldEnd;
  attach.stiffness = 1e5;
  ASSERT_TRUE(world.apply(attach).ok());
  refused(world, PlaceBodyCommand{"block", away}, ErrorCode::kInvalidArgument, "attachment 'joint'");
  ASSERT_TRUE(world.apply(DetachCommand{"joint", {}}).ok());
  EXPECT_TRUE(world.apply(PlaceBodyCommand{"block", away}).ok());
}

// --- as the scene began

TEST(ResetBodies, OneIsAsTheSceneBeganAndTheOthersAreAsTheyWere) {
  World world{test::weightless()};
  for (int k = 0; k < 3; ++k)
    ASSERT_TRUE(world.addSceneBody(test::shared(test::block("b" + std::to_string(k), Vec3(0, 0.5 * k, 0.2)))).ok());
  AttachCommand attach;
  attach.name = "joint";
  attach.body = "b1";
  attach.other = kWorldEnd;
  attach.stiffness = 1e5;
  attach.region = Region::sphere(Vec3(-0.1, 0.5, 0.2), 0.05);
  const auto joined = world.addSceneAttachment(attach);
  ASSERT_TRUE(joined.ok());
  const Points began = bodyOf(world, "b1").surface;
  test::replyOf<SpawnReply>(world.apply(SpawnCommand{test::shared(test::ball("b1.7", Vec3(0, 3, 0)))}));

  test::replyOf<CutReply>(world.apply(cutThrough(Vec3(0.02, 0.5, 0.2), {"b0", "b1"})));
  test::replyOf<CutReply>(world.apply(cutThrough(Vec3(0.05, 0.5, 0.2), {"b1.1", "b1.2"})));
  ASSERT_EQ(names(world), (std::set<std::string>{"b0.1", "b0.2", "b1.1", "b1.2.1", "b1.2.2", "b1.7", "b2"}));
  PickCommand pick;
  pick.point = Vec3(0.1, 0.5, 0.2);
  pick.body = "b1.2.1";
  pick.max_distance = 1.0;
  const PickReply picked = test::replyOf<PickReply>(world.apply(pick));
  test::replyOf<Done>(world.apply(MovePickCommand{picked.pick, Vec3(1, 1, 1)}));
  run(world, 0.5);

  const Points b0 = bodyOf(world, "b0.1").particles, b2 = bodyOf(world, "b2").particles;
  (void)world.takeEvents();
  const auto reply = test::replyOf<ResetBodiesReply>(world.apply(ResetBodiesCommand{{"b1"}}));
  EXPECT_EQ(reply.bodies, std::vector<std::string>{"b1"});
  EXPECT_EQ(names(world), (std::set<std::string>{"b0.1", "b0.2", "b1", "b1.7", "b2"}));
  EXPECT_EQ(bodyOf(world, "b1").surface, began);
  EXPECT_EQ(bodyOf(world, "b1").measures.kinetic_energy, 0.0);
  EXPECT_EQ(bodyOf(world, "b0.1").particles, b0);
  EXPECT_EQ(bodyOf(world, "b2").particles, b2);
  const WorldSnapshot shot = world.snapshot({});
  EXPECT_TRUE(shot.picks.empty());
  ASSERT_EQ(shot.attachments.size(), 1u);
  EXPECT_EQ(shot.attachments[0].name, "joint");
  EXPECT_EQ(shot.attachments[0].fibres, joined->fibres);
  refused(world, UndoCutCommand{}, ErrorCode::kMissed, "no cut to undo");

  // And again: cut, taken away, and there as before.
  test::replyOf<CutReply>(world.apply(cutThrough(Vec3(0.02, 0.5, 0.2), {"b1"})));
  const std::set<std::string> cut = names(world);
  EXPECT_EQ(cut.count("b1.1") + cut.count("b1.2"), 0u) << "names that were retired come again";
  for (const std::string& name : cut)
    if (name != "b1.7" && name.rfind("b1.", 0) == 0) test::replyOf<Done>(world.apply(RemoveCommand{name}));
  EXPECT_EQ(names(world).count("b1"), 0u);
  test::replyOf<ResetBodiesReply>(world.apply(ResetBodiesCommand{}));
  EXPECT_EQ(names(world), (std::set<std::string>{"b0", "b1", "b1.7", "b2"}));
  EXPECT_EQ(bodyOf(world, "b1").surface, began);
  EXPECT_EQ(world.snapshot({}).attachments.size(), 1u);
}

TEST(ResetBodies, WhatIsJoinedToACutBodyComesBackWithIt) {
  World world{test::weightless()};
  ASSERT_TRUE(world.addSceneBody(test::shared(test::block("below", Vec3(0, 0, 0.2)))).ok());
  ASSERT_TRUE(world.addSceneBody(test::shared(test::block("above", Vec3(0, 0, 0.302)))).ok());
  AttachCommand attach;
  attach.name = "joint";
  attach.body = "above";
  attach.other = "below";
  attach.distance = 0.005;
  attach.stiffness = 1e6;
  ASSERT_TRUE(world.addSceneAttachment(attach).ok());
  const std::size_t fibres = world.snapshot({}).attachments[0].fibres;
  test::replyOf<CutReply>(world.apply(cutThrough(Vec3(0.02, 0, 0.2), {"below"})));
  refused(world, ResetBodiesCommand{{"above"}}, ErrorCode::kInvalidArgument, "'below' was cut or removed");
  const auto reply = test::replyOf<ResetBodiesReply>(world.apply(ResetBodiesCommand{{"above", "below"}}));
  EXPECT_TRUE(reply.notes.empty());
  EXPECT_EQ(names(world), (std::set<std::string>{"above", "below"}));
  ASSERT_EQ(world.snapshot({}).attachments.size(), 1u);
  EXPECT_EQ(world.snapshot({}).attachments[0].fibres, fibres);
  // One that has gone away cannot be joined again, which is said.
  ASSERT_TRUE(world.apply(DetachCommand{"joint", {}}).ok());
  test::replyOf<Done>(world.apply(PlaceBodyCommand{"below", {Quat::Identity(), Vec3(3, 0, 0)}}));
  EXPECT_EQ(test::replyOf<ResetBodiesReply>(world.apply(ResetBodiesCommand{{"above"}})).notes.size(), 1u);
}

// Where time has not moved yet it is the scene itself, in its order: both go on alike.
TEST(ResetBodies, AllOfThemAreTheScene) {
  const auto scene = [] {
    World world{WorldSettings()};
    for (int k = 0; k < 3; ++k)
      EXPECT_TRUE(world.addSceneBody(test::shared(test::block("b" + std::to_string(k), Vec3(0, 0.5 * k, 0.2)))).ok());
    return world;
  };
  World world = scene(), other = scene();
  test::replyOf<CutReply>(world.apply(cutThrough(Vec3(0.02, 0.5, 0.2), {"b0", "b1"})));
  test::replyOf<Done>(world.apply(RemoveCommand{"b2"}));
  test::replyOf<ResetBodiesReply>(world.apply(ResetBodiesCommand{}));
  for (World* one : {&world, &other}) run(*one, 1.0);
  const WorldSnapshot a = world.snapshot({true, true, false}), b = other.snapshot({true, true, false});
  ASSERT_EQ(a.bodies.size(), b.bodies.size());
  for (std::size_t k = 0; k < a.bodies.size(); ++k) {
    EXPECT_EQ(a.bodies[k].name, b.bodies[k].name);
    EXPECT_EQ(a.bodies[k].particles, b.bodies[k].particles);
  }
}

TEST(ResetBodies, WhatCannotBeIsRefusedAndChangesNothing) {
  World world{test::weightless()};
  ASSERT_TRUE(world.addSceneBody(test::shared(test::block())).ok());
  test::replyOf<SpawnReply>(world.apply(SpawnCommand{test::shared(test::ball("guest", Vec3(0, 3, 0)))}));
  refused(world, ResetBodiesCommand{{"block", "guest"}}, ErrorCode::kUnknownName, "the scene has no body 'guest'");
  // What has come to lie around it would hold it inside.
  test::replyOf<Done>(world.apply(PlaceBodyCommand{"block", {Quat::Identity(), Vec3(0, 0, 5)}}));
  test::replyOf<SpawnReply>(
      world.apply(SpawnCommand{test::shared(test::defOf(boxMesh(Vec3(2, 2, 2), 4, 4, 4), "large"))}));
  refused(world, ResetBodiesCommand{}, ErrorCode::kInvalidArgument, "lies wholly inside");
}

// --- an attachment under the name of one that is gone

TEST(Attach, UnderTheNameOfOneThatIsGone) {
  World world{test::weightless()};
  ASSERT_TRUE(world.addSceneBody(test::shared(test::block())).ok());
  AttachCommand attach;
  attach.name = "joint";
  attach.body = "block";
  attach.other = kWorldEnd;
  attach.stiffness = 1e5;
  test::replyOf<AttachReply>(world.apply(attach));
  refused(world, attach, ErrorCode::kDuplicateName, "'joint' is there already");
  ASSERT_TRUE(world.apply(DetachCommand{"joint", {}}).ok());
  attach.strength = 1e-3;
  test::replyOf<AttachReply>(world.apply(attach));
  PickCommand pick;
  pick.point = Vec3(0, 0, 0.2);
  pick.max_distance = 1.0;
  const PickReply picked = test::replyOf<PickReply>(world.apply(pick));
  test::replyOf<Done>(world.apply(MovePickCommand{picked.pick, Vec3(1, 1, 1)}));
  run(world, 1.0);
  ASSERT_EQ(world.snapshot({}).attachments.size(), 1u);
  EXPECT_EQ(world.snapshot({}).attachments[0].fibres, 0u);  // torn off
  test::replyOf<AttachReply>(world.apply(attach));
  EXPECT_EQ(world.snapshot({}).attachments.size(), 1u);
  EXPECT_GT(world.snapshot({}).attachments[0].fibres, 0u);
}

}  // namespace place_test
}  // namespace meshless
