// Tissue that is under tension at rest, in the world at its defaults.
#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/world/saved_world.h"
#include "meshless_surgery/world/world.h"
#include "support/bodies.h"

namespace meshless {
namespace prestretch_test {

constexpr double kYoungs = 1e4, kPoisson = 0.4, kStretch = 1.2;
const Vec3 kSize(0.12, 0.02, 0.02);  // [m]

void run(World& world, double seconds) {
  for (int step = 0; step < std::lround(seconds * world.settings().step_rate); ++step) world.step();
}

BodyDef bar(double stretch, const Quat& turn = Quat::Identity()) {
  BodyDef def = test::defOf(boxMesh(kSize, 0.01), "bar");
  def.pose = {turn, Vec3(0, 0, 0.5)};
  def.material.youngs_modulus = kYoungs;
  def.material.poissons_ratio = kPoisson;
  def.material.damping = 20.0;
  def.spacing = 0.005;
  def.prestretch = Vec3(stretch, 1.0 / std::sqrt(stretch), 1.0 / std::sqrt(stretch));
  return def;
}

HeldRegion heldBox(const Vec3& low, const Vec3& high) {
  HeldRegion held(low, high);
  held.in_world = false;
  return held;
}

World heldAtBothEnds(double stretch, const Quat& turn = Quat::Identity()) {
  BodyDef def = bar(stretch, turn);
  def.fixed = {heldBox(Vec3(-1, -1, -1), Vec3(-0.05, 1, 1)), heldBox(Vec3(0.05, -1, -1), Vec3(1, 1, 1))};
  World world{test::weightless()};
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  return world;
}

/// [Pa] over the section without stress, of a bar that is drawn out and free at its sides.
double uniaxialStress(double stretch) {
  const ElasticParameters p = elasticParameters(kYoungs, kPoisson, 1000.0);
  double low = 0.5, high = 1.5;  // the sides' stretch, where they bear nothing
  for (int k = 0; k < 60; ++k) {
    const double t = 0.5 * (low + high),
                 side = 2.0 * p.mu * (t - 1.0) + p.lambda * (stretch * t * t - 1.0) * stretch * t;
    (side > 0.0 ? high : low) = t;
  }
  return 2.0 * p.mu * (stretch - 1.0) + p.lambda * (stretch * low * low - 1.0) * low * low;
}

double pullOf(World& world, const Vec3& along = Vec3::UnitX()) {
  const Result<BodyLoad> load = world.load("bar", {});
  EXPECT_TRUE(load.ok() && load->clamps.size() == 2);
  if (!load.ok() || load->clamps.size() != 2) return 0.0;
  EXPECT_LT((load->clamps[0].force + load->clamps[1].force).norm(), 0.01 * load->clamps[1].force.norm() + 1e-9);
  return load->clamps[1].force.dot(along);
}

double lengthOf(const BodySnapshot& body, const Vec3& axis = Vec3::UnitX()) {
  double low = 1e9, high = -1e9;
  for (const Vec3& p : body.surface) low = std::min(low, p.dot(axis)), high = std::max(high, p.dot(axis));
  return high - low;
}

void cutInTheMiddle(World& world) {
  CutCommand cut;
  cut.blades.origin = Vec3(0, 0, 0.5);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3::UnitZ();
  EXPECT_TRUE(world.apply(cut).ok());
}

// As hard as a bar of its shape without stress that was drawn out to its length, however it lies in the world.
TEST(Prestretch, ABarThatIsHeldPullsAtItsEndsAsTheLawSays) {
  const double narrow = kSize.y() * kSize.z() * kStretch;  // [m^2] its section without stress
  for (const Quat& turn : {Quat::Identity(), Quat(Eigen::AngleAxisd(1.0, Vec3(1, 2, 3).normalized()))}) {
    World world = heldAtBothEnds(kStretch, turn);
    run(world, 3.0);
    EXPECT_NEAR(pullOf(world, turn * Vec3::UnitX()), uniaxialStress(kStretch) * narrow,
                0.02 * uniaxialStress(kStretch) * narrow);
    world.reset();
    run(world, 3.0);
    EXPECT_NEAR(pullOf(world, turn * Vec3::UnitX()), uniaxialStress(kStretch) * narrow,
                0.02 * uniaxialStress(kStretch) * narrow);
  }
  World slack = heldAtBothEnds(1.0);
  run(slack, 1.0);
  EXPECT_LT(std::abs(pullOf(slack)), 1e-9);
}

TEST(Prestretch, WhatIsHeldByNothingTakesItsShapeWithoutStress) {
  for (const double stretch : {0.7, 1.2, 1.9}) {
    World world{test::weightless()};
    ASSERT_TRUE(world.addSceneBody(test::shared(bar(stretch))).ok());
    run(world, 4.0);
    const WorldSnapshot shot = world.snapshot({true, false, true});
    EXPECT_NEAR(lengthOf(shot.bodies[0]), kSize.x() / stretch, 0.01 * kSize.x());
    EXPECT_NEAR(lengthOf(shot.bodies[0], Vec3::UnitZ()), kSize.z() * std::sqrt(stretch), 0.02 * kSize.z());
    EXPECT_NEAR(shot.bodies[0].measures.volume, kSize.prod(), 0.01 * kSize.prod());
  }
}

// A vessel or a muscle that is cut through draws back.
TEST(Prestretch, BothEndsOfACutDrawBack) {
  World world = heldAtBothEnds(kStretch);
  run(world, 1.0);
  cutInTheMiddle(world);
  run(world, 4.0);
  double gap = kSize.x();
  for (const BodySnapshot& body : world.snapshot({true, false, true}).bodies) gap -= lengthOf(body);
  const double free = 0.1 * (1.0 - 1.0 / kStretch);
  EXPECT_NEAR(gap, free, 0.05 * free);
  // Undone, it pulls as before.
  const double pull = uniaxialStress(kStretch) * kSize.y() * kSize.z() * kStretch;
  ASSERT_TRUE(world.apply(UndoCutCommand{}).ok());
  run(world, 3.0);
  EXPECT_NEAR(pullOf(world), pull, 0.02 * pull);
}

/// [m] How far the lips of a wound of 4 cm part in its middle: skin, held around, drawn out along x.
double gape(bool across) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.12, 0.12, 0.006), 0.006), "skin");
  def.pose.translation.z() = 0.1;
  def.material.youngs_modulus = 5e4;
  def.material.poissons_ratio = 0.4;
  def.material.damping = 20.0;
  def.spacing = 0.006;
  def.prestretch = Vec3(1.2, 1.0 / std::sqrt(1.2), 1.0 / std::sqrt(1.2));
  for (const double side : {-1.0, 1.0}) {
    const Vec3 x(0.055, 1, 1), y(1, 0.055, 1);
    def.fixed.push_back(side < 0.0 ? heldBox(-Vec3::Ones(), Vec3(-x.x(), 1, 1))
                                   : heldBox(Vec3(x.x(), -1, -1), Vec3::Ones()));
    def.fixed.push_back(side < 0.0 ? heldBox(-Vec3::Ones(), Vec3(1, -y.y(), 1))
                                   : heldBox(Vec3(-1, y.y(), -1), Vec3::Ones()));
  }
  World world{test::weightless()};
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  InciseCommand incise;
  const Vec3 along = across ? Vec3::UnitY() : Vec3::UnitX(), apart = across ? Vec3::UnitX() : Vec3::UnitY();
  incise.blade.x_axis = along;
  incise.blade.y_axis = Vec3::UnitZ();
  incise.blade.length = 0.04;
  incise.blade.depth = 0.02;
  incise.blade.origin = Vec3(0, 0, 0.11) - 0.02 * along;
  EXPECT_TRUE(world.apply(incise).ok());
  run(world, 3.0);
  double low = 0.0, high = 0.0;
  const WorldSnapshot shot = world.snapshot({true, false, true});
  const TriangleMesh& mesh = shot.bodies[0].model->surface;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (mesh.patches[t] != kOuterPatch)
      for (const Index v : mesh.triangles[t])
        if (std::abs(mesh.vertices[v].dot(along)) < 0.005) {
          low = std::min(low, shot.bodies[0].surface[v].dot(apart));
          high = std::max(high, shot.bodies[0].surface[v].dot(apart));
        }
  return high - low;
}

