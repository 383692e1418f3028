// Forces that are applied to patches of tissue, in the world at its defaults.
#include <cmath>
#include <sstream>

#include <gtest/gtest.h>

#include "meshless_surgery/base/random.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/world/command_log.h"
#include "meshless_surgery/world/saved_world.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"

namespace meshless {
namespace force_test {

void run(World& world, double seconds) {
  for (int step = 0; step < seconds * world.settings().step_rate; ++step) world.step();
}

World worldOf(const BodyDef& def) {
  World world{test::weightless()};
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  return world;
}

ApplyForceCommand force(const std::string& body, const Vec3& of, double time, std::optional<Region> region = {}) {
  return {body, std::move(region), of, time};
}

Vec3 momentum(World& world) {
  Vec3 sum = Vec3::Zero();
  for (const BodySnapshot& body : world.snapshot({false, false, true}).bodies) sum += body.measures.linear_momentum;
  return sum;
}

const Vec3 kSize(0.2, 0.04, 0.04);  // [m]
constexpr double kYoungs = 2e4;

// Held at its lower x.
BodyDef bar(double spacing = 0.0) {
  BodyDef def = test::defOf(boxMesh(kSize, 0.01), "bar");
  def.material.youngs_modulus = kYoungs;
  def.material.poissons_ratio = 0.3;
  def.material.density = 1000.0;
  def.material.damping = 10.0;
  def.spacing = spacing;
  HeldRegion held(Vec3(-1, -1, -1), Vec3(-0.08, 1, 1));
  held.in_world = false;
  def.fixed = {held};
  return def;
}
Region endOfBar() { return Region(Vec3(0.099, -1, -1), Vec3(1, 1, 1)); }

TEST(ApplyForce, ABarIsDrawnOutAsYoungSays) {
  for (const double spacing : {0.0, 0.01, 0.005}) {
    World world = worldOf(bar(spacing));
    const double pull = 0.01 * kYoungs * kSize.y() * kSize.z();  // [N] for a hundredth
    const auto reply = test::replyOf<ApplyForceReply>(world.apply(force("bar", Vec3(pull, 0, 0), 60.0, endOfBar())));
    EXPECT_NEAR(reply.area, kSize.y() * kSize.z(), 1e-9);
    EXPECT_LT((reply.middle - Vec3(0.1, 0, 0)).norm(), 1e-9);
    run(world, 5.0);
    const Wrench clamp = world.load("bar", {})->clamps[0];
    EXPECT_NEAR(clamp.force.x(), -pull, 1e-3 * pull) << spacing;
    double end = 0.0, area = 0.0;
    const WorldSnapshot shot = world.snapshot({true, false, false});
    for (const Triangle& t : shot.bodies[0].model->surface.triangles) {
      const Points& p = shot.bodies[0].surface;
      const Vec3 normal = 0.5 * (p[t[1]] - p[t[0]]).cross(p[t[2]] - p[t[0]]);
      if (normal.x() < 0.9 * normal.norm()) continue;
      end += normal.norm() * (p[t[0]] + p[t[1]] + p[t[2]]).x() / 3.0;
      area += normal.norm();
    }
    EXPECT_NEAR(end / area - 0.1, 0.01 * 0.18, 0.05 * 0.01 * 0.18) << spacing;
    EXPECT_FALSE(shot.bodies[0].asleep);  // it acts
  }
}

// Momentum is force times time, of whatever shape and material, wherever it acts; torque is r x F.
TEST(ApplyForce, MomentumAndTurnAreThoseOfTheForce) {
  for (std::uint64_t seed = 71; seed <= 78; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    BodyDef def = test::defOf(*randomOrgan(seed, random.whole(0, 2), 0.1, 1200), "organ");
    if (seed % 2) {
      def.material.youngs_modulus = random.logBetween(2e3, 1e5);
      def.material.poissons_ratio = random.between(0.2, 0.48);
    }
    World world = worldOf(def);
    const WorldSnapshot before = world.snapshot({true, false, true});
    const Vec3 at = before.bodies[0].surface[static_cast<std::size_t>(random.whole(0, 500))];
    const Vec3 of = random.inCube(1.0).normalized() * 0.2 * before.bodies[0].model->mass;  // [N] 0.2 m/s^2
    const auto reply = test::replyOf<ApplyForceReply>(
        world.apply(force("organ", of, 0.1, Region::sphere(at, random.between(0.01, 0.05)))));
    run(world, 0.1);
    EXPECT_LT((momentum(world) - 0.1 * of).norm(), 1e-6 * of.norm());
    const BodyMeasures now = world.snapshot({false, false, true}).bodies[0].measures;
    const Vec3 turn = 0.1 * (reply.middle - before.bodies[0].measures.centre_of_mass).cross(of);
    EXPECT_LT((now.angular_momentum - turn).norm(), 0.03 * turn.norm() + 1e-3 * of.norm() * 0.1 * 0.1);
    run(world, 0.5);  // it has ended
    EXPECT_LT((momentum(world) - 0.1 * of).norm(), 1e-6 * of.norm());
  }
}

TEST(ApplyForce, ItGoesOnInThePiecesOfItsTissue) {
  World world = worldOf(test::block());
  const Vec3 of(0.0, 0.0, 0.3);
  test::replyOf<ApplyForceReply>(world.apply(force("block", of, 0.5)));
  run(world, 0.25);
  CutCommand cut;
  cut.blades.origin = Vec3(0.013, -1, 0.2);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3::UnitZ();
  EXPECT_EQ(test::replyOf<CutReply>(world.apply(cut)).new_bodies.size(), 2u);
  run(world, 0.5);
  EXPECT_LT((momentum(world) - 0.5 * of).norm(), 1e-3 * of.norm());
  // Their shares are those of the surface that they had.
  const WorldSnapshot shot = world.snapshot({false, false, true});
  for (const BodySnapshot& body : shot.bodies) EXPECT_GT(body.measures.linear_momentum.z(), 0.3 * 0.5 * of.z());
}

TEST(ApplyForce, ItEndsWhenItIsSaidAndTheTissueSleeps) {
  World world = worldOf(bar());
  test::replyOf<ApplyForceReply>(world.apply(force("bar", Vec3(0, 0, 0.05), 100.0, endOfBar())));
  test::replyOf<ApplyForceReply>(world.apply(force("bar", Vec3(0, 0.05, 0), 1.0, endOfBar())));
  run(world, 6.0);
  const auto mean = [&] {
    const WorldSnapshot shot = world.snapshot({true, false, false});
    Vec3 sum = Vec3::Zero();
    for (const Vec3& p : shot.bodies[0].surface) sum += p / static_cast<double>(shot.bodies[0].surface.size());
    return sum;
  };
  EXPECT_GT(mean().z(), 2e-3);
  EXPECT_LT(std::abs(mean().y()), 1e-4);  // that one has ended
  test::replyOf<ApplyForceReply>(world.apply(force("bar", Vec3::Zero(), 0.0)));
  EXPECT_FALSE(world.apply(force("bar", Vec3::Zero(), 0.0)).ok());
  run(world, 8.0);
  EXPECT_TRUE(world.snapshot({}).bodies[0].asleep);
  EXPECT_LT(mean().z(), 1e-4);
  test::replyOf<ApplyForceReply>(world.apply(force("bar", Vec3(0, 0, 0.05), 0.5, endOfBar())));
  world.step();
  EXPECT_FALSE(world.snapshot({}).bodies[0].asleep);
  std::size_t said = 0;
  for (const Event& event : world.takeEvents()) said += event.type == EventType::kForce;
  EXPECT_EQ(said, 5u);  // three begin, one ends by itself, the others are ended
}

TEST(ApplyForce, ItIsSavedAndReplayedToTheBit) {
  World world = worldOf(bar());
  std::string log;
  world.record([&log](std::string bytes) { log += bytes; });
  test::replyOf<ApplyForceReply>(world.apply(force("bar", Vec3(0.1, 0, 0.05), 0.7, endOfBar())));
  test::replyOf<Done>(world.apply(SetGravityCommand{Vec3(0, 0, -1)}));
  run(world, 0.3);
  const auto decoded = decode(encode(*world.capture()));
  ASSERT_TRUE(decoded.ok()) << decoded.error().detail;
  World other{WorldSettings()};
  other.restore(*decoded->world);
  EXPECT_EQ(other.stateHash(), world.stateHash());
  for (World* one : {&world, &other}) run(*one, 1.0);
  EXPECT_EQ(other.stateHash(), world.stateHash());
  other.reset();
  EXPECT_EQ(other.settings().gravity, Vec3(Vec3::Zero()));  // of the scene that was saved
  world.record(nullptr);
  std::istringstream recorded(log);
  const Result<ReplayReport> replayed = replay(recorded, 2);
  ASSERT_TRUE(replayed.ok()) << replayed.error().detail;
  EXPECT_EQ(replayed->hash, world.stateHash());
}

TEST(ApplyForce, WhatCannotBeIsRefusedAndChangesNothing) {
  World world = worldOf(bar());
  const auto refused = [&](const ApplyForceCommand& command, ErrorCode code, const std::string& said) {
    const std::uint64_t hash = world.stateHash();
    const auto reply = world.apply(command);
    ASSERT_FALSE(reply.ok()) << said;
    EXPECT_EQ(reply.error().code, code) << reply.error().detail;
    EXPECT_NE(reply.error().detail.find(said), std::string::npos) << reply.error().detail;
    EXPECT_EQ(world.stateHash(), hash);
  };
  const Vec3 up(0, 0, 1);
  refused(force("none", up, 1.0), ErrorCode::kUnknownName, "there is no body 'none'");
  refused(force("bar", Vec3(NAN, 0, 0), 1.0), ErrorCode::kInvalidArgument, "force is not finite");
  refused(force("bar", 2e4 * up, 1.0), ErrorCode::kInvalidArgument, "up to 10000 N");
  refused(force("bar", up, 0.0), ErrorCode::kInvalidArgument, "above 0 to 3600 s");
  refused(force("bar", up, NAN), ErrorCode::kInvalidArgument, "above 0 to 3600 s");
  refused(force("bar", up, 1.0, Region::sphere(Vec3(0, 0, 0.03), 0.005)), ErrorCode::kMissed, "m beside it");
  refused(force("bar", Vec3::Zero(), 1.0), ErrorCode::kMissed, "no force acts on 'bar'");
  for (std::size_t k = 0; k < kMostForces; ++k) ASSERT_TRUE(world.apply(force("bar", 1e-3 * up, 1.0)).ok());
  refused(force("bar", up, 1.0), ErrorCode::kFailed, "up to 100 at once");
}

// What is slowed is deformed, held and moved as what is not.
TEST(ApplyForce, ABodyThatIsSlowedAnswersAsItsMaterialDoes) {
  const double pull = 0.01 * kYoungs * kSize.y() * kSize.z();
  for (const int most : {64, 2}) {
    WorldSettings settings = test::weightless();
    settings.max_substeps = most;
    World world{settings};
    ASSERT_TRUE(world.addSceneBody(test::shared(bar(0.005))).ok());
    test::replyOf<ApplyForceReply>(world.apply(force("bar", Vec3(pull, 0, 0), 60.0, endOfBar())));
    run(world, 12.0);
    const WorldSnapshot shot = world.snapshot({true, false, false});
    EXPECT_EQ(shot.bodies[0].stiffness_factor < 1.0, most == 2);
    EXPECT_NEAR(boundsOf(shot.bodies[0].surface).max.x() - 0.1, 0.0018, 0.0002) << most;
    EXPECT_NEAR(world.load("bar", {})->clamps[0].force.x(), -pull, 0.01 * pull) << most;
  }
  BodyDef free = bar(0.005);
  free.fixed.clear();
  WorldSettings settings = test::weightless();
  settings.max_substeps = 2;
  World world{settings};
  ASSERT_TRUE(world.addSceneBody(test::shared(free)).ok());
  test::replyOf<ApplyForceReply>(world.apply(force("bar", Vec3(0, 0, 0.1), 0.1, endOfBar())));
  run(world, 0.1);
  EXPECT_LT((momentum(world) - Vec3(0, 0, 0.01)).norm(), 1e-7);
  const BodyMeasures now = world.snapshot({false, false, true}).bodies[0].measures;
  EXPECT_NEAR(now.angular_momentum.y(), -0.1 * 0.01, 0.05 * 0.1 * 0.01);
}

// Its weight as a force on all of its tissue deforms a body that is held about as gravity does.
TEST(ApplyForce, WhatIsHeldSagsByItsWeightAsUnderGravity) {
  for (const bool one_cluster : {false, true}) {
    BodyDef def = bar();
    def.material.youngs_modulus = 0.0;
    def.material.alpha = 0.9;
    if (one_cluster) def.clusters.kind = ClusterOptions::Kind::kOne;
    double sag[2] = {};
    for (const bool gravity : {true, false}) {
      World world = worldOf(def);
      const double weight = kSize.prod() * 1000.0 * 9.81;
      if (gravity)
        test::replyOf<Done>(world.apply(SetGravityCommand{Vec3(0, 0, -9.81)}));
      else
        test::replyOf<ApplyForceReply>(world.apply(force("bar", Vec3(0, 0, -weight), 60.0)));
      run(world, 5.0);
      const WorldSnapshot shot = world.snapshot({true, false, false});
      sag[gravity] = -0.02 - boundsOf(shot.bodies[0].surface).min.z();
    }
    EXPECT_GT(sag[1], 1e-7);
    EXPECT_GT(sag[0], 0.5 * sag[1]) << one_cluster;
    EXPECT_LT(sag[0], 2.0 * sag[1]) << one_cluster;
  }
}

// Of every kind of body and of contact, in company of its like, on two threads: for as long as it is said.
TEST(ApplyForce, OfWhateverBodyMomentumIsForceTimesTime) {
  BodyDef sheet;
  for (Index i = 0; i < 5; ++i)
    for (Index j = 0; j < 5; ++j) {
      sheet.mesh.vertices.emplace_back(0.02 * i, 0.02 * j, 0.0);
      const Index a = 5 * i + j, b = a + 5;
      if (i < 4 && j < 4) sheet.mesh.triangles.insert(sheet.mesh.triangles.end(), {{a, b, b + 1}, {a, b + 1, a + 1}});
    }
  sheet.solid = false;
  BodyDef elastic = test::ball(), rigid = test::defOf(sphereMesh(0.02, 0.02)), linear = test::block();
  elastic.material.youngs_modulus = 2e4;
  elastic.material.poissons_ratio = 0.4;
  rigid.material.mode = MatchMode::kRigid;
  rigid.clusters.kind = ClusterOptions::Kind::kOne;
  linear.material.mode = MatchMode::kLinear;
  linear.material.alpha = 0.3;
  for (const BodyDef* kind : {&sheet, &elastic, &rigid, &linear})
    for (const ContactMethod contact : {ContactMethod::kSurface, ContactMethod::kTextbook, ContactMethod::kNone})
      for (const int bodies : {1, 36}) {
        SCOPED_TRACE(testing::Message() << (kind - &sheet) << " " << static_cast<int>(contact) << " " << bodies);
        if (bodies > 1 && kind != &rigid) continue;
        WorldSettings settings = test::weightless();
        settings.contact = contact;
        settings.threads = 2;
        World world{settings};
        Vec3 sum = Vec3::Zero();
        for (int k = 0; k < bodies; ++k) {
          BodyDef def = *kind;
          def.name = "b" + std::to_string(k);
          def.pose.translation = Vec3(0.5 * k, 0, 0);
          ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
          const Vec3 of(0.01 * (k % 3), 0.02, 0.01);
          // Less than a step, no whole number of steps, and some.
          const double time = k % 3 == 0 ? 0.05 : k % 3 == 1 ? 0.001 : 0.0371;
          test::replyOf<ApplyForceReply>(world.apply(force(def.name, of, time)));
          sum += time * of;
        }
        run(world, 0.2);
        // Side by side they are matched in float.
        EXPECT_LT((momentum(world) - sum).norm(), (bodies > 1 ? 1e-3 : 1e-5) * sum.norm());
      }
}

// Where faces are larger than the patch it is as large as it was said to be.
TEST(ApplyForce, ASmallPatchOnLargeFacesIsOne) {
  World world = worldOf(test::defOf(boxMesh(Vec3(0.2, 0.2, 0.2), 2, 2, 2), "cube"));
  for (const double radius : {0.002, 0.01, 0.03})
    for (const Vec3& at : {Vec3(0.1, 0.03, 0.02), Vec3(0.1, 0.0, 0.0), Vec3(0.1, -0.07, 0.05)}) {
      const auto reply = test::replyOf<ApplyForceReply>(
          world.apply(force("cube", Vec3(0, 0, 1e-3), 0.1, Region::sphere(at, radius))));
      EXPECT_NEAR(reply.area, M_PI * radius * radius, 0.1 * M_PI * radius * radius) << radius;
      EXPECT_LT((reply.middle - at).norm(), 0.1 * radius);
    }
}

// However large: everything stays finite, and comes back.
TEST(ApplyForce, RandomTissueSurvivesAnyOfIt) {
  for (std::uint64_t seed = 91; seed <= 98; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    BodyDef def = test::defOf(*randomOrgan(seed, random.whole(0, 2), 0.1, 1000), "organ");
    const Box box = boundsOf(def.mesh.vertices);
    HeldRegion held(box.min - Vec3::Ones(), Vec3(box.min.x() + 0.3 * (box.max.x() - box.min.x()), 1, 1));
    held.in_world = false;
    def.fixed = {held};
    if (seed % 4) {
      def.material.youngs_modulus = random.logBetween(2e3, 1e5);
      def.material.poissons_ratio = random.between(0.2, 0.48);
      def.material.damping = 10.0;
    }
    World world = worldOf(def);
    const double rest = world.snapshot({false, false, true}).bodies[0].measures.volume;
    for (int k = 0; k < 10; ++k) {
      const WorldSnapshot shot = world.snapshot({true, false, false});
      const Points& surface = shot.bodies[0].surface;
      const Vec3& at = surface[static_cast<std::size_t>(random.whole(0, static_cast<int>(surface.size()) - 1))];
      const Vec3 of = random.inCube(1.0).normalized() * random.logBetween(1e-2, 1e4);
      test::replyOf<ApplyForceReply>(
          world.apply(force("organ", of, random.between(0.01, 0.2), Region::sphere(at, random.logBetween(0.005, 0.1)))));
      run(world, random.between(0.02, 0.2));
    }
    run(world, 8.0);
    const WorldSnapshot shot = world.snapshot({false, true, true});
    for (const Vec3& p : shot.bodies[0].particles) ASSERT_TRUE(p.allFinite());
    EXPECT_NEAR(shot.bodies[0].measures.volume, rest, 0.05 * rest);
    for (const Event& event : world.takeEvents()) EXPECT_NE(event.type, EventType::kFault) << event.text;
  }
}

}  // namespace force_test
}  // namespace meshless
