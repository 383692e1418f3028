// A scalpel in a hand: what its edge opens, and what it feels of it. In the world at its defaults.
#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/base/random.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/geometry/query/union_find.h"
#include "meshless_surgery/world/saved_world.h"
#include "meshless_surgery/world/world.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"
#include "support/stress.h"

namespace meshless {
namespace scalpel_instrument_test {

constexpr double kToughness = 200.0;  // [J/m^2]
const Vec3 kSize(0.12, 0.04, 0.02);   // [m] of the block; its top is at z = 0.01

/// Shaft down, edge towards x, then leaning back by `lean` [rad].
Quat turnOf(double lean, double yaw = 0.0) {
  Mat3 axes;
  axes << 0, -1, 0, 0, 0, 1, -1, 0, 0;
  return Quat(Eigen::AngleAxisd(yaw, Vec3::UnitZ())) * Quat(Eigen::AngleAxisd(-lean, Vec3::UnitY())) * Quat(axes);
}

BodyDef block(double edge, double toughness = kToughness, const Vec3& size = kSize) {
  BodyDef def = test::defOf(boxMesh(size, edge), "block");
  def.material.youngs_modulus = 2e4;
  def.material.poissons_ratio = 0.4;
  def.material.damping = 5.0;
  def.material.toughness = toughness;
  HeldRegion held(Vec3(-1, -1, -1), Vec3(1, 1, -0.4 * size.z()));
  held.in_world = false;
  def.fixed = {held};
  return def;
}

struct Hand {
  World& world;
  double work = 0.0;      // [J] on what is cut
  double felt = 0.0;      // [J] by the force that is told
  double farthest = 0.0;  // [m] of the tip from where it is wanted

