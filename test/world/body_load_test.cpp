// What a body bears, held against theory: in the world at its defaults, but where it says so.
#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"
#include "support/random.h"

namespace meshless {
namespace body_load_test {

constexpr double kYoungs = 2e4, kDensity = 1000.0;  // [Pa], [kg/m^3]
const Vec3 kSize(0.2, 0.05, 0.04);                  // [m]

BodyDef bar() {
  BodyDef def = test::defOf(boxMesh(kSize, 0.01), "bar");
  def.pose.translation = Vec3(0.0, 0.0, 0.5);
  def.material.youngs_modulus = kYoungs;
  def.material.poissons_ratio = 0.3;
  def.material.density = kDensity;
  def.material.damping = 10.0;
  return def;
}

HeldRegion heldBox(const Vec3& low, const Vec3& high) {
  HeldRegion held(low, high);
  held.in_world = false;
  return held;
}

World rested(const BodyDef& def, WorldSettings settings = {}, double seconds = 6.0) {
  World world{settings};
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  for (int step = 0; step < seconds * settings.step_rate; ++step) world.step();
  return world;
}

BodyLoad loadOf(World& world, const std::string& name = "bar", const Points& points = {}) {
  const Result<BodyLoad> load = world.load(name, points);
  EXPECT_TRUE(load.ok()) << (load.ok() ? "" : load.error().detail);
  return load.ok() ? *load : BodyLoad();
}

TEST(BodyLoad, AClampBearsTheWeightOfWhatHangsOnItAndItsMoment) {
  for (const double turn : {0.0, 0.7}) {
    BodyDef def = bar();
    def.pose.rotation = Quat(Eigen::AngleAxisd(turn, Vec3(0.2, 0.1, 1.0).normalized()));
    def.fixed = {heldBox(Vec3(-1, -1, -1), Vec3(-0.06, 1, 1))};
    WorldSettings settings;
    settings.gravity = Vec3(0.0, 0.0, -1.0);
    World world = rested(def, settings);
    const BodyLoad load = loadOf(world);
    ASSERT_EQ(load.clamps.size(), 1u);
    const double weight = kDensity * 0.16 * kSize.y() * kSize.z();
    EXPECT_NEAR(load.clamps[0].force.z(), weight, 0.005 * weight);
    EXPECT_LT(load.clamps[0].force.head<2>().norm(), 0.005 * weight);
    // About the middle of the free part, where its weight is, there is no torque of both.
    const BodySnapshot body = world.inspect("bar", false).ok() ? *world.inspect("bar", false) : BodySnapshot();
    Vec3 centre = Vec3::Zero();
    double mass = 0.0;
    for (std::size_t i = 0; i < body.particles.size(); ++i)
      if (!body.model->fixed[i]) {
        centre += body.model->masses[i] * body.particles[i];
        mass += body.model->masses[i];
      }
    centre /= mass;
    const Vec3 torque = load.clamps[0].torque - centre.cross(load.clamps[0].force);
    EXPECT_LT(torque.norm(), 0.02 * weight * 0.08);
  }
}

TEST(BodyLoad, TwoClampsShareTheWeight) {
  BodyDef def = bar();
  def.fixed = {heldBox(Vec3(-1, -1, -1), Vec3(-0.08, 1, 1)), heldBox(Vec3(0.08, -1, -1), Vec3(1, 1, 1))};
  World world = rested(def);
  const BodyLoad load = loadOf(world);
  ASSERT_EQ(load.clamps.size(), 2u);
  const double half = 0.5 * 9.81 * kDensity * 0.16 * kSize.y() * kSize.z();
  for (const Wrench& clamp : load.clamps) EXPECT_NEAR(clamp.force.z(), half, 0.01 * half);
  EXPECT_NEAR(load.clamps[0].force.x(), -load.clamps[1].force.x(), 0.01 * half);
  EXPECT_LT(load.clamps[0].force.x(), 0.0) << "a bar that sags is drawn outwards";
}

// A bar that hangs: at a height z above its end the stress is that of the weight below.
TEST(BodyLoad, StressIsTheWeightBelowOverTheSection) {
  BodyDef def = bar();
  def.pose.rotation = Quat(Eigen::AngleAxisd(M_PI_2, Vec3::UnitY()));  // its x down
  def.fixed = {heldBox(Vec3(-1, -1, -1), Vec3(-0.08, 1, 1))};
  World world = rested(def);
  const BodyLoad all = loadOf(world);
  double low = 1e300;
  const WorldSnapshot shot = world.snapshot({true, false, false});
  for (const Vec3& p : shot.bodies[0].surface) low = std::min(low, p.z());
  for (const double from_end : {0.03, 0.08, 0.13}) {
    const BodyLoad load = loadOf(world, "bar", {Vec3(0.0, 0.0, low + from_end)});
    ASSERT_EQ(load.cells.size(), 1u);
    const CellLoad& cell = load.cells[0];
    // By the length at rest, which gravity has stretched by a few per cent.
    const double stretch = cell.gradient(2, 2);
    const double expected = kDensity * 9.81 * (cell.place.z() - low);
    EXPECT_NEAR(cell.stress(2, 2), expected, 0.04 * expected);
    EXPECT_LT(std::abs(cell.stress(0, 0)), 0.03 * expected);
    EXPECT_LT(std::abs(cell.stress(0, 2)), 0.02 * expected);
    EXPECT_NEAR(stretch, 1.0 + expected / kYoungs, 0.01);
    EXPECT_NEAR(cell.gradient(0, 0), 1.0 - 0.3 * expected / kYoungs, 0.01);
  }
  // (rho g)^2 A L^3 / (6 E) of linear theory.
  const double area = kSize.y() * kSize.z();
  const double energy = std::pow(kDensity * 9.81, 2.0) * area * std::pow(0.18, 3.0) / (6.0 * kYoungs);
  EXPECT_NEAR(all.elastic_energy, energy, 0.06 * energy);
}

// The deformation is in the world's axes, wherever the body was put and however its lattice lies.
TEST(BodyLoad, ABodyThatTurnsIsAtEaseAndSaysHowItLies) {
  BodyDef def = bar();
  def.pose.rotation = Quat(Eigen::AngleAxisd(0.4, Vec3(1.0, 2.0, -1.0).normalized()));
  World world{test::weightless()};
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  world.step();
  const BodyLoad load = loadOf(world);
  EXPECT_TRUE(load.clamps.empty());
  EXPECT_LT(load.elastic_energy, 1e-12);
  for (const CellLoad& cell : load.cells) {
    EXPECT_LT((cell.gradient - Mat3::Identity()).norm(), 1e-9);
    EXPECT_LT(cell.stress.norm(), 1e-6 * kYoungs);
  }
}

// Whatever the organ is and however it is held: at rest its clamps bear its weight.
TEST(BodyLoad, ClampsOfAnyOrganBearItsWeight) {
  for (unsigned seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE(seed);
    test::Random random(seed);
    const double size = random.uniform(0.06, 0.2);
    BodyDef def = test::defOf(*randomOrgan(seed, 0, size, 1500), "organ");
    def.pose.translation = Vec3(0.3, -0.2, 1.0);
    def.pose.rotation = random.rotation();
    def.material.youngs_modulus = 20.0 * 1000.0 * 9.81 * size;
    def.material.poissons_ratio = random.uniform(0.0, 0.45);
    def.material.asymmetry = seed % 2 == 0 ? 10.0 : 0.0;
    def.material.damping = 20.0;
    const double x = boundsOf(def.mesh.vertices).min.x() + 0.25 * size;
    def.fixed = {heldBox(Vec3(-9, -9, -9), Vec3(x, 9, 9))};
    World world = rested(def);
    const BodyLoad load = loadOf(world, "organ");
    ASSERT_EQ(load.clamps.size(), 1u);
    const BodyModelPtr model = world.snapshot({}).bodies[0].model;
    double weight = 0.0;
    for (std::size_t i = 0; i < model->masses.size(); ++i)
      if (!model->fixed[i]) weight += 9.81 * model->masses[i];
    EXPECT_NEAR(load.clamps[0].force.z(), weight, 0.01 * weight);
    EXPECT_LT(load.clamps[0].force.head<2>().norm(), 0.01 * weight);
  }
}

// One that gets too few substeps bears as much.
TEST(BodyLoad, AClampOfABodyThatIsSlowedBearsItsWeight) {
  BodyDef def = bar();
  def.material.asymmetry = 10.0;
  def.fixed = {heldBox(Vec3(-1, -1, -1), Vec3(-0.06, 1, 1))};
  WorldSettings settings;
  settings.gravity = Vec3(0.0, 0.0, -1.0);
  settings.max_substeps = 2;
  settings.sleep = false;
  World world = rested(def, settings, 30.0);
  ASSERT_LT(world.snapshot({}).bodies[0].stiffness_factor, 0.5);
  const double weight = kDensity * 0.16 * kSize.y() * kSize.z();
  EXPECT_NEAR(loadOf(world).clamps[0].force.z(), weight, 0.01 * weight);
}

TEST(BodyLoad, PiecesKeepTheirClampAndItsNumber) {
  BodyDef def = bar();
  def.fixed = {heldBox(Vec3(-1, -1, -1), Vec3(-0.08, 1, 1)), heldBox(Vec3(0.08, -1, -1), Vec3(1, 1, 1))};
  World world = rested(def, {}, 0.1);
  CutCommand cut;
  cut.blades.origin = Vec3(0.0, 0.0, 0.5);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3::UnitZ();
  ASSERT_TRUE(world.apply(cut).ok());
  for (int step = 0; step < 700; ++step) world.step();
  const double half = 0.5 * 9.81 * kDensity * 0.16 * kSize.y() * kSize.z();
  for (const BodySnapshot& body : world.snapshot({false, false, true}).bodies) {
    const BodyLoad load = loadOf(world, body.name);
    const bool right = body.measures.centre_of_mass.x() > 0.0;
    ASSERT_EQ(load.clamps.size(), right ? 2u : 1u);
    EXPECT_NEAR(load.clamps[right].force.z(), half, 0.02 * half);
    if (right) EXPECT_EQ(load.clamps[0].force.norm(), 0.0);
  }
}

TEST(BodyLoad, RefusesWhatHasNoStress) {
  World world{WorldSettings()};
  BodyDef looks = test::ball("looks");
  ASSERT_TRUE(world.addSceneBody(test::shared(looks)).ok());
  BodyDef def = bar();
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  const std::uint64_t before = world.stateHash();
  EXPECT_EQ(world.load("nobody", {}).error().code, ErrorCode::kUnknownName);
  EXPECT_EQ(world.load("looks", {}).error().code, ErrorCode::kUnsupported);
  EXPECT_EQ(world.load("bar", {Vec3(0.0, 0.0, 0.9)}).error().code, ErrorCode::kMissed);
  EXPECT_EQ(world.load("bar", {Vec3(0.0, 0.0, std::nan(""))}).error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(world.stateHash(), before);
}

}  // namespace body_load_test
}  // namespace meshless
