// Surfaces of filled cells follow the blend of the cells around them.
#include "meshless_surgery/body/cell_blend.h"

#include <set>

#include <gtest/gtest.h>

#include "meshless_surgery/base/random.h"
#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/body/filled_cells.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "support/bodies.h"

namespace meshless {
namespace cell_blend_test {

PreparedBody block(double edge) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.12, 0.08, 0.06), edge));
  def.material.youngs_modulus = 5000.0;
  def.material.poissons_ratio = 0.4;
  def.material.damping = 10.0;
  def.spacing = 0.01;
  return test::prepared(def);
}

CutBody incised(const PreparedBody& body) {
  Blade blade;
  blade.origin = Vec3(-0.03, 0.0012, 0.031);
  blade.x_axis = Vec3::UnitX();
  blade.y_axis = Vec3::UnitZ();
  blade.length = 0.06;
  blade.depth = 0.04;
  Result<CutBody> result = cutBody(*body.model, body.state, blade);
  EXPECT_TRUE(result.ok());
  return std::move(*result);
}

Vec3 follow(const SurfaceBinding& binding, const Points& x, Index r) { return binding.place(r, x); }

TEST(CellBlend, FollowsAffineMotionExactly) {
  Random random(5);
  const PreparedBody whole = block(0.01);
  const CutBody wounded = incised(whole);
  for (const BodyModel* model : {whole.model.get(), wounded.pieces[0].model.get()}) {
    Mat3 map;
    map << random.direction(), random.direction(), random.direction();
    const Vec3 shift(0.1, -0.2, 0.3);
    Points x;
    for (const Vec3& p : model->rest) x.push_back(map * p + shift);
    for (Index v = 0; v < model->surface.vertices.size(); ++v)
      EXPECT_LT((follow(model->binding, x, v) - (map * model->surface.vertices[v] + shift)).norm(), 1e-13);
  }
}

// Particles are anywhere; places half a hundredth of a cell apart stay near each other, whichever cells they are in.
TEST(CellBlend, DoesNotJumpFromCellToCell) {
  Random random(7);
  const PreparedBody body = block(0.01);
  const CellLattice& lattice = *body.model->lattice;
  const CellFinder finder(lattice);
  Points x;
  for (const Vec3& p : body.model->rest) x.push_back(p + random.inCube(0.2 * lattice.spacing));
  for (int line = 0; line < 20; ++line) {
    const Vec3 from = Vec3(random.between(-0.05, 0.05), random.between(-0.03, 0.03), random.between(-0.02, 0.02));
    const Vec3 step = 0.005 * lattice.spacing * random.direction();
    Points places;
    std::vector<Index> cells;
    for (int n = 0; n < 400; ++n) {
      places.push_back(from + n * step);
      cells.push_back(finder.nearest(places.back()));
    }
    const SurfaceBinding binding = bindToCells(lattice, places, cells);
    for (Index n = 1; n < places.size(); ++n)
      EXPECT_LT((follow(binding, x, n) - follow(binding, x, n - 1)).norm(), 3.0 * step.norm());
  }
}

// The two sides of a wound: where they are farther than two cells from its front, neither follows the other's tissue.
TEST(CellBlend, DoesNotReachAcrossAWound) {
  const PreparedBody whole = block(0.006);
  const CutBody wounded = incised(whole);
  const BodyModel& model = *wounded.pieces[0].model;
  Points x = model.rest;
  const auto deep = [](const Vec3& p) { return std::abs(p.x()) < 0.012 && p.z() > 0.012; };
  std::set<Index> above, below;
  for (Index v = 0; v < model.surface.vertices.size(); ++v) {
    const Vec3& p = model.surface.vertices[v];
    if (!deep(p) || std::abs(p.y() - 0.0012) > 0.02) continue;
    const LatticeCell& own = model.lattice->cells[model.binding.cells[v]];
    double height = 0.0;  // of the tissue that it is of
    for (SampleSet left = own.samples; left; left &= left - 1)
      height += model.lattice->restPlace(own, samplePlace(lowestSample(left))).y() - 0.0012;
    for (Index k = model.binding.offsets[v]; k < model.binding.offsets[v + 1]; ++k)
      (height > 0.0 ? above : below).insert(model.binding.carriers[k]);
  }
  ASSERT_GT(above.size(), 20u);
  ASSERT_GT(below.size(), 20u);
  for (const Index i : above) EXPECT_EQ(below.count(i), 0u) << model.rest[i].transpose();
}

}  // namespace cell_blend_test
}  // namespace meshless
