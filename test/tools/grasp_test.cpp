#include "meshless_surgery/tools/grasp.h"

#include <numeric>

#include "support/bodies.h"

namespace meshless {
namespace {

using test::prepared;

// [m] from the mean of the patch to the point that is to be held.
double missed(const Pick& pick, const Points& positions, const Vec3& point) {
  EXPECT_EQ(pick.position, graspMean(pick, positions));
  EXPECT_NEAR(std::accumulate(pick.weights.begin(), pick.weights.end(), 0.0), 1.0, 1e-12);
  return (pick.position - point).norm();
}

TEST(Grasp, HoldsAPatchAroundItsParticle) {
  const PreparedBody body = prepared(test::ball());
  const Points& now = body.state.positions;
  Pick pick;
  makeGrasp(*body.model, now, 5, 0.06, now[5], pick);
  ASSERT_GT(pick.patch.size(), 3u);
  EXPECT_EQ(pick.particle, 5u);
  EXPECT_EQ(pick.patch[0], 5u);
  for (const Index i : pick.patch) EXPECT_LE((body.model->rest[i] - body.model->rest[5]).norm(), 0.06);
  EXPECT_LT(missed(pick, now, now[5]), 1e-12);
  makeGrasp(*body.model, now, 5, 0.0, now[5], pick);
  EXPECT_EQ(pick.patch.size(), 1u);
  EXPECT_LT(missed(pick, now, now[5]), 1e-12);
}

// Its mean is the point at which it holds, and goes with that point of a body that is turned and stretched.
TEST(Grasp, HoldsAPointHoweverTheTissueTurnsAndStretches) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.1, 0.08, 0.06), 4, 4, 4));
  def.material.youngs_modulus = 5000.0;
  def.spacing = 0.01;
  for (const PreparedBody& body : {prepared(test::ball()), prepared(def)}) {
    const Points& now = body.state.positions;
    Mat3 map = Quat(Eigen::AngleAxisd(1.9, Vec3(1, 2, -1).normalized())).toRotationMatrix();
    map.col(0) *= 1.7;
    map.col(2) += 0.4 * map.col(1);
    Points moved;
    for (const Vec3& p : now) moved.push_back(map * p + Vec3(0.3, 0.1, -0.2));
    for (Index i = 0; i < now.size(); i += 13) {
      const Vec3 point = now[i] + 0.3 * body.model->spacing * Vec3(0.6, -0.5, 0.7);
      Pick pick;
      makeGrasp(*body.model, now, i, 4.0 * body.model->spacing, point, pick);
      EXPECT_LT(missed(pick, now, point), 1e-12) << i;
      EXPECT_LT((graspMean(pick, moved) - (map * point + Vec3(0.3, 0.1, -0.2))).norm(), 1e-12) << i;
      double most = 0.0;
      for (const double weight : pick.weights) most = std::max(most, std::abs(weight));
      EXPECT_LT(most, 2.0) << i;
      // Of one particle it is that particle, which does not turn.
      makeGrasp(*body.model, now, i, 0.0, point, pick);
      EXPECT_LT(missed(pick, now, now[i]), 1e-12) << i;
    }
  }
}

// Links of a lattice go along its axes: a way along them is longer than it is, and a grasp as far would be an
// octahedron.
TEST(Grasp, IsRoundInALattice) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.1, 0.1, 0.1), 4, 4, 4));
  def.material.youngs_modulus = 5000.0;
  def.spacing = 0.01;
  const PreparedBody body = prepared(def);
  const Points &rest = body.model->rest, &now = body.state.positions;
  Index centre = 0;
  for (Index i = 0; i < rest.size(); ++i)
    if (rest[i].norm() < rest[centre].norm()) centre = i;
  const double radius = 0.035;
  Pick pick;
  makeGrasp(*body.model, now, centre, radius, now[centre], pick);
  std::size_t within = 0;
  for (const Vec3& p : rest) within += (p - rest[centre]).norm() < radius * (1.0 - 1e-9);
  EXPECT_EQ(pick.patch.size(), within);
}

TEST(Grasp, LeavesFixedTissueToWhatFixesIt) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.1, 0.1, 0.1), 4, 4, 4));
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
  const Points& now = body.state.positions;
  Pick pick;
  Index centre = nearest(Vec3(0, 0, 0.05));
  for (Index i = 0; i < model.rest.size(); ++i)  // at the border, in the middle
    if (model.fixed[i] && model.rest[i].norm() < model.rest[centre].norm()) centre = i;
  makeGrasp(model, now, centre, 0.025, now[centre], pick);
  ASSERT_FALSE(pick.patch.empty());
  for (const Index i : pick.patch) EXPECT_FALSE(model.fixed[i]);
  EXPECT_EQ(pick.particle, pick.patch[0]);
  EXPECT_LT(missed(pick, now, now[pick.particle]), 1e-12) << "the nearest that is free";
  for (const double weight : pick.weights) EXPECT_LT(std::abs(weight), 2.0);
  // Where there is nothing else.
  makeGrasp(model, now, nearest(Vec3(0, 0, 0.05)), 0.025, Vec3(0, 0, 0.05), pick);
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