  explicit Hand(World& in, const Pose& from, double sharpness = 1.0, double max_force = 10.0, double length = 0.018)
      : world(in) {
    AttachInstrumentCommand command;
    command.def.name = "right";
    command.def.type = InstrumentType::kScalpel;
    command.def.pose = from;
    command.def.sharpness = sharpness;
    command.def.max_force = max_force;
    command.def.jaw_length = length;
    const auto reply = world.apply(command);
    EXPECT_TRUE(reply.ok()) << reply.error().detail;
  }
  Instrument state() const { return world.snapshot({}).instruments.at(0); }
  /// Evenly, at that speed.
  void lead(const Pose& to, double speed) {
    const Instrument before = state();
    const double way = (to.translation - before.target.translation).norm();
    const int steps = std::max(1, static_cast<int>(std::ceil(way / speed * world.settings().step_rate)));
    for (int step = 1; step <= steps; ++step) {
      const double share = static_cast<double>(step) / steps;
      LeadInstrumentCommand command;
      command.name = "right";
      command.pose = Pose{before.target.rotation.slerp(share, to.rotation),
                          before.target.translation + share * (to.translation - before.target.translation)};
      EXPECT_TRUE(world.apply(command).ok());
      const Instrument then = state();
      world.step();
      const Instrument now = state();
      felt -= now.force.dot(now.pose.translation - then.pose.translation);
      farthest = std::max(farthest, (now.pose.translation - now.target.translation).norm());
    }
  }
  void rest(double seconds) {
    for (int step = 0; step < std::lround(seconds * world.settings().step_rate); ++step) world.step();
  }
};

struct Opened {
  double area = 0.0;                     // [m^2] of one lip, at rest
  double deepest = 0.0, farthest = 0.0;  // [m] at rest: below the top, along x
  int wounds = 0;                        // that hang together
};

Opened openedIn(World& world, double top = 0.5 * kSize.z()) {
  Opened opened;
  const WorldSnapshot shot = world.snapshot({false, true});
  for (const BodySnapshot& body : shot.bodies) {
    const TriangleMesh& surface = body.model->surface;
    UnionFind wounds(static_cast<Index>(surface.vertices.size()));
    std::vector<char> in(surface.vertices.size(), 0);
    for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
      if (!isCutPatch(surface.patches[t])) continue;
      const auto corner = [&](int k) { return surface.vertices[surface.triangles[t][k]]; };
      opened.area += 0.25 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
      for (int k = 0; k < 3; ++k) {
        const Index v = surface.triangles[t][k];
        in[v] = 1;
        wounds.join(surface.triangles[t][0], v);
        opened.deepest = std::max(opened.deepest, top - corner(k).z());
        opened.farthest = std::max(opened.farthest, corner(k).x());
      }
    }
    for (Index v = 0; v < in.size(); ++v) opened.wounds += in[v] && wounds.find(v) == v;
  }
  return opened;
}

std::size_t pieces(World& world) { return world.snapshot({}).bodies.size(); }

// A stroke of 10 cm: one wound as deep and as long as the tip has gone, for the toughness of its area.
TEST(ScalpelInHand, LeavesOneWoundForTheToughnessOfItsArea) {
  constexpr double kDepth = 0.006;
  for (const auto& [edge, speed] : std::vector<std::array<double, 2>>{{0.006, 0.05}, {0.004, 0.1}, {0.003, 0.05}}) {
    SCOPED_TRACE(testing::Message() << edge << " m, " << speed << " m/s");
    World world{test::weightless()};
    ASSERT_TRUE(world.addSceneBody(test::shared(block(edge))).ok());
    const Quat turn = turnOf(0.0);
    const double in = 0.5 * kSize.z() - kDepth;
    Hand hand(world, {turn, Vec3(-0.05, 7e-4, 0.015)});
    hand.lead({turn, Vec3(-0.05, 7e-4, in)}, speed);
    hand.lead({turn, Vec3(0.05, 7e-4, in)}, speed);
    hand.rest(0.3);
    const Opened opened = openedIn(world);
    EXPECT_EQ(pieces(world), 1u);
    EXPECT_EQ(opened.wounds, 1);
    EXPECT_NEAR(opened.area, 0.1 * kDepth, 0.05 * 0.1 * kDepth);
    EXPECT_NEAR(hand.felt, kToughness * opened.area, 0.05 * kToughness * opened.area);
    EXPECT_NEAR(opened.deepest, kDepth, 5e-4);
    EXPECT_NEAR(opened.farthest, 0.05, 2e-3);
  }
}

// However the blade leans, along straight ways and curved ones, and where the hand trembles.
TEST(ScalpelInHand, LeavesOneWoundHoweverItIsHeld) {
  for (std::uint64_t seed = 1; seed < 8; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    World world{test::weightless()};
    ASSERT_TRUE(world.addSceneBody(test::shared(block(random.between(0.003, 0.006)))).ok());
    const double lean = random.between(-0.1, seed % 2 ? 0.9 : 0.5), depth = random.between(0.003, 0.008);
    const double bend = seed % 2 ? 0.0 : random.between(-1.0, 1.0);  // [rad] over all of the way
    const double tremble = random.between(0.0, 3e-4);                // [m]
    const double in = 0.5 * kSize.z() - depth;
    const auto at = [&](double share) {
      const double yaw = bend * (share - 0.5);
      const double x = 0.08 * (share - 0.5), y = bend * 0.04 * (share - 0.5) * (share - 0.5);
      return Pose{turnOf(lean, yaw), Vec3(x, y + 7e-4, in)};
    };
    Pose over = at(0.0);
    over.translation.z() = 0.5 * kSize.z() + 0.003;
    Hand hand(world, over);
    hand.lead(at(0.0), 0.05);
    constexpr int kParts = 200;
    for (int k = 1; k <= kParts; ++k) {
      Pose to = at(static_cast<double>(k) / kParts);
      to.translation += tremble * Vec3(0, random.between(-1, 1), random.between(-1, 1));
      hand.lead(to, 0.05);
    }
    hand.rest(0.3);
    const Opened opened = openedIn(world);
    EXPECT_EQ(pieces(world), 1u);
    EXPECT_EQ(opened.wounds, 1);
    // Work of turning is not felt.
    EXPECT_NEAR(hand.felt, kToughness * opened.area, (bend == 0.0 ? 0.03 : 0.1) * kToughness * opened.area);
    // Blades that turn open up to a fifth more, as flat snips overlap; of those that lean snips end in steps.
    const double way = 0.08 * (1.0 + bend * bend / 24.0), share = opened.area / (way * depth);
    EXPECT_GT(share, 0.97);
    EXPECT_LT(share, bend == 0.0 ? 1.05 : 1.2);
    EXPECT_NEAR(opened.deepest, depth, bend == 0.0 ? 5e-4 + 1.5e-3 * std::abs(lean) : 2e-3);
  }
}

/// Whether it did; it may hang by a thread.
bool partABlock(std::uint64_t seed) {
  Random random(seed);
  World world{test::weightless()};
  const Vec3 size(0.03, 0.06, random.between(0.006, 0.012));
  BodyDef def = block(random.between(0.003, 0.005), kToughness, size);
  HeldRegion left(Vec3(-1, -1, -1), Vec3(1, -0.02, 1)), right(Vec3(-1, 0.02, -1), Vec3(1, 1, 1));
  left.in_world = right.in_world = false;
  def.fixed = {left, right};
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  const Quat turn = turnOf(random.between(-0.1, 0.5), random.between(-0.3, 0.3));
  const Vec3 ahead = (turn * Vec3::UnitZ()).cross(Vec3::UnitZ()).normalized();
  const Vec3 start = Vec3(0, random.between(-0.005, 0.005), -0.5 * size.z() - 0.004) - 0.03 * ahead;
  Hand hand(world, {turn, start}, 1.0, 40.0);
  hand.lead({turn, start + 0.075 * ahead}, 0.05);
  hand.rest(0.3);
  const double area = openedIn(world).area;
  EXPECT_NEAR(area, size.x() * size.z() / ahead.x(), 0.03 * area);
  EXPECT_NEAR(hand.felt, kToughness * area, 0.03 * kToughness * area);
  return pieces(world) == 2;
}

TEST(ScalpelInHand, PartsABlockThatItGoesThrough) {
  int hang = 0;
  for (std::uint64_t seed = 1; seed < 7; ++seed) {
    SCOPED_TRACE(seed);
    hang += partABlock(seed) ? 0 : 1;
  }
  EXPECT_EQ(hang, 0);
}

TEST(ScalpelInHand, PartsABlockThatItGoesThrough_Long) {
  const std::uint64_t first = 1000 + 100 * static_cast<std::uint64_t>(stress::seed());
  int hang = 0;
  for (std::uint64_t seed = first; seed < first + 60; ++seed) {
    SCOPED_TRACE(seed);
    hang += partABlock(seed) ? 0 : 1;
  }
  EXPECT_LE(hang, 3);
}

TEST(ScalpelInHand, StandsWhereItIsTooBluntForItsForce) {
  for (const double sharpness : {1.0, 0.1}) {
    World world{test::weightless()};
    ASSERT_TRUE(world.addSceneBody(test::shared(block(0.004, 1000.0))).ok());
    const Quat turn = turnOf(0.0);
    Hand hand(world, {turn, Vec3(-0.08, 7e-4, 0.004)}, sharpness, 10.0);
    hand.lead({turn, Vec3(0.0, 7e-4, 0.004)}, 0.05);
    hand.rest(0.5);
    const Opened opened = openedIn(world);
    // 6 N of 10, and 60.
    if (sharpness == 1.0) {
      EXPECT_NEAR(opened.area, 0.06 * 0.006, 0.05 * 0.06 * 0.006);
    } else {
      EXPECT_LT(opened.area, 1e-6);
      EXPECT_NEAR(hand.state().force.x(), -10.0, 0.1);
    }
  }
}

// A state that is saved within a stroke goes on with it; a stroke is undone as a whole.
TEST(ScalpelInHand, GoesOnFromASavedStateAndIsUndone) {
  World world{test::weightless()};
  ASSERT_TRUE(world.addSceneBody(test::shared(block(0.004))).ok());
  const Quat turn = turnOf(0.2);
  Hand hand(world, {turn, Vec3(-0.08, 7e-4, 0.004)});
  hand.lead({turn, Vec3(-0.02, 7e-4, 0.004)}, 0.05);
  const auto saved = decode(encode(*world.capture()));
  ASSERT_TRUE(saved.ok()) << saved.error().detail;
  World other{WorldSettings()};
  other.restore(*saved->world);
  for (World* of : {&world, &other})
    for (int step = 0; step < 120; ++step) {
      LeadInstrumentCommand command;
      command.name = "right";
      command.pose = Pose{turn, Vec3(-0.02 + 5e-4 * step, 7e-4, 0.004)};
      ASSERT_TRUE(of->apply(command).ok());
      of->step();
    }
  EXPECT_EQ(world.stateHash(), other.stateHash());
  EXPECT_EQ(openedIn(world).wounds, 1);
  bool told = false;
  for (const Event& event : world.takeEvents())
    if (event.type == EventType::kIncised) {
      told = true;
      EXPECT_EQ(event.instrument, "right");
    }
  EXPECT_TRUE(told);
  hand.lead({turn, Vec3(0.04, 7e-4, 0.04)}, 0.1);
  ASSERT_TRUE(world.apply(UndoCutCommand{}).ok());
  EXPECT_EQ(openedIn(world).area, 0.0);
  EXPECT_FALSE(world.apply(UndoCutCommand{}).ok());
}

// The back of the blade opens nothing, and what has been opened resists no more.
TEST(ScalpelInHand, CutsWithItsEdgeAlone) {
  World world{test::weightless()};
  ASSERT_TRUE(world.addSceneBody(test::shared(block(0.004))).ok());
  const Quat turn = turnOf(0.0);
  Hand hand(world, {turn, Vec3(-0.08, 7e-4, 0.004)});
  hand.lead({turn, Vec3(0.02, 7e-4, 0.004)}, 0.05);
  const double area = openedIn(world).area, felt = hand.felt;
  hand.lead({turn, Vec3(-0.05, 7e-4, 0.004)}, 0.05);
  hand.lead({turn, Vec3(0.01, 7e-4, 0.004)}, 0.05);
  EXPECT_NEAR(openedIn(world).area, area, 0.01 * area);
  EXPECT_NEAR(hand.felt, felt, 0.05 * felt);
}

TEST(ScalpelInHand, StopsAtTheGroundAndAtObstacles) {
  World world{WorldSettings()};
  const Quat turn = turnOf(0.0);
  Hand hand(world, {turn, Vec3(0, 0, 0.05)});
  hand.lead({turn, Vec3(0, 0, -0.05)}, 0.1);
  EXPECT_GT(hand.state().pose.translation.z(), -1e-4);
  EXPECT_NEAR(hand.state().force.z(), 10.0, 0.1);
}

// Strokes all over random organs: nothing is lost, nothing is thrown about, and nothing is without a volume.
TEST(ScalpelInHand, StrokesAllOverRandomOrgansLoseNothing) {
  for (std::uint64_t seed = 1; seed < 3; ++seed) {
    SCOPED_TRACE(seed);
    Random random(seed);
    World world{WorldSettings()};
    const auto mesh = randomOrgan(seed, static_cast<int>(seed % 2), 0.08, 1500);
    ASSERT_TRUE(mesh.ok());
    BodyDef def = test::defOf(*mesh, "organ");
    def.pose.translation = Vec3(0, 0, 0.002 - boundsOf(mesh->vertices).min.z());
    def.material.youngs_modulus = random.logBetween(2e3, 1e5);
    def.material.poissons_ratio = random.between(0.3, 0.47);
    def.material.toughness = random.between(0.0, 200.0);
    ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
    Hand hand(world, {turnOf(0.0), Vec3(0, 0, 0.2)}, random.between(0.2, 1.0), random.logBetween(2.0, 50.0), 0.06);
    const auto massOf = [&] {
      double mass = 0.0;
      for (const BodySnapshot& body : world.snapshot({true, true}).bodies) mass += body.model->mass;
      return mass;
    };
    const double mass = massOf();
    for (int stroke = 0; stroke < 5; ++stroke) {
      const Quat turn = turnOf(random.between(-0.5, 1.0), random.between(-3.0, 3.0));
      const Vec3 from(random.between(-0.05, 0.05), random.between(-0.05, 0.05), random.between(0.005, 0.05));
      const Vec3 to(random.between(-0.05, 0.05), random.between(-0.05, 0.05), random.between(0.005, 0.05));
      hand.lead({turn, from + 0.06 * Vec3::UnitZ()}, 1.0);
      hand.lead({turn, from}, random.logBetween(0.1, 0.5));
      hand.lead({turn, to}, random.logBetween(0.1, 0.5));
    }
    hand.lead({turnOf(0.0), Vec3(0, 0, 0.2)}, 0.5);
    hand.rest(1.0);
    EXPECT_NEAR(massOf(), mass, 1e-9 * mass);
    const WorldSnapshot before = world.snapshot({true, true});
    world.step();
    const WorldSnapshot after = world.snapshot({true, true});
    ASSERT_EQ(before.bodies.size(), after.bodies.size());
    for (std::size_t b = 0; b < after.bodies.size(); ++b) {
      ASSERT_TRUE(test::allFinite(after.bodies[b].surface));
      EXPECT_GT(signedVolume(after.bodies[b].model->surface), 0.0);
      double fastest = 0.0;
      for (std::size_t v = 0; v < after.bodies[b].surface.size(); ++v)
        fastest = std::max(fastest, 120.0 * (after.bodies[b].surface[v] - before.bodies[b].surface[v]).norm());
      EXPECT_LT(fastest, 2.0);
    }
  }
}

}  // namespace scalpel_instrument_test
}  // namespace meshless
