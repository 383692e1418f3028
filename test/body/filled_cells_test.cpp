// Bodies of cells that know how far they are filled.
#include "meshless_surgery/body/filled_cells.h"

#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/organs.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "support/random.h"

namespace meshless {
namespace filled_cells_test {

using test::Random;

constexpr double kStep = 1.0 / 240.0;

BodyDef defOf(const TriangleMesh& mesh, double spacing, bool elastic = true) {
  BodyDef def;
  def.name = "body";
  def.mesh = mesh;
  def.spacing = spacing;
  def.clusters.kind = ClusterOptions::Kind::kCells;
  def.material.youngs_modulus = elastic ? 5e3 : 0.0;
  def.material.poissons_ratio = 0.4;
  return def;
}

// A box whose faces lie anywhere in the cells, a ball, and a ball of two materials.
std::vector<PreparedBody> bodies() {
  std::vector<PreparedBody> all;
  for (const bool elastic : {true, false}) {
    BodyDef box = defOf(boxMesh(Vec3(0.0725, 0.043, 0.0311), 0.005), 0.01, elastic);
    box.pose.rotation = Quat(Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()));
    all.push_back(prepareBody(box).value());
    all.push_back(prepareBody(defOf(sphereMesh(0.03, 0.005), 0.011, elastic)).value());
  }
  return all;
}

TEST(FilledCells, MassesAddUpToTheBodysAndEveryCornerHasSome) {
  for (const PreparedBody& body : bodies()) {
    const BodyModel& model = *body.model;
    ASSERT_TRUE(model.lattice);
    const double mass = body.def.material.density * model.rest_volume;
    EXPECT_NEAR(model.mass, mass, 1e-12 * mass);
    for (const double m : model.masses) EXPECT_GT(m, 1e-4 * model.cell_mass / 8.0);
    EXPECT_EQ(model.cells->cells.size(), model.lattice->cells.size());
    bool ghosts = false;
    for (Index i = 0; i < model.rest.size(); ++i) ghosts = ghosts || !model.isTissue(i);
    EXPECT_TRUE(ghosts);
  }
}

TEST(FilledCells, TheSurfaceIsWhereItWasAndFollowsEveryAffineMap) {
  Random random(1);
  for (PreparedBody& body : bodies()) {
    const double size = boundsOf(body.model->rest).diagonal();
    for (std::size_t v = 0; v < body.state.surface.size(); ++v)
      EXPECT_LT((body.state.surface[v] - body.state.placed * body.model->surface.vertices[v]).norm(), 1e-13 * size);
    const Mat3 map = Mat3::Identity() + random.matrix(0.3);
    const Vec3 shift = random.vector(0.1);
    body.state.positions = body.model->rest;
    for (Vec3& p : body.state.positions) p = map * p + shift;
    updateSurface(*body.model, body.state);
    for (std::size_t v = 0; v < body.state.surface.size(); ++v)
      EXPECT_LT((body.state.surface[v] - map * body.model->surface.vertices[v] - shift).norm(), 1e-12 * size);
  }
}

TEST(FilledCells, AFreeBodyKeepsItsMomentum) {
  Random random(3);
  for (PreparedBody& body : bodies()) {
    for (Vec3& v : body.state.velocities) v = Vec3(0.1, 0.2, -0.1) + random.vector(0.05);
    const BodyMeasures before = measureBody(*body.model, body.state);
    StepScratch scratch;
    MatchCounters counters;
    const double h = body.model->cells ? 0.5 / body.model->highest_frequency : kStep;
    for (int n = 0; n < 100; ++n)
      matchAndMove(*body.model, body.def.material, Vec3::Zero(), h, body.state, scratch, counters);
    const BodyMeasures after = measureBody(*body.model, body.state);
    double scale = 0.0, extent = boundsOf(body.model->rest).diagonal();
    for (std::size_t i = 0; i < body.model->masses.size(); ++i)
      scale += body.model->masses[i] * body.state.velocities[i].norm();
    // 2.8e-14 and 5.8e-16 by the worst of 20 seeds
    EXPECT_LT((after.linear_momentum - before.linear_momentum).norm(), 1.4e-13 * scale);
    EXPECT_LT((after.angular_momentum - before.angular_momentum).norm(), 3e-15 * scale * extent);
    EXPECT_LE(after.kinetic_energy, before.kinetic_energy);
  }
}

TEST(FilledCells, AnotherDensityGivesTheBodyThatItWouldHaveBeen) {
  BodyDef def = defOf(sphereMesh(0.03, 0.005), 0.011);
  const PreparedBody light = prepareBody(def).value();
  Material heavy_material = def.material;
  heavy_material.density *= 2.0;
  heavy_material.youngs_modulus *= 3.0;
  const BodyModelPtr changed = withMaterial(light.model, def.material, heavy_material);
  def.material = heavy_material;
  const PreparedBody heavy = prepareBody(def).value();
  for (std::size_t i = 0; i < heavy.model->masses.size(); ++i)
    EXPECT_NEAR(changed->masses[i], heavy.model->masses[i], 1e-12 * heavy.model->masses[i]);
  EXPECT_NEAR(changed->highest_frequency, heavy.model->highest_frequency, 1e-6 * heavy.model->highest_frequency);
  for (std::size_t c = 0; c < heavy.model->cells->cells.size(); ++c)
    EXPECT_NEAR(changed->cells->cells[c].mass, heavy.model->cells->cells[c].mass,
                1e-12 * heavy.model->cells->cells[c].mass);
}

// A clamp over the end of a bar; beside the bar, where there are corners without tissue, nothing is held.
TEST(FilledCells, AClampHoldsTissueAlone) {
  BodyDef def = defOf(boxMesh(Vec3(0.08, 0.0205, 0.0205), 0.004), 0.01);
  def.fixed = {{Vec3(-1.0, -1.0, -1.0), Vec3(-0.038, 1.0, 1.0)}};
  const PreparedBody held = prepareBody(def).value();
  EXPECT_TRUE(held.model->any_fixed);
  def.fixed = {{Vec3(-1.0, 0.0145, -1.0), Vec3(1.0, 1.0, 1.0)}};  // beside the bar
  EXPECT_TRUE(
      std::any_of(held.model->rest.begin(), held.model->rest.end(), [](const Vec3& p) { return p.y() > 0.0145; }));
  const Result<PreparedBody> refused = prepareBody(def);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(refused.error().detail.find("fixed[0], the box from -1 0.0145 -1 to 1 1 1"), std::string::npos)
      << refused.error().detail;
}

}  // namespace filled_cells_test
}  // namespace meshless