// Langer's lines: a wound across the tension gapes, one along it stays nearly closed.
TEST(Prestretch, AWoundAcrossTheTensionGapes) {
  const double across = gape(true), along = gape(false);
  EXPECT_GT(across, 0.003);
  EXPECT_LT(along, 0.25 * across);
}

TEST(Prestretch, IsSavedWithTheBody) {
  World world = heldAtBothEnds(kStretch);
  run(world, 0.5);
  const Result<DecodedWorld> saved = decode(encode(*world.capture()));
  ASSERT_TRUE(saved.ok());
  World again{test::weightless()};
  again.restore(*saved->world);
  run(world, 0.5);
  run(again, 0.5);
  EXPECT_EQ(again.stateHash(), world.stateHash());
  EXPECT_GT(pullOf(again), 0.5);
  again.reset();
  run(again, 3.0);
  EXPECT_GT(pullOf(again), 0.5);
}

TEST(Prestretch, IsRefusedWhereNothingWouldPull) {
  BodyDef looks = bar(kStretch);
  looks.material.youngs_modulus = 0.0;
  BodyDef flows = bar(kStretch);
  flows.material.plasticity.creep = 1.0;
  BodyDef grows = bar(kStretch);
  grows.prestretch = Vec3::Constant(1.1);
  for (const BodyDef& def : {looks, flows, grows}) {
    const Result<PreparedBody> body = prepareBody(def);
    ASSERT_FALSE(body.ok());
    EXPECT_NE(body.error().detail.find("prestretch"), std::string::npos);
  }
}

}  // namespace prestretch_test
}  // namespace meshless
