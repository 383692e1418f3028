// Tissue with fibres, in the world at its defaults, held against the theory of transversely isotropic bodies.
#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/lattice/fibre_directions.h"
#include "meshless_surgery/world/world.h"
#include "support/bodies.h"
#include "support/random.h"

namespace meshless {
namespace fibres_world_test {

constexpr double kYoungs = 1e4, kPoisson = 0.4, kFibres = 4e4, kDrawn = 0.01;
const Vec3 kSize(0.2, 0.03, 0.03);  // [m]

void run(World& world, double seconds) {
  for (int step = 0; step < std::lround(seconds * world.settings().step_rate); ++step) world.step();
}

HeldRegion heldBox(const Vec3& low, const Vec3& high) {
  HeldRegion held(low, high);
  held.in_world = false;
  return held;
}

BodyDef strip(const Vec3& direction, double longer = 1.0) {
  BodyDef def = test::defOf(boxMesh(Vec3(longer * kSize.x(), kSize.y(), kSize.z()), 0.015), "strip");
  def.material.youngs_modulus = kYoungs;
  def.material.poissons_ratio = kPoisson;
  def.material.damping = 30.0;
  def.material.fibres.stiffness = kFibres;
  def.fibre_direction = direction;
  def.spacing = 0.0075;
  def.fixed = {heldBox(Vec3(-1, -1, -1), Vec3(-longer * 0.08, 1, 1)),
               heldBox(Vec3(longer * 0.08, -1, -1), Vec3(1, 1, 1))};
  return def;
}

/// [Pa] Its force over its section and the strain in its middle, once its end was drawn out by a share of its length.
double modulus(BodyDef def, double drawn) {
  World world{test::weightless()};
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  MoveClampCommand pull;
  pull.body = def.name;
  pull.clamp = 1;
  pull.shift = Vec3(drawn * 0.16, 0.0, 0.0);
  pull.time = 0.5;
  EXPECT_TRUE(world.apply(pull).ok());
  run(world, 3.0);
  const Result<BodyLoad> load = world.load(def.name, {});
  EXPECT_TRUE(load.ok());
  if (!load.ok()) return 0.0;
  double strain = 0.0, count = 0.0;
  for (const CellLoad& cell : load->cells)
    if (std::abs(cell.place.x()) < 0.02) strain += cell.gradient(0, 0) - 1.0, count += 1.0;
  return load->clamps[1].force.x() / (kSize.y() * kSize.z()) / (strain / count);
}

/// [Pa] Young's modulus along x, by the stiffness of the matrix and of what lies along a.
double theory(const Vec3& a) {
  const ElasticParameters p = elasticParameters(kYoungs, kPoisson, 1000.0);
  using Tensor = Eigen::Matrix<double, 6, 6>;
  using Strain = Eigen::Matrix<double, 6, 1>;
  Tensor c = Tensor::Zero();
  c.topLeftCorner<3, 3>().setConstant(p.lambda);
  for (int k = 0; k < 3; ++k) c(k, k) += 2.0 * p.mu, c(k + 3, k + 3) = p.mu;
  Strain along;  // strain along a, of xx yy zz yz zx xy with shear angles
  along << a.x() * a.x(), a.y() * a.y(), a.z() * a.z(), a.y() * a.z(), a.z() * a.x(), a.x() * a.y();
  c += kFibres * along * along.transpose();
  return 1.0 / c.inverse()(0, 0);
}

TEST(FibresWorld, AStripAlongAndAcrossHasTheModulusOfTheory) {
  EXPECT_NEAR(theory(Vec3::UnitX()), kYoungs + kFibres, 1e-6 * kFibres);
  EXPECT_NEAR(modulus(strip(Vec3::UnitX()), kDrawn), theory(Vec3::UnitX()), 0.02 * theory(Vec3::UnitX()));
  // Across they are pressed by Poisson's ratio, and do not push: the matrix alone.
  EXPECT_NEAR(modulus(strip(Vec3::UnitY()), kDrawn), kYoungs, 0.02 * kYoungs);
  const Vec3 askew = Vec3(1.0, 0.0, std::tan(0.35)).normalized();
  // What is askew bends between its clamps, and a longer strip less.
  EXPECT_NEAR(modulus(strip(askew, 2.5), 2.5 * kDrawn), theory(askew), 0.02 * theory(askew));
}

TEST(FibresWorld, AStripThatIsPressedFeelsNone) {
  EXPECT_NEAR(modulus(strip(Vec3::UnitX()), -kDrawn), kYoungs, 0.02 * kYoungs);
}

// A piece that is cut off pulls as before, and a material without fibres has none.
TEST(FibresWorld, PiecesKeepThemAndMaterialsTakeThemAway) {
  World world{test::weightless()};
  BodyDef def = strip(Vec3::Zero());
  def.fixed.clear();
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  CutCommand cut;
  cut.blades.origin = Vec3(0.013, 0, 0);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3(0.3, 0, 1).normalized();
  ASSERT_TRUE(world.apply(cut).ok());
  const WorldSnapshot shot = world.snapshot({});
  ASSERT_EQ(shot.bodies.size(), 2u);
  for (const BodySnapshot& body : shot.bodies) {
    ASSERT_EQ(body.model->fibres.size(), body.model->lattice->cells.size());
    for (const Vec3& a : body.model->fibres) EXPECT_GT(std::abs((body.model->own.rotation * a).x()), 0.99);
    for (const ElasticCell& cell : body.model->cells->cells) EXPECT_NEAR(cell.fibre.norm(), 1.0, 1e-9);
  }
  SetMaterialCommand without;
  without.change = [](Material material) -> Result<Material> {
    material.fibres = Fibres();
    return material;
  };
  ASSERT_TRUE(world.apply(without).ok());
  for (const BodySnapshot& body : world.snapshot({}).bodies)
    for (const ElasticCell& cell : body.model->cells->cells) EXPECT_TRUE(cell.fibre.isZero());
}

// An arm that is bent by a right angle has them along it all the way.
TEST(FibresWorld, AlongABentBodyTheyFollowItsBend) {
  TriangleMesh arm = boxMesh(Vec3(0.3, 0.03, 0.03), 0.01);
  const double radius = 0.3 / 1.5708;
  const auto angle = [&](const Vec3& p) { return p.x() / radius; };
  for (Vec3& p : arm.vertices) {
    const double at = angle(p), out = radius + p.y();
    p = Vec3(out * std::sin(at), out * std::cos(at), p.z());
  }
  BodyDef def = test::defOf(arm, "arm");
  def.material.youngs_modulus = kYoungs;
  def.material.fibres.stiffness = kFibres;
  def.spacing = 0.0075;
  const PreparedBody body = test::prepared(def);
  const CellLattice& lattice = *body.model->lattice;
  ASSERT_EQ(body.model->fibres.size(), lattice.cells.size());
  double worst = 0.0, mean = 0.0;
  for (std::size_t c = 0; c < lattice.cells.size(); ++c) {
    const Vec3 place = body.model->own * lattice.restPlace(lattice.cells[c], Vec3::Constant(0.5));
    const Vec3 tangent = Vec3(place.y(), -place.x(), 0.0).normalized();
    const double off =
        std::acos(std::min(1.0, std::abs(tangent.dot(body.model->own.rotation * body.model->fibres[c]))));
    worst = std::max(worst, off), mean += off / static_cast<double>(lattice.cells.size());
  }
  EXPECT_LT(mean, 0.1);  // [rad]
  EXPECT_LT(worst, 0.8);
}

TEST(FibresWorld, AreRefusedWhereThereIsNoInside) {
  BodyDef def = strip(Vec3::UnitX());
  def.solid = false;
  def.fixed.clear();
  const Result<PreparedBody> sheet = prepareBody(def);
  ASSERT_FALSE(sheet.ok());
  EXPECT_NE(sheet.error().detail.find("fibres"), std::string::npos);
  def = strip(Vec3(1.0, 1.0, 0.0));
  ASSERT_FALSE(prepareBody(def).ok());
}

}  // namespace fibres_world_test
}  // namespace meshless
