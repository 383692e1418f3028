#include "meshless_surgery/tools/grasp.h"

#include "support/bodies.h"

namespace meshless {
namespace {

using test::prepared;

TEST(Grasp, HoldsAPatchAroundItsParticle) {
  const PreparedBody body = prepared(test::ball());
  Pick pick;
  makeGrasp(*body.model, 5, 0.06, pick);
  ASSERT_GT(pick.patch.size(), 3u);
  EXPECT_EQ(pick.patch[0], 5u);
  double sum = 0.0;
  for (std::size_t k = 0; k < pick.patch.size(); ++k) {
    EXPECT_GE(pick.weights[k], 0.0);
    EXPECT_LE((body.model->rest[pick.patch[k]] - body.model->rest[5]).norm(), 0.06);
    sum += pick.weights[k];
  }
  EXPECT_NEAR(sum, 1.0, 1e-12);
  makeGrasp(*body.model, 5, 0.0, pick);
  EXPECT_EQ(pick.patch.size(), 1u);
}

// Links of a lattice go along its axes: a way along them is longer than it is, and a grasp as far would be an
// octahedron.
TEST(Grasp, IsRoundInALattice) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.1, 0.1, 0.1), 4, 4, 4));
  def.material.youngs_modulus = 5000.0;
  def.spacing = 0.01;
  const PreparedBody body = prepared(def);
  const Points& rest = body.model->rest;
  Index centre = 0;
  for (Index i = 0; i < rest.size(); ++i)
    if (rest[i].norm() < rest[centre].norm()) centre = i;
  const double radius = 0.035;
  Pick pick;
  makeGrasp(*body.model, centre, radius, pick);
  std::size_t within = 0;
  for (const Vec3& p : rest) within += (p - rest[centre]).norm() < radius * (1.0 - 1e-9);
  EXPECT_EQ(pick.patch.size(), within);
}

TEST(Grasp, LeavesFixedTissueToWhatFixesIt) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.1, 0.1, 0.1), 4, 4, 4));
  def.material.youngs_modulus = 5000.0;
  def.spacing = 0.01;
  def.fixed.push_back(Box{Vec3(-1, -1, 0.0), Vec3(1, 1, 1)});
  const PreparedBody body = prepared(def);
  const BodyModel& model = *body.model;
  const auto nearest = [&](const Vec3& to) {
    Index best = 0;
    for (Index i = 0; i < model.rest.size(); ++i)
      if ((model.rest[i] - to).norm() < (model.rest[best] - to).norm()) best = i;
    return best;
  };
  Pick pick;
  makeGrasp(model, nearest(Vec3(0, 0, 0)), 0.025, pick);
  ASSERT_FALSE(pick.patch.empty());
  double sum = 0.0;
  for (std::size_t k = 0; k < pick.patch.size(); ++k) {
    EXPECT_FALSE(model.fixed[pick.patch[k]]);
    sum += pick.weights[k];
  }
  EXPECT_NEAR(sum, 1.0, 1e-12);
  // Where there is nothing else.
  makeGrasp(model, nearest(Vec3(0, 0, 0.05)), 0.025, pick);
  EXPECT_GT(pick.patch.size(), 1u);
  for (const Index i : pick.patch) EXPECT_TRUE(model.fixed[i]);
}

TEST(CastRay, HitsTheNearSideOfASphereAndMissesBesideIt) {
  const TriangleMesh sphere = sphereMesh(1.0, 0.05);
  const RayHit hit = castRay(sphere.vertices, sphere.triangles, Vec3(0.1, 0.2, 5), Vec3(0, 0, -2));
  ASSERT_TRUE(hit.hit);
  EXPECT_NEAR(hit.point.z(), std::sqrt(1 - 0.05), 2e-3);
  EXPECT_NEAR(hit.distance, 5 - hit.point.z(), 1e-9);
  EXPECT_FALSE(castRay(sphere.vertices, sphere.triangles, Vec3(0, 1.1, 5), Vec3(0, 0, -1)).hit);
  EXPECT_FALSE(castRay(sphere.vertices, sphere.triangles, Vec3(0, 0, 5), Vec3(0, 0, 1)).hit);
}

}  // namespace
}  // namespace meshless
