// Pieces of one cell, cut off a cube at one, two, three and four corners: dragged about and let go they return to rest,
// and on the ground they come to rest.
#include <gtest/gtest.h>

#include "support/stress_cases.h"

namespace meshless::stress {
namespace pieces_test {

constexpr double kEdge = 0.1;               // [m]
constexpr double kRestored = 1e-3 * kEdge;  // [m]

/// A cube about the origin whose corners are its particles; as cells of a lattice where the kind says so.
BodyDef cubeOf(const Kind& kind) {
  BodyDef def;
  def.name = "cube";
  def.mesh = boxMesh(Vec3::Constant(kEdge), 1, 1, 1);
  Box bounds;
  for (const Vec3& p : def.mesh.vertices) bounds.extend(p);
  for (Vec3& p : def.mesh.vertices) p -= 0.5 * (bounds.min + bounds.max);
  def.spacing = kEdge;
  def.material = materialOf(kind);
  def.clusters.kind = ClusterOptions::Kind::kOne;
  if (kind.many_clusters) {
    def.clusters.kind = ClusterOptions::Kind::kGrid;  // of cells every piece has all corners
    def.clusters.grid = {2, 2, 2};
  }
  return def;
}

/// A plane with so many of the cube's corners below it.
CutCommand cutOff(int corners) {
  struct Side {
    Vec3 normal;
    double height;  // both in halves of the edge
  };
  const Side sides[] = {{Vec3(1, 1, 1), -2.0}, {Vec3(1, 1, 0), -1.0}, {Vec3(3, 1, 1), -2.0}, {Vec3(1, 0, 0), 0.1}};
  const Side& side = sides[corners - 1];
  const Vec3 normal = side.normal.normalized();
  CutCommand cut;
  cut.blades.x_axis = normal.unitOrthogonal();
  cut.blades.y_axis = normal.cross(cut.blades.x_axis);
  cut.blades.origin = 0.5 * kEdge * side.height / side.normal.norm() * normal - 1e3 * cut.blades.x_axis;
  return cut;
}

using Case = std::tuple<Kind, int>;

class Pieces : public testing::TestWithParam<Case> {
 protected:
  void spawnAndCut(Twins& twins) {
    const auto& [kind, corners] = GetParam();
    twins.spawn(test::shared(cubeOf(kind)));
    const Result<Reply> cut = twins.apply(cutOff(corners));
    ASSERT_TRUE(cut.ok()) << cut.error().detail;
    ASSERT_EQ(std::get<CutReply>(*cut).new_bodies.size(), 2u);
    ASSERT_TRUE(twins.step(Vec3::Zero(), 10.0));
    std::size_t fewest = 8;
    for (const BodySnapshot& body : twins.seen().bodies) fewest = std::min(fewest, body.particles.size());
    EXPECT_EQ(fewest, 8u) << corners;
  }
};

TEST_P(Pieces, DraggedAndLetGoGoBack) {
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kNone;
  Twins twins(settings);
  spawnAndCut(twins);
  test::Random random(23);
  std::vector<PickId> picks;
  for (const BodySnapshot& body : twins.seen().bodies) {
    PickCommand pick;
    pick.body = body.name;
    pick.point = body.particles[0];
    pick.max_distance = 1.0;
    pick.stiffness = 1e3;
    picks.push_back(test::replyOf<PickReply>(twins.apply(pick)).pick);
  }
  for (int step = 0; step < 60; ++step) {
    for (PickId pick : picks) ASSERT_TRUE(twins.apply(MovePickCommand{pick, random.vector(kEdge)}).ok());
    ASSERT_TRUE(twins.step(Vec3::Zero(), 10.0));
  }
  ASSERT_TRUE(twins.apply(ClearPicksCommand{}).ok());
  Twins calm = stoppedAsAWhole(twins, settings, 10.0);
  double farthest = 1.0;  // a grid finer than the particles leaves pairs: they have a length, and the body no shape
  EnergyLaw law;
  for (int step = 0; step < 3600 && (step < 60 || !(farthest < kRestored)); ++step) {
    ASSERT_TRUE(calm.step(Vec3::Zero(), 20.0));
    double energy = 0.0;
    farthest = 0.0;
    for (const BodySnapshot& body : calm.seen().bodies) {
      energy += deformationEnergy(*body.model, body.material, 1.0 / settings.step_rate, body.particles) +
                body.measures.kinetic_energy;
      farthest = std::max(farthest, clusterError(*body.model, body.particles));
    }
    ASSERT_TRUE(law.holds(energy)) << "step " << step;
  }
  EXPECT_LT(farthest, kRestored);
}

TEST_P(Pieces, FallAndComeToRest) {
  WorldSettings settings;
  settings.ground = -2.0 * kEdge;
  Twins twins(settings);
  spawnAndCut(twins);
  for (int step = 0; step < 720; ++step) ASSERT_TRUE(twins.step(Vec3::Zero(), 3.0));  // some rock for 4 s
  for (const BodySnapshot& body : twins.seen().bodies) {
    EXPECT_LT(body.measures.kinetic_energy, 0.5 * body.model->mass * 0.05 * 0.05) << body.name;
    for (const Vec3& p : body.surface) EXPECT_GT(p.z(), *settings.ground - 0.05 * kEdge) << body.name;
  }
}

INSTANTIATE_TEST_SUITE_P(Stress, Pieces, testing::ValuesIn(crossed(kindsAlone(), std::vector<int>{1, 2, 3, 4})),
                         [](const auto& info) {
                           return testName(std::get<0>(info.param).name + " of " +
                                           std::to_string(std::get<1>(info.param)));
                         });

}  // namespace pieces_test
}  // namespace meshless::stress
