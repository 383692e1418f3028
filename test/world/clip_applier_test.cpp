// Clip appliers in a hand: a clip where their jaws close on a vessel. In the world at its defaults.
#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/base/random.h"
#include "meshless_surgery/world/saved_world.h"
#include "meshless_surgery/world/world.h"
#include "support/bodies.h"

namespace meshless {
namespace clip_applier_test {

constexpr double kOpen = 1.2;      // [rad]
constexpr double kLength = 0.048;  // [m] of the vessel, along x from 0 on, at z = 0
constexpr double kOuter = 0.003, kInner = 0.002;

/// Open at both ends.
TriangleMesh tube() {
  constexpr int kRound = 24, kRings = 61;
  TriangleMesh mesh;
  for (const double radius : {kOuter, kInner})
    for (int i = 0; i < kRings; ++i)
      for (int k = 0; k < kRound; ++k) {
        const double angle = 2.0 * M_PI * k / kRound;
        mesh.vertices.push_back(Vec3(i * kLength / (kRings - 1), radius * std::cos(angle), radius * std::sin(angle)));
      }
  const auto face = [&](int a, int b, int c, int d) {
    const auto at = [](int v) { return static_cast<Index>(v); };
    mesh.triangles.push_back({at(a), at(b), at(c)});
    mesh.triangles.push_back({at(a), at(c), at(d)});
  };
  const int inner = kRings * kRound, last = (kRings - 1) * kRound;
  for (int k = 0; k < kRound; ++k) {
    const int n = (k + 1) % kRound;
    for (int i = 0; i + 1 < kRings; ++i) {
      const int a = i * kRound, b = a + kRound;
      face(a + k, a + n, b + n, b + k);
      face(inner + a + k, inner + b + k, inner + b + n, inner + a + n);
    }
    face(k, inner + k, inner + n, n);
    face(last + k, last + n, inner + last + n, inner + last + k);
  }
  return mesh;
}

BodyDef vessel(const TriangleMesh& mesh, double youngs) {
  BodyDef def = test::defOf(mesh, "vessel");
  def.spacing = 0.002;
  def.material.youngs_modulus = youngs;
  def.material.poissons_ratio = 0.45;
  def.material.damping = 20.0;
  for (const double x : {0.0, kLength})
    def.fixed.push_back(HeldRegion(Vec3(x - 0.003, -1, -1), Vec3(x + 0.003, 1, 1)));
  return def;
}

/// From above, turned about its shaft: 0 has the jaws open across the vessel.
InstrumentDef applier(double turn = 0.0) {
  InstrumentDef def;
  def.name = "right";
  def.type = InstrumentType::kClipApplier;
  Mat3 axes;
  axes << 0, 0, 1, 0, 1, 0, -1, 0, 0;  // x down, y along y
  def.pose = {Quat(axes) * Quat(Eigen::AngleAxisd(turn, Vec3::UnitX())), Vec3(0.5 * kLength, 0, 0.03)};
  return def;
}

void lead(World& world, const Vec3& to, double seconds, double jaw) {
  const Instrument before = world.snapshot({}).instruments.at(0);
  const int steps = static_cast<int>(std::lround(seconds * world.settings().step_rate));
  for (int step = 1; step <= steps; ++step) {
    const double share = static_cast<double>(step) / steps;
    LeadInstrumentCommand command;
    command.name = "right";
    command.pose = Pose{before.target.rotation, before.target.translation + share * (to - before.target.translation)};
    command.jaw = before.jaw_target + share * (jaw - before.jaw_target);
    ASSERT_TRUE(world.apply(command).ok());
    world.step();
  }
}

Vec3 above(double x) { return {x, 0, 0.03}; }
Vec3 around(double x) { return {x, 0, -0.009}; }

/// Opens above, goes there, closes, opens and goes up again.
void clipAt(World& world, double x) {
  lead(world, above(x), 0.3, kOpen);
  lead(world, around(x), 0.5, kOpen);
  lead(world, around(x), 0.5, 0.0);
  lead(world, around(x), 0.3, kOpen);
  lead(world, above(x), 0.5, kOpen);
}

std::size_t said(World& world, EventType type) {
  std::size_t count = 0;
  for (const Event& event : world.takeEvents()) {
    if (event.type != type) continue;
    ++count;
    EXPECT_EQ(event.instrument, "right");
    EXPECT_EQ(event.body, "vessel");
  }
  return count;
}

/// [m] between the inner walls, mean along lines across at x.
double lumenAt(World& world, double x) {
  const WorldSnapshot shot = world.snapshot({true, false, false});
  const Points& now = shot.bodies[0].surface;
  const Points& rest = shot.bodies[0].model->surface.vertices;
  double low = 0.0, high = 0.0;
  std::size_t lows = 0, highs = 0;
  const Points at_rest = world.inspect("vessel", true)->surface;
  for (std::size_t v = 0; v < rest.size(); ++v) {
    const Vec3& p = at_rest[v];
    if (std::abs(p.x() - x) > 1.5e-3 || std::hypot(p.y(), p.z()) > 0.5 * (kInner + kOuter)) continue;
    if (std::abs(p.z()) > 0.5 * kInner) continue;  // the sides to y
    (p.y() > 0.0 ? high : low) += now[v].y();
    ++(p.y() > 0.0 ? highs : lows);
  }
  return high / static_cast<double>(highs) - low / static_cast<double>(lows);
}

TEST(ClipApplier, EachClosingLeavesAClip) {
  for (const double youngs : {1e4, 5e4, 2e5}) {
    SCOPED_TRACE(youngs);
    World world{test::weightless()};
    ASSERT_TRUE(world.addSceneBody(test::shared(vessel(tube(), youngs))).ok());
    ASSERT_TRUE(world.apply(AttachInstrumentCommand{applier()}).ok());
    const double open = lumenAt(world, 0.016);
    EXPECT_NEAR(open, 2.0 * kInner, 0.2 * kInner);
    clipAt(world, 0.016);
    EXPECT_EQ(said(world, EventType::kClipped), 1u);
    clipAt(world, 0.030);
    EXPECT_EQ(said(world, EventType::kClipped), 1u);
    for (int step = 0; step < 240; ++step) world.step();
    const WorldSnapshot shot = world.snapshot({true, false, false});
    ASSERT_EQ(shot.attachments.size(), 2u);
    EXPECT_NEAR(shot.attachments[0].middle.x(), 0.016, 0.002);
    EXPECT_NEAR(shot.attachments[1].middle.x(), 0.030, 0.002);
    for (const double x : {0.016, 0.030}) EXPECT_LT(lumenAt(world, x), 0.4 * open) << x;
  }
}

// One closing is one clip, however long the jaws stay closed and rock; a hand that does not open has no other.
TEST(ClipApplier, OneClosingIsOneClip) {
  World world{test::weightless()};
  ASSERT_TRUE(world.addSceneBody(test::shared(vessel(tube(), 5e4))).ok());
  ASSERT_TRUE(world.apply(AttachInstrumentCommand{applier()}).ok());
  lead(world, above(0.02), 0.3, kOpen);
  lead(world, around(0.02), 0.5, kOpen);
  EXPECT_EQ(said(world, EventType::kClipped), 0u);  // open jaws around it are no clip
  lead(world, around(0.02), 0.5, 0.0);
  for (int k = 0; k < 5; ++k) {
    lead(world, around(0.022), 0.2, 0.0);
    lead(world, around(0.018), 0.2, 0.02);
  }
  EXPECT_EQ(said(world, EventType::kClipped), 1u);
  EXPECT_EQ(world.snapshot({}).attachments.size(), 1u);
}

TEST(ClipApplier, WhatIsNotHollowGetsNone) {
  World world{test::weightless()};
  TriangleMesh solid = boxMesh(Vec3(kLength, 0.005, 0.005), 0.002);
  for (Vec3& p : solid.vertices) p.x() += 0.5 * kLength;
  ASSERT_TRUE(world.addSceneBody(test::shared(vessel(solid, 5e4))).ok());
  ASSERT_TRUE(world.apply(AttachInstrumentCommand{applier()}).ok());
  clipAt(world, 0.02);
  EXPECT_EQ(said(world, EventType::kMisfired), 1u);
  EXPECT_TRUE(world.snapshot({}).attachments.empty());
}

// Wherever and however it comes: nothing is clipped twice, nothing but the vessel, and all of it stays finite.
TEST(ClipApplier, RandomClosings) {
  for (std::uint64_t seed = 31; seed <= 36; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Random random(seed);
    World world{test::weightless()};
    ASSERT_TRUE(world.addSceneBody(test::shared(vessel(tube(), random.logBetween(5e3, 2e5)))).ok());
    ASSERT_TRUE(world.apply(AttachInstrumentCommand{applier(random.between(-0.6, 0.6))}).ok());
    std::size_t closings = 0, clips = 0, misfires = 0;
    for (int k = 0; k < 4; ++k) {
      const double x = random.between(0.01, 0.038);
      const Vec3 at = around(x) + Vec3(0, random.between(-0.003, 0.003), random.between(-0.004, 0.004));
      lead(world, above(x), 0.2, kOpen);
      lead(world, at, random.between(0.2, 0.6), kOpen);
      lead(world, at, random.between(0.1, 0.6), 0.0);
      lead(world, at, 0.2, kOpen);
      lead(world, above(x), 0.3, kOpen);
      ++closings;
      for (const Event& event : world.takeEvents()) {
        clips += event.type == EventType::kClipped;
        misfires += event.type == EventType::kMisfired;
        EXPECT_NE(event.type, EventType::kFault) << event.text;
      }
      EXPECT_LE(clips + misfires, closings);
    }
    EXPECT_GE(clips, 3u) << misfires << " misfires";
    const WorldSnapshot shot = world.snapshot({true, true, false});
    EXPECT_EQ(shot.attachments.size(), clips);
    EXPECT_TRUE(test::allFinite(shot.bodies[0].particles));
  }
}

TEST(ClipApplier, ItIsSavedInTheMiddleOfAClosing) {
  World world{test::weightless()};
  ASSERT_TRUE(world.addSceneBody(test::shared(vessel(tube(), 5e4))).ok());
  ASSERT_TRUE(world.apply(AttachInstrumentCommand{applier()}).ok());
  lead(world, above(0.02), 0.3, kOpen);
  lead(world, around(0.02), 0.5, kOpen);
  lead(world, around(0.02), 0.1, 0.6);
  const auto decoded = decode(encode(*world.capture()));
  ASSERT_TRUE(decoded.ok()) << decoded.error().detail;
  World other{WorldSettings()};
  other.restore(*decoded->world);
  for (World* one : {&world, &other}) {
    lead(*one, around(0.02), 0.4, 0.0);
    EXPECT_EQ(one->snapshot({}).attachments.size(), 1u);
  }
  EXPECT_EQ(world.stateHash(), other.stateHash());
}

}  // namespace clip_applier_test
}  // namespace meshless
