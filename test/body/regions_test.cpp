// Bodies with regions of another material: each weighs and resists as what it is made of, whole and in pieces.
#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/geometry/lattice/cell_regions.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/bodies.h"

namespace meshless {
namespace regions_test {

Material tissue(const std::string& name, double youngs_modulus, double poissons_ratio, double density) {
  Material material;
  material.name = name;
  material.youngs_modulus = youngs_modulus;
  material.poissons_ratio = poissons_ratio;
  material.density = density;
  return material;
}

const Material kSoft = tissue("soft", 5e3, 0.3, 1000.0), kStiff = tissue("stiff", 25e3, 0.45, 1500.0);

// 0.2 x 0.1 x 0.1 m about the origin.
BodyDef block(const std::vector<TissueRegion>& regions) {
  BodyDef def = test::block("block", Vec3::Zero());
  def.spacing = 0.0125;
  def.material = kSoft;
  def.regions = regions;
  return def;
}

double massOf(const BodyModel& model) {
  double mass = 0.0;
  for (const double m : model.masses) mass += m;
  return mass;
}

// [J] under an affine map, whose energy in each cell is that of what fills it.
double energyOf(const BodyModel& model, const Material& own, const Mat3& map) {
  Points y;
  for (const Vec3& p : model.rest) y.push_back(map * p);
  return elasticEnergy(*model.cells, elasticParameters(own.youngs_modulus, own.poissons_ratio, own.density), y,
                       std::vector<ClusterPose>(model.cells->cells.size()));
}

// [J/m^3] of a stretch along the axes: mu |F - R|^2 + lambda/2 (J - 1)^2.
double densityOf(const Material& material, const Vec3& stretch) {
  const ElasticParameters p = elasticParameters(material.youngs_modulus, material.poissons_ratio, material.density);
  return p.mu * (stretch - Vec3::Ones()).squaredNorm() + 0.5 * p.lambda * std::pow(stretch.prod() - 1.0, 2.0);
}

const Vec3 kStretch(1.1, 0.97, 0.95);

TEST(Regions, WeighAndResistAsTheirMaterialWhereverTheyEndInACell) {
  for (const double end : {0.0, 0.0125, 0.003125, 0.00625, -0.040625}) {  // [m] on samples' borders
    const PreparedBody body = test::prepared(block({{Region(Vec3(end, -1, -1), Vec3(1, 1, 1)), kStiff}}));
    const double stiff = (0.1 - end) * 0.01, soft = (0.1 + end) * 0.01;
    const double mass = 1000.0 * soft + 1500.0 * stiff;
    EXPECT_NEAR(massOf(*body.model), mass, 1e-12 * mass) << end;
    EXPECT_NEAR(body.model->mass, mass, 1e-12 * mass) << end;
    const double moment = 1000.0 * soft * 0.5 * (end - 0.1) + 1500.0 * stiff * 0.5 * (end + 0.1);
    EXPECT_NEAR(measureBody(*body.model, body.state).centre_of_mass.x(), moment / mass, 0.001) << end;
    const double energy = densityOf(kSoft, kStretch) * soft + densityOf(kStiff, kStretch) * stiff;
    EXPECT_NEAR(energyOf(*body.model, kSoft, kStretch.asDiagonal()), energy, 1e-9 * energy) << end;
    EXPECT_NEAR(regionShares(*body.model).at(0), stiff / 0.002, 1e-12);
  }
}

TEST(Regions, TheLastOfSeveralHasWhatTheyShare) {
  const Material third = tissue("third", 1e3, 0.2, 800.0);
  const PreparedBody body = test::prepared(
      block({{Region(Vec3(0, -1, -1), Vec3(1, 1, 1)), kStiff}, {Region(Vec3(0.05, -1, -1), Vec3(1, 1, 1)), third}}));
  EXPECT_NEAR(body.model->mass, 1.0 + 0.75 + 0.4, 1e-9);
  const std::vector<double> shares = regionShares(*body.model);
  EXPECT_NEAR(shares.at(0), 0.25, 1e-12);
  EXPECT_NEAR(shares.at(1), 0.25, 1e-12);
}

TEST(Regions, AreInTheBodysFrameHoweverItIsPlaced) {
  const Region ball = Region::sphere(Vec3(0.05, 0.01, 0.02), 0.025);
  BodyDef def = block({{ball, kStiff}});
  const double upright = test::prepared(def).model->mass;
  EXPECT_NEAR(upright, 2.0 + 500.0 * 4.0 / 3.0 * M_PI * std::pow(0.025, 3.0), 0.002);
  def.pose.rotation = Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()));
  def.pose.translation = Vec3(1, -2, 0.5);
  const PreparedBody turned = test::prepared(def);
  EXPECT_NEAR(turned.model->mass, upright, 1e-9);
  EXPECT_LT((measureBody(*turned.model, turned.state).centre_of_mass - def.pose * Vec3(0.05, 0.01, 0.02)).norm(), 0.06);
  // By a closed mesh, the same.
  TriangleMesh mesh = sphereMesh(0.025, 0.002);
  for (Vec3& p : mesh.vertices) p += Vec3(0.05, 0.01, 0.02);
  def.regions[0].region = Region::within(mesh, "ball.obj");
  EXPECT_NEAR(test::prepared(def).model->mass, upright, 0.001);
}

