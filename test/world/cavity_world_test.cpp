// Filled cavities: how far walls stretch, what keeps its volume, and what blades open.
#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include "meshless_surgery/body/cavities.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/world/saved_world.h"
#include "support/bodies.h"

namespace meshless {
namespace cavity_world_test {

using test::replyOf;

TriangleMesh hollow(const TriangleMesh& outer, const TriangleMesh& inner, const Vec3& at = Vec3::Zero()) {
  TriangleMesh mesh = outer;
  shapes::append(mesh, shapes::turnedInsideOut(inner), at);
  return mesh;
}

BodyDef elastic(const TriangleMesh& mesh, double spacing, double youngs = 1e4) {
  BodyDef def = test::defOf(mesh, "bladder");
  def.spacing = spacing;
  def.material.youngs_modulus = youngs;
  def.material.poissons_ratio = 0.45;
  def.material.damping = 20.0;
  return def;
}

BodyDef ballOf(double outer, double wall, double spacing, double edge) {
  return elastic(hollow(sphereMesh(outer, edge), sphereMesh(outer - wall, edge)), spacing);
}

World worldOf(const BodyDef& def, const WorldSettings& settings) {
  World world(settings);
  SpawnCommand command;
  command.body = test::shared(def);
  const Result<Reply> reply = world.apply(command);
  EXPECT_TRUE(reply.ok()) << (reply.ok() ? "" : reply.error().detail);
  return world;
}

BodySnapshot bodyOf(World& world, std::size_t n = 0) {
  SnapshotWants wants;
  wants.surfaces = wants.measures = wants.particles = true;
  return world.snapshot(wants).bodies.at(n);
}

void run(World& world, double seconds) {
  const int steps = static_cast<int>(std::lround(seconds * world.settings().step_rate));
  for (int i = 0; i < steps; ++i) world.step();
}

// Mean of how far the vertices of the inner and of the outer wall have gone over how far they should have, about an
// axis, or about a centre where it is zero.
struct Stretch {
  double inner = 0.0, outer = 0.0;
};

template <class Radius, class Way>
Stretch stretchOf(const Points& before, const Points& after, double inner, double outer, const Radius& radius,
                  const Way& way) {
  Stretch sum, count;
  for (std::size_t v = 0; v < before.size(); ++v) {
    const double r = radius(before[v]), share = (radius(after[v]) - r) / way(r);
    if (std::abs(r - inner) < 1e-5) {
      sum.inner += share;
      count.inner += 1.0;
    } else if (std::abs(r - outer) < 1e-5) {
      sum.outer += share;
      count.outer += 1.0;
    }
  }
  return {sum.inner / count.inner, sum.outer / count.outer};
}

constexpr double kPressure = 10.0, kYoungs = 1e4, kPoisson = 0.45;

// Surfaces before and at rest under pressure.
std::pair<Points, Points> pressed(BodyDef def) {
  def.cavities.kind = CavityFill::Kind::kPressure;
  def.cavities.pressure = kPressure;
  World world = worldOf(def, test::weightless());
  const Points before = bodyOf(world).surface;
  run(world, 1.2);
  return {before, bodyOf(world).surface};
}

Stretch sphereStretch(double a, double b, double spacing) {
  const auto [before, after] = pressed(ballOf(b, b - a, spacing, 0.0015));
  return stretchOf(
      before, after, a, b, [](const Vec3& x) { return x.norm(); },
      [&](double r) {
        return kPressure * a * a * a / (kYoungs * (b * b * b - a * a * a)) *
               ((1 - 2 * kPoisson) * r + (1 + kPoisson) * b * b * b / (2 * r * r));
      });
}

// Far from its ends, which pull at its walls along the axis.
Stretch cylinderStretch(double a, double b, double spacing) {
  const double length = 0.08, ends = 0.01, edge = 0.0015;
  const TriangleMesh mesh = hollow(cylinderMesh(length, b, edge), cylinderMesh(length - 2.0 * ends, a, edge));
  const auto [before, after] = pressed(elastic(mesh, spacing));
  Points middle, stretched;
  for (std::size_t v = 0; v < before.size(); ++v) {
    if (std::abs(before[v].z()) > 0.01) continue;
    middle.push_back(before[v]);
    stretched.push_back(after[v]);
  }
  return stretchOf(
      middle, stretched, a, b, [](const Vec3& x) { return x.head<2>().norm(); },
      [&](double r) {
        return kPressure * a * a / (kYoungs * (b * b - a * a)) * ((1 - 2 * kPoisson) * r + (1 + kPoisson) * b * b / r);
      });
}

// Lame: thick walls, and thin ones, where it is Laplace's law. A coarse lattice is a little too stiff.
TEST(FilledCavity, WallsStretchAsLameSays_Long) {
  for (const auto& [spacing, most] : {std::pair(0.0035, 0.055), std::pair(0.0025, 0.03)}) {
    const Stretch thick = sphereStretch(0.015, 0.025, spacing), thin = sphereStretch(0.0225, 0.025, spacing),
                  tube = cylinderStretch(0.008, 0.014, spacing);
    for (const auto& [name, stretch] :
         {std::pair("sphere", thick), std::pair("thin sphere", thin), std::pair("tube", tube)}) {
      EXPECT_NEAR(stretch.inner, 1.0, most) << name << " with cells of " << spacing;
      EXPECT_NEAR(stretch.outer, 1.0, most) << name << " with cells of " << spacing;
    }
  }
}

BodyDef bladder(double wall = 0.006) {
  BodyDef def = ballOf(0.025, wall, 0.0035, 0.003);
  def.pose.translation = Vec3(0, 0, 0.0251);
  def.cavities.kind = CavityFill::Kind::kVolume;
  return def;
}

TEST(FilledCavity, AVolumeStaysWithinItsCompliance) {
  BodyDef empty = bladder(0.003);
  empty.cavities = CavityFill();
  World collapses = worldOf(empty, WorldSettings());
  run(collapses, 3.0);
  const double height = bodyOf(collapses).measures.centre_of_mass.z();
  for (const double compliance : {1e-12, 1e-10, 2e-9}) {
    BodyDef def = bladder(0.003);
    def.cavities.compliance = compliance;
    def.cavities.volume = 5e-5;
    World world = worldOf(def, WorldSettings());
    run(world, 3.0);
    const BodySnapshot body = bodyOf(world);
    ASSERT_EQ(body.measures.cavities.size(), 1u);
    const BodyMeasures::Cavity& cavity = body.measures.cavities[0];
    EXPECT_NEAR(cavity.volume, 5e-5 - compliance * cavity.pressure, 1e-3 * 5e-5);
    EXPECT_GT(cavity.pressure, 0.0);
    EXPECT_GT(body.measures.centre_of_mass.z(), 1.2 * height);
  }
}

// Without gravity no step may move or turn it as a whole.
TEST(FilledCavity, FillingMovesAndTurnsNothing) {
  for (const CavityFill::Kind kind : {CavityFill::Kind::kPressure, CavityFill::Kind::kVolume}) {
    BodyDef def = bladder();
    def.cavities.kind = kind;
    def.cavities.pressure = 300.0;
    // Not round, and not in its middle.
    def.mesh = hollow(boxMesh(Vec3(0.05, 0.04, 0.03), 0.004), sphereMesh(0.009, 0.003), Vec3(0.008, 0.005, -0.003));
    def.cavities.volume = 3.5e-6;
    World world = worldOf(def, test::weightless());
    run(world, 0.3);
    const BodyMeasures measures = bodyOf(world).measures;
    EXPECT_GT(measures.kinetic_energy, 0.0);
    const double scale = bodyOf(world).model->mass;
    EXPECT_LT(measures.linear_momentum.norm(), 1e-12 * scale);
    EXPECT_LT(measures.angular_momentum.norm(), 1e-13 * scale);
  }
}

CutReply cutAt(World& world, const Vec3& point, const Vec3& along, const Vec3& normal);

// Nor do the lids of what leaks.
TEST(FilledCavity, LeakingMovesAndTurnsNothing) {
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kNone;
  BodyDef def = bladder(0.004);
  def.cavities.volume = 4.5e-5;
  World world = worldOf(def, settings);
  run(world, 0.3);
  EXPECT_GT(bodyOf(world).measures.cavities.at(0).pressure, 50.0);
  const Vec3 normal = Vec3(0.3, 0.1, 1.0).normalized();
  const CutReply reply = cutAt(world, Vec3(0, 0, 0.03), normal.unitOrthogonal(), normal);
  ASSERT_EQ(reply.new_bodies.size(), 2u);
  std::vector<BodyMeasures> before;
  for (std::size_t n = 0; n < 2; ++n) before.push_back(bodyOf(world, n).measures);
  run(world, 0.4);
  for (std::size_t n = 0; n < 2; ++n) {
    const BodyMeasures after = bodyOf(world, n).measures;
    ASSERT_EQ(after.cavities.size(), 1u);
    EXPECT_NE(after.cavities[0].volume, before[n].cavities[0].volume);
    const double mass = bodyOf(world, n).model->mass;
    EXPECT_LT((after.linear_momentum - before[n].linear_momentum).norm(), 1e-11 * mass);
    EXPECT_LT((after.angular_momentum - before[n].angular_momentum).norm(), 1e-12 * mass);
  }
}

CutReply cutAt(World& world, const Vec3& point, const Vec3& along, const Vec3& normal) {
  CutCommand cut;
  cut.blades.origin = point - along;
  cut.blades.x_axis = along;
  cut.blades.y_axis = normal.cross(along);
  return replyOf<CutReply>(world.apply(cut));
}

std::vector<std::string> leaks(World& world) {
  std::vector<std::string> texts;
  for (const Event& event : world.takeEvents())
    if (event.type == EventType::kLeak) texts.push_back(event.text);
  return texts;
}

TEST(FilledCavity, ACutThroughItLetsItOut) {
  BodyDef def = bladder();
  def.cavities.volume = 3.5e-5;
  def.cavities.leak = 0.5;
  World world = worldOf(def, WorldSettings());
  run(world, 1.0);
  EXPECT_TRUE(leaks(world).empty());
  const double pressure = bodyOf(world).measures.cavities[0].pressure;
  EXPECT_GT(pressure, 0.0);
  const CutReply reply = cutAt(world, bodyOf(world).measures.centre_of_mass, Vec3::UnitX(), Vec3::UnitZ());
  ASSERT_EQ(reply.new_bodies.size(), 2u);
  EXPECT_EQ(leaks(world).size(), 2u);
  for (std::size_t n = 0; n < 2; ++n) {
    ASSERT_EQ(bodyOf(world, n).measures.cavities.size(), 1u);
    EXPECT_TRUE(bodyOf(world, n).measures.cavities[0].open);
    EXPECT_DOUBLE_EQ(bodyOf(world, n).measures.cavities[0].pressure, pressure);
  }
  run(world, 0.25);
  EXPECT_NEAR(bodyOf(world).measures.cavities.at(0).pressure, 0.5 * pressure, 0.02 * pressure);
  run(world, 0.3);
  EXPECT_EQ(leaks(world).size(), 2u);
  // It stays where clients look for it: open, without pressure, in pieces of pieces too.
  const auto leaked = [&](std::size_t n) {
    ASSERT_EQ(bodyOf(world, n).measures.cavities.size(), 1u);
    EXPECT_TRUE(bodyOf(world, n).measures.cavities[0].open);
    EXPECT_EQ(bodyOf(world, n).measures.cavities[0].pressure, 0.0);
  };
  for (std::size_t n = 0; n < 2; ++n) leaked(n);
  ASSERT_EQ(cutAt(world, bodyOf(world).measures.centre_of_mass, Vec3::UnitZ(), Vec3::UnitX()).new_bodies.size(), 4u);
  EXPECT_TRUE(leaks(world).empty());
  for (std::size_t n = 0; n < 4; ++n) leaked(n);
}

// Of the wall and the blade alone, with nothing of the outside.
TEST(FilledCavity, AFoldThatIsTakenOffEnclosesNothing) {
  TriangleMesh inner = sphereMesh(0.034, 0.005);
  for (Vec3& p : inner.vertices)  // 16 mm inwards
    p *= 1.0 - 0.47 * std::exp(-std::pow(std::acos(std::min(1.0, p.x() / p.norm())) / 0.4, 2));
  BodyDef def = elastic(hollow(sphereMesh(0.04, 0.005), inner), 0.005, 2e4);
  def.cavities.volume = 1.62e-4;
  def.cavities.kind = CavityFill::Kind::kVolume;
  World world = worldOf(def, test::weightless());
  run(world, 0.5);
  const BodySnapshot whole = bodyOf(world);
  const CutReply reply = cutAt(world, whole.measures.centre_of_mass + Vec3(0.0235, 0, 0), Vec3::UnitY(), Vec3::UnitX());
  ASSERT_EQ(reply.new_bodies.size(), 3u);
  const BodySnapshot fold = bodyOf(world, 2);
  EXPECT_LT(fold.model->rest_volume, 1e-6);
  EXPECT_TRUE(fold.measures.cavities.empty());
  EXPECT_EQ(leaks(world).size(), 2u);  // of the others
  run(world, 0.5);
  const BodySnapshot later = bodyOf(world, 2);
  EXPECT_NEAR(later.measures.volume, later.model->rest_volume, 0.1 * later.model->rest_volume);
  EXPECT_LT((later.measures.centre_of_mass - fold.measures.centre_of_mass).norm(), 0.1);
}

TEST(FilledCavity, AnIncisionIntoItLetsItOut) {
  for (const double depth : {0.003, 0.012}) {
    World world = worldOf(bladder(), WorldSettings());
    run(world, 0.5);
    const BodySnapshot body = bodyOf(world);
    const Vec3 top =
        body.measures.centre_of_mass + Vec3(0, 0, boundsOf(body.surface).max.z() - body.measures.centre_of_mass.z());
    InciseCommand command;
    command.blade.origin = top + Vec3(-0.005, 0.0003, 0.001);
    command.blade.x_axis = Vec3::UnitX();
    command.blade.y_axis = Vec3::UnitZ();
    command.blade.length = 0.01;
    command.blade.depth = depth;
    const InciseReply reply = replyOf<InciseReply>(world.apply(command));
    EXPECT_EQ(reply.cut_bodies.size(), 1u);
    EXPECT_EQ(leaks(world).size(), depth > 0.006 ? 1u : 0u);
    EXPECT_EQ(bodyOf(world).measures.cavities.at(0).open, depth > 0.006);
    run(world, 1.2);
    ASSERT_EQ(bodyOf(world).measures.cavities.size(), 1u);
    EXPECT_EQ(bodyOf(world).measures.cavities[0].pressure > 0.0, depth < 0.006);
  }
}

TEST(FilledCavity, ACutBesideItKeepsIt) {
  BodyDef def = bladder();
  def.mesh = hollow(boxMesh(Vec3(0.08, 0.03, 0.03), 0.003), sphereMesh(0.009, 0.002), Vec3(-0.02, 0, 0));
  def.pose.translation.z() = 0.0151;
  World world = worldOf(def, WorldSettings());
  run(world, 0.5);
  const BodyMeasures::Cavity before = bodyOf(world).measures.cavities.at(0);
  const CutReply reply = cutAt(world, Vec3(0.011, 0, 0.01), Vec3::UnitY(), Vec3::UnitX());
  ASSERT_EQ(reply.new_bodies.size(), 2u);
  EXPECT_TRUE(leaks(world).empty());
  std::size_t holders = 0;
  for (std::size_t n = 0; n < 2; ++n)
    for (const BodyMeasures::Cavity& cavity : bodyOf(world, n).measures.cavities) {
      ++holders;
      EXPECT_FALSE(cavity.open);
      EXPECT_NEAR(cavity.volume, before.volume, 1e-9 * before.volume);
      EXPECT_DOUBLE_EQ(cavity.pressure, before.pressure);
    }
  EXPECT_EQ(holders, 1u);
  run(world, 0.5);
  EXPECT_EQ(bodyOf(world, 0).measures.cavities.size() + bodyOf(world, 1).measures.cavities.size(), 1u);
  // And back.
  replyOf<UndoCutReply>(world.apply(UndoCutCommand()));
  EXPECT_NEAR(bodyOf(world).measures.cavities.at(0).volume, before.volume, 1e-9 * before.volume);
}

TEST(FilledCavity, IsSavedToTheBit) {
  BodyDef def = bladder();
  def.cavities.volume = 3.5e-5;
  World world = worldOf(def, WorldSettings());
  run(world, 0.1);
  for (const bool cut : {false, true}) {
    if (cut) cutAt(world, bodyOf(world).measures.centre_of_mass, Vec3::UnitX(), Vec3::UnitZ());
    run(world, 0.2);
    const std::string bytes = encode(*world.capture());
    const Result<DecodedWorld> decoded = decode(bytes);
    ASSERT_TRUE(decoded.ok()) << decoded.error().detail;
    World other{WorldSettings()};
    other.restore(*decoded->world);
    EXPECT_EQ(other.stateHash(), world.stateHash());
    EXPECT_EQ(encode(*other.capture()), bytes);
    World ahead{WorldSettings()};
    ahead.restore(*decoded->world);
    run(ahead, 0.3);
    run(other, 0.3);
    EXPECT_EQ(ahead.stateHash(), other.stateHash());
    EXPECT_EQ(bodyOf(other).measures.cavities.size(), 1u);
    run(world, 0.0);
  }
}

TEST(FilledCavity, IsRefusedWhereItCannotBe) {
  const auto refusal = [](const BodyDef& def) {
    const Result<PreparedBody> body = prepareBody(def);
    return body ? std::string() : body.error().detail;
  };
  const double nan = std::nan("");
  const auto with = [](auto change) {
    BodyDef def = bladder();
    change(def.cavities);
    return def;
  };
  EXPECT_EQ(refusal(bladder()), "");
  for (const double wrong : {-1.0, nan, 1e9}) {
    EXPECT_NE(refusal(with([&](CavityFill& f) { f.pressure = wrong; })).find("pressure is"), std::string::npos);
    EXPECT_NE(refusal(with([&](CavityFill& f) { f.volume = wrong; })).find("volume is"), std::string::npos);
    EXPECT_NE(refusal(with([&](CavityFill& f) { f.compliance = wrong; })).find("compliance is"), std::string::npos);
    EXPECT_NE(refusal(with([&](CavityFill& f) { f.leak = wrong; })).find("leak is"), std::string::npos);
  }
  EXPECT_NE(refusal(with([](CavityFill& f) { f.leak = 0.0; })).find("leak is"), std::string::npos);
  EXPECT_NE(refusal(with([](CavityFill& f) { f.volume = 1e-3; })).find("ml at rest"), std::string::npos);
  BodyDef solid = bladder();
  solid.mesh = sphereMesh(0.025, 0.004);
  EXPECT_NE(refusal(solid).find("it has none"), std::string::npos);
  BodyDef looks = bladder();
  looks.material.youngs_modulus = 0.0;
  EXPECT_EQ(refusal(looks), "");
  solid.solid = false;
  EXPECT_NE(refusal(solid).find("it has none"), std::string::npos);
}

TEST(FilledCavity, AnEmptyOneIsSaidAndCostsNothing) {
  BodyDef def = bladder();
  def.cavities = CavityFill();
  const PreparedBody body = test::prepared(def);
  ASSERT_EQ(body.def.notes.size(), 1u);
  EXPECT_NE(body.def.notes[0].find("1 cavity of"), std::string::npos) << body.def.notes[0];
  EXPECT_NE(body.def.notes[0].find("empty"), std::string::npos);
  EXPECT_EQ(body.model->cavities, nullptr);
  EXPECT_TRUE(body.state.cavities.empty());
  for (const std::uint32_t patch : body.model->surface.patches) EXPECT_EQ(patch, kOuterPatch);
}

}  // namespace cavity_world_test
}  // namespace meshless
