// Laws of clips: what is closed stays closed, whatever is cut, saved or undone.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "meshless_surgery/world/command_log.h"
#include "meshless_surgery/world/saved_world.h"
#include "support/bodies.h"

namespace meshless {
namespace clip_test {

constexpr int kRound = 24;                                         // vertices of a ring
constexpr double kOuter = 0.003, kInner = 0.002, kLength = 0.048;  // [m]
constexpr double kPitch = 0.0008;                                  // [m] between rings
const Vec3 kAt(0, 0, 0.1);                                         // [m] of its first end

/// A vessel along x, open at both ends.
TriangleMesh vessel() {
  TriangleMesh mesh;
  const int rings = static_cast<int>(std::lround(kLength / kPitch)) + 1;
  for (const double radius : {kOuter, kInner})
    for (int i = 0; i < rings; ++i)
      for (int k = 0; k < kRound; ++k) {
        const double angle = 2.0 * M_PI * k / kRound;
        mesh.vertices.push_back(Vec3(i * kPitch, radius * std::cos(angle), radius * std::sin(angle)));
      }
  const auto face = [&](int a, int b, int c, int d) {
    mesh.triangles.push_back({static_cast<Index>(a), static_cast<Index>(b), static_cast<Index>(c)});
    mesh.triangles.push_back({static_cast<Index>(a), static_cast<Index>(c), static_cast<Index>(d)});
  };
  const int inner = rings * kRound, last = (rings - 1) * kRound;
  for (int k = 0; k < kRound; ++k) {
    const int n = (k + 1) % kRound;
    for (int i = 0; i + 1 < rings; ++i) {
      const int a = i * kRound, b = a + kRound;
      face(a + k, a + n, b + n, b + k);
      face(inner + a + k, inner + b + k, inner + b + n, inner + a + n);
    }
    face(k, inner + k, inner + n, n);
    face(last + k, last + n, inner + last + n, inner + last + k);
  }
  return mesh;
}

BodyDef tube(bool held) {
  BodyDef def;
  def.name = "vessel";
  def.mesh = vessel();
  def.pose.translation = kAt;
  def.spacing = 0.002;
  def.material.youngs_modulus = 3e4;
  def.material.poissons_ratio = 0.45;
  def.material.density = 1050.0;
  def.material.damping = 20.0;
  if (held)
    for (const double x : {0.0, kLength})
      def.fixed.push_back(HeldRegion(kAt + Vec3(x - 0.003, -1, -1), kAt + Vec3(x + 0.003, 1, 1)));
  return def;
}

World worldOf(const BodyDef& def) {
  World world(test::weightless());
  const auto added = world.addSceneBody(test::shared(def));
  EXPECT_TRUE(added.ok()) << (added.ok() ? "" : added.error().detail);
  return world;
}

ClipCommand clipAt(double x) {
  ClipCommand clip;
  clip.point = kAt + Vec3(x, 0, kOuter);
  clip.direction = Vec3(0, 0, 2.0);
  clip.width = 0.004;
  return clip;
}

ClipReply close(World& world, const ClipCommand& clip) { return test::replyOf<ClipReply>(world.apply(clip)); }

void live(World& world, double seconds) {
  for (int n = 0; n < std::lround(seconds * world.settings().step_rate); ++n) world.step();
}

WorldSnapshot seen(World& world) {
  SnapshotWants wants;
  wants.surfaces = wants.measures = true;
  return world.snapshot(wants);
}

/// [m] that opposite walls at x are apart along z, in the mean, whichever pieces they are in.
double lumen(World& world, double x) {
  std::vector<std::pair<double, Vec3>> ring;  // angles
  for (const BodySnapshot& body : seen(world).bodies) {
    const Points& rest = body.model->surface.vertices;
    for (std::size_t v = 0; v < rest.size(); ++v)
      if (std::abs(std::hypot(rest[v].y(), rest[v].z()) - kInner) < 1e-5 && std::abs(rest[v].x() - x) < 0.3 * kPitch)
        ring.push_back({std::atan2(rest[v].z(), rest[v].y()), body.surface[v]});
  }
  EXPECT_GE(ring.size(), static_cast<std::size_t>(kRound)) << x;
  double apart = 0.0;
  int pairs = 0;
  for (const auto& [above, top] : ring)
    for (const auto& [below, bottom] : ring)
      if (above > 0.1 && above < M_PI - 0.1 && std::abs(above + below) < 1e-3) {
        apart += std::abs((top - bottom).z());
        ++pairs;
      }
  return apart / pairs;
}

CutReply cutAt(World& world, double x) {
  CutCommand cut;
  cut.blades.origin = kAt + Vec3(x, -1, 0);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3::UnitZ();
  return test::replyOf<CutReply>(world.apply(cut));
}

TEST(Clip, ClosesTheLumenAndTheRestOfItStaysOpen) {
  World world = worldOf(tube(true));
  const double open = lumen(world, 0.024), beside = lumen(world, 0.0096);
  EXPECT_NEAR(open, 4.0 / M_PI * kInner, 0.1 * open);
  const ClipReply reply = close(world, clipAt(0.024));
  EXPECT_EQ(reply.body, "vessel");
  EXPECT_EQ(reply.name, "vessel-clip");
  EXPECT_NEAR(reply.lumen, 2.0 * kInner, 0.1 * kInner);
  double before = open;
  for (int n = 0; n < 4; ++n) {
    live(world, 0.5);
    const double now = lumen(world, 0.024);
    EXPECT_LT(now, n == 0 ? before : 0.15 * open) << n;
    before = now;
  }
  EXPECT_GT(lumen(world, 0.0096), 0.5 * beside);
  ASSERT_EQ(seen(world).attachments.size(), 1u);
  EXPECT_EQ(seen(world).attachments[0].fibres, reply.fibres);
  EXPECT_EQ(seen(world).attachments[0].ends, std::vector<std::string>{"vessel"});
  EXPECT_FALSE(seen(world).attachments[0].lines.empty());
}

TEST(Clip, OpensAgainWhenItIsTakenOff) {
  World world = worldOf(tube(true));
  const double open = lumen(world, 0.024);
  const ClipReply reply = close(world, clipAt(0.024));
  live(world, 1.0);
  EXPECT_LT(lumen(world, 0.024), 0.15 * open);
  ASSERT_TRUE(world.apply(DetachCommand{reply.name, {}}).ok());
  live(world, 2.0);
  EXPECT_GT(lumen(world, 0.024), 0.9 * open);
}

TEST(Clip, GivesNoMomentumAndNoMoreEnergyThanItsJawsHaveSpeed) {
  World world = worldOf(tube(false));
  close(world, clipAt(0.024));
  ClipCommand oblique = clipAt(0.012);
  oblique.direction = Vec3(0.3, 0.5, 1.0);
  close(world, oblique);
  for (int n = 0; n < 120; ++n) {
    world.step();
    const BodySnapshot body = seen(world).bodies[0];
    const double mass = body.model->mass;
    EXPECT_LT(body.measures.kinetic_energy, 0.5 * mass * 0.03 * 0.03) << n;
    EXPECT_LT(body.measures.linear_momentum.norm(), 1e-10 * mass * 0.02) << n;
    EXPECT_LT(body.measures.angular_momentum.norm(), 1e-9 * mass * 0.02 * kLength) << n;
  }
}

TEST(Clip, ACutBetweenTwoLeavesOneOnEachPieceAndBothClosed) {
  World world = worldOf(tube(true));
  const double open = lumen(world, 0.024);
  const ClipReply first = close(world, clipAt(0.016)), second = close(world, clipAt(0.032));
  EXPECT_NE(first.name, second.name);
  live(world, 1.0);
  const CutReply cut = cutAt(world, 0.0243);
  ASSERT_EQ(cut.new_bodies.size(), 2u);
  const WorldSnapshot shot = seen(world);
  ASSERT_EQ(shot.attachments.size(), 2u);
  for (const AttachmentSnapshot& clip : shot.attachments) ASSERT_EQ(clip.ends.size(), 1u) << clip.name;
  EXPECT_NE(shot.attachments[0].ends, shot.attachments[1].ends);
  for (const ClipReply& reply : {first, second}) {
    const auto& of = shot.attachments[&reply == &first || reply.name == first.name ? 0 : 1];
    EXPECT_EQ(of.fibres, reply.fibres);
  }
  for (int n = 0; n < 3; ++n) {
    live(world, 0.5);
    EXPECT_LT(lumen(world, 0.016), 0.17 * open) << n;
    EXPECT_LT(lumen(world, 0.032), 0.17 * open) << n;
  }
}

TEST(Clip, NoBladeCutsIt) {
  World world = worldOf(tube(true));
  const ClipReply reply = close(world, clipAt(0.024));
  live(world, 1.0);
  CutCommand along;  // through the clip, along the vessel and across the fibres
  Vec3 middle = Vec3::Zero();
  const auto lines = seen(world).attachments[0].lines;
  for (const auto& line : lines) middle += (line[0] + line[1]) / (2.0 * static_cast<double>(lines.size()));
  along.blades.origin = Vec3(-0.1, 0, middle.z());
  along.blades.x_axis = Vec3::UnitX();
  along.blades.y_axis = Vec3::UnitY();
  const CutReply cut = test::replyOf<CutReply>(world.apply(along));
  EXPECT_EQ(cut.new_bodies.size(), 2u);
  const WorldSnapshot shot = seen(world);
  ASSERT_EQ(shot.attachments.size(), 1u);
  EXPECT_EQ(shot.attachments[0].fibres, reply.fibres);
}

TEST(Clip, IsSavedUndoneAndReplayedToTheBit) {
  World world = worldOf(tube(true));
  std::string log;
  world.record([&](const std::string& bytes) { log += bytes; });
  const auto twin = [&] {
    const std::string bytes = encode(*world.capture());
    const Result<DecodedWorld> decoded = decode(bytes);
    EXPECT_TRUE(decoded.ok()) << decoded.error().detail;
    World other{WorldSettings()};
    other.restore(*decoded->world);
    EXPECT_EQ(other.stateHash(), world.stateHash());
    EXPECT_EQ(encode(*other.capture()), bytes);
    live(other, 0.2);
    return other.stateHash();
  };
  close(world, clipAt(0.016));
  live(world, 0.05);
  const std::uint64_t closing = twin();
  live(world, 0.2);
  EXPECT_NE(closing, 0u);
  close(world, clipAt(0.032));
  live(world, 0.5);
  const double closed = lumen(world, 0.016);
  const WorldSnapshot before = seen(world);
  cutAt(world, 0.0243);
  const std::uint64_t ahead = twin();
  live(world, 0.2);
  EXPECT_EQ(world.stateHash(), ahead);
  ASSERT_TRUE(world.apply(UndoCutCommand()).ok());
  EXPECT_DOUBLE_EQ(lumen(world, 0.016), closed);
  ASSERT_EQ(seen(world).attachments.size(), 2u);
  for (std::size_t n = 0; n < 2; ++n) EXPECT_EQ(seen(world).attachments[n].fibres, before.attachments[n].fibres);
  live(world, 0.1);
  world.record({});
  std::istringstream stream(log);
  const auto replayed = replay(stream, 1);
  ASSERT_TRUE(replayed.ok()) << replayed.error().detail;
  EXPECT_FALSE(replayed->difference);
  EXPECT_EQ(replayed->hash, world.stateHash());
  world.reset();
  EXPECT_TRUE(seen(world).attachments.empty());
}

TEST(Clip, RefusesWhatIsWrongAndChangesNothing) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  World world = worldOf(tube(true));
  BodyDef block;
  block.name = "block";
  block.mesh = boxMesh(Vec3::Constant(0.02), 4, 4, 4);
  block.pose.translation = Vec3(0, 0, 0.3);
  ASSERT_TRUE(world.addSceneBody(test::shared(block)).ok());
  close(world, clipAt(0.03));
  const std::uint64_t hash = world.stateHash();
  const auto refuses = [&](const ClipCommand& command, ErrorCode code, const std::string& word) {
    const auto reply = world.apply(command);
    ASSERT_FALSE(reply.ok()) << word;
    EXPECT_EQ(reply.error().code, code) << reply.error().detail;
    EXPECT_NE(reply.error().detail.find(word), std::string::npos) << reply.error().detail;
    EXPECT_EQ(world.stateHash(), hash) << word;
  };
  const auto with = [](auto change) {
    ClipCommand command = clipAt(0.02);
    change(command);
    return command;
  };
  for (const double bad : {0.0, -1.0, kNan, 1e9}) {
    refuses(with([&](ClipCommand& c) { c.width = bad; }), ErrorCode::kInvalidArgument, "width");
    refuses(with([&](ClipCommand& c) { c.opening = bad; }), ErrorCode::kInvalidArgument, "opening");
  }
  refuses(with([&](ClipCommand& c) { c.point.x() = kNan; }), ErrorCode::kInvalidArgument, "point");
  refuses(with([&](ClipCommand& c) { c.direction.x() = kNan; }), ErrorCode::kInvalidArgument, "direction");
  refuses(with([&](ClipCommand& c) { c.direction.setZero(); }), ErrorCode::kInvalidArgument, "direction");
  refuses(with([&](ClipCommand& c) { c.direction = Vec3::UnitX(); }), ErrorCode::kInvalidArgument, "along");
  refuses(with([&](ClipCommand& c) { c.body = "spleen"; }), ErrorCode::kUnknownName, "spleen");
  refuses(with([&](ClipCommand& c) { c.name = "vessel-clip"; }), ErrorCode::kDuplicateName, "vessel-clip");
  refuses(with([&](ClipCommand& c) { c.point.z() += 0.05; }), ErrorCode::kMissed, "0.05");
  refuses(with([&](ClipCommand& c) { c.opening = 0.005; }), ErrorCode::kMissed, "0.00");
  refuses(with([&](ClipCommand& c) { c.point = Vec3(0, 0, 0.311); }), ErrorCode::kMissed, "hollow");
}

// "is 0.0092 m thick there; the jaws open to 0.012 m" is no reason.
TEST(Clip, WhatDoesNotFitIsRefusedWithNumbersThatSaySo) {
  World world = worldOf(tube(true));
  for (const double slant : {0.0, 20.0, 35.0}) {
    ClipCommand clip = clipAt(0.02);
    clip.direction = Vec3(std::sin(slant * M_PI / 180.0), 0, std::cos(slant * M_PI / 180.0));
    for (clip.opening = 0.007; clip.opening < 0.02; clip.opening += 0.0005) {
      const auto reply = world.apply(clip);
      if (reply.ok()) break;
      SCOPED_TRACE(reply.error().detail);
      double reach = 0.0, thick = 0.0, beside = 0.0, most = 0.0;
      ASSERT_EQ(std::sscanf(reply.error().detail.c_str(),
                            "'vessel' reaches %lf m from the middle of the jaws: it is %lf m thick there, and its "
                            "middle %lf m beside theirs; accepted: up to %lf m",
                            &reach, &thick, &beside, &most),
                4);
      EXPECT_NEAR(most, 0.5 * clip.opening, 1e-5);
      EXPECT_GE(reach, most);  // three digits
      EXPECT_NEAR(reach, 0.5 * thick + beside, 2e-5);
      EXPECT_LT(thick, 2.0 * kOuter / std::cos(slant * M_PI / 180.0) + 1e-4);
    }
    EXPECT_LT(clip.opening, 0.012) << slant;
    EXPECT_GT(clip.opening, slant > 0.0 ? 0.007 : 0.0069) << slant;
  }
}

TEST(Clip, WakesWhatItHoldsAndNobodyElse) {
  World world = worldOf(tube(true));
  BodyDef other = tube(true);
  other.name = "other";
  other.pose.translation.y() += 0.1;
  other.fixed.front() = HeldRegion(Vec3::Constant(-1.0), Vec3::Constant(1.0));
  other.fixed.pop_back();
  ASSERT_TRUE(world.addSceneBody(test::shared(other)).ok());
  live(world, 2.0);
  EXPECT_EQ(seen(world).report.asleep, 2u);
  close(world, clipAt(0.024));
  world.step();
  EXPECT_EQ(seen(world).report.asleep, 1u);
  EXPECT_FALSE(seen(world).bodies[0].asleep);
  live(world, 4.0);
  EXPECT_EQ(seen(world).report.asleep, 2u) << "a clipped vessel comes to rest";
}

TEST(Clip, NothingIsPaidWhereThereIsNone) {
  World world = worldOf(tube(true));
  live(world, 0.1);
  EXPECT_EQ(seen(world).report.fibres, 0u);
}

}  // namespace clip_test
}  // namespace meshless