TEST(Regions, StayTheirOwnThroughCuts) {
  const PreparedBody body = test::prepared(block({{Region::sphere(Vec3(0.03, 0, 0), 0.03), kStiff}}));
  const double energy = energyOf(*body.model, kSoft, kStretch.asDiagonal());
  const Result<CutBody> cut =
      cutBody(*body.model, body.state, Blade::through(Plane{Vec3(1.0, 0.3, -0.2).normalized(), Vec3(0.033, 0, 0)}));
  ASSERT_TRUE(cut.ok()) << cut.error().detail;
  ASSERT_EQ(cut->pieces.size(), 2u);
  double mass = 0.0, sum = 0.0, stiff = 0.0;
  bool coloured = false;
  for (const BodyPiece& piece : cut->pieces) {
    mass += massOf(*piece.model);
    sum += energyOf(*piece.model, kSoft, kStretch.asDiagonal());
    stiff += regionShares(*piece.model).at(0) * piece.model->rest_volume;
    EXPECT_GT(regionShares(*piece.model).at(0), 0.01);
    const std::vector<std::uint8_t> regions = surfaceRegions(*piece.model);
    ASSERT_EQ(regions.size(), piece.model->surface.vertices.size());
    for (Index v = 0; v < regions.size(); ++v) {
      const double depth = 0.03 - (piece.model->surface.vertices[v] - Vec3(0.03, 0, 0)).norm();
      if (std::abs(depth) > 0.004) EXPECT_EQ(regions[v], depth > 0.0 ? 1 : 0);
      coloured |= regions[v] == 1;
    }
  }
  EXPECT_TRUE(coloured);
  EXPECT_NEAR(mass, body.model->mass, 1e-12 * mass);
  EXPECT_NEAR(sum, energy, 4e-14 * energy);  // 7.6e-15
  EXPECT_NEAR(stiff, 4.0 / 3.0 * M_PI * std::pow(0.03, 3.0), 3e-6);
}

TEST(Regions, KeepTheirMaterialWhereTheBodyGetsAnother) {
  const PreparedBody body = test::prepared(block({{Region(Vec3(0, -1, -1), Vec3(1, 1, 1)), kStiff}}));
  const Material other = tissue("other", 2e3, 0.0, 500.0);
  const BodyModelPtr changed = withMaterial(body.model, kSoft, other);
  EXPECT_NEAR(massOf(*changed), 0.5 + 1.5, 1e-9);
  EXPECT_NEAR(changed->mass, 0.5 + 1.5, 1e-9);
  const double energy = (densityOf(other, kStretch) + densityOf(kStiff, kStretch)) * 0.001;
  EXPECT_NEAR(energyOf(*changed, other, kStretch.asDiagonal()), energy, 1e-9 * energy);
  const BodyModelPtr back = withMaterial(changed, other, kSoft);
  for (std::size_t i = 0; i < body.model->masses.size(); ++i)
    EXPECT_NEAR(back->masses[i], body.model->masses[i], 1e-12 * body.model->masses[i]);
}

TEST(Regions, AnAppearanceMaterialIsRefusedForABodyThatHasSome) {
  World world(test::weightless());
  ASSERT_TRUE(world.addSceneBody(test::shared(block({{Region::sphere(Vec3::Zero(), 0.03), kStiff}}))).ok());
  SetMaterialCommand command;
  command.change = [](const Material&) -> Result<Material> { return Material(); };
  const Result<Reply> refused = world.apply(command);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().detail.find("has regions"), std::string::npos) << refused.error().detail;
  EXPECT_NE(refused.error().detail.find("accepted: elastic"), std::string::npos) << refused.error().detail;
}

TEST(Regions, WhatCannotBeIsRefusedWithItsReason) {
  const auto reason = [](const BodyDef& def) {
    const Result<PreparedBody> body = prepareBody(def);
    return body.ok() ? std::string("prepared") : body.error().detail;
  };
  const auto says = [](const std::string& text, const std::string& words) {
    EXPECT_NE(text.find(words), std::string::npos) << text;
  };
  const Region ball = Region::sphere(Vec3::Zero(), 0.03);
  says(reason(block({{ball, kStiff}, {Region::sphere(Vec3(0, 0, 0.3), 0.03), kStiff}})),
       "regions[1], the sphere of radius 0.03 about 0 0 0.3, has no tissue");
  says(reason(block({{Region::sphere(Vec3::Zero(), 0.02), kStiff}, {ball, kStiff}})), "regions[0]");  // covered
  says(reason(block({{ball, Material()}})), "appearance material 'default'");
  says(reason(block({{ball, tissue("light", 1e3, 0.3, -1.0)}})), "regions[0]: density is -1");
  says(reason(block(std::vector<TissueRegion>(101, {ball, kStiff}))), "101 regions; accepted: up to 100");
  BodyDef looks = block({{ball, kStiff}});
  looks.material = Material();
  says(reason(looks), "accepted: those of a closed body of an elastic material");
}

// A bar that hangs, soft at its upper half: each half is drawn out as its own modulus says.
TEST(Regions, ABarOfTwoHalvesHangsAsLongAsItShould) {
  for (const double end : {0.0, 0.0047}) {  // on a layer of the lattice and not
    WorldSettings settings;
    settings.gravity = Vec3(0.5, 0, 0);
    settings.ground.reset();
    World world(settings);
    BodyDef def = block({{Region(Vec3(end, -1, -1), Vec3(1, 1, 1)), tissue("stiff", 25e3, 0.0, 1500.0)}});
    def.material = tissue("soft", 5e3, 0.0, 1000.0);
    def.material.damping = 20.0;
    def.fixed = {HeldRegion(Region::below(Plane{Vec3::UnitX(), Vec3(-0.1, 0, 0)}), true)};
    ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
    for (int i = 0; i < 300; ++i) world.step();
    const double upper = 0.1 + end, lower = 0.1 - end;
    const double expected =
        0.5 * ((1500.0 * lower * upper + 0.5 * 1000.0 * upper * upper) / 5e3 + 0.5 * 1500.0 * lower * lower / 25e3);
    double reach = -1.0;
    const WorldSnapshot shot = world.snapshot({true, true, true, true});
    for (const Vec3& p : shot.bodies.at(0).surface) reach = std::max(reach, p.x());
    EXPECT_NEAR(reach - 0.1, expected, 0.02 * expected) << end;
  }
}

}  // namespace regions_test
}  // namespace meshless
