// Bodies of filled cells in a world: picks, cuts and what is left of them.
#include <algorithm>
#include <cmath>
#include <map>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/organs.h"
#include "meshless_surgery/tools/grasp.h"
#include "meshless_surgery/world/world.h"
#include "support/bodies.h"
#include "support/random.h"

namespace meshless {
namespace filled_cells_test {

using test::replyOf;

WorldSettings apart() {
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kNone;
  return settings;
}

BodyDef soft(const TriangleMesh& mesh, double spacing) {
  BodyDef def = test::defOf(mesh, "tissue");
  def.spacing = spacing;
  def.material.youngs_modulus = 5e3;
  def.material.poissons_ratio = 0.4;
  def.material.density = 1000.0;
  def.material.damping = 5.0;
  return def;
}

CutCommand cutThrough(const Vec3& point, const Vec3& normal) {
  CutCommand cut;
  cut.blades.x_axis = normal.unitOrthogonal();
  cut.blades.y_axis = normal.cross(cut.blades.x_axis);
  cut.blades.origin = point - 10.0 * cut.blades.x_axis;
  return cut;
}

PickId pickAt(World& world, const Vec3& point) {
  PickCommand pick;
  pick.point = point;
  pick.max_distance = 0.05;
  return replyOf<PickReply>(world.apply(pick)).pick;
}

// 0.21 m in cells of 0.03: the end cells are whole along x and partial across.
World bar() {
  World world{apart()};
  EXPECT_TRUE(world.addSceneBody(test::shared(soft(boxMesh(Vec3(0.21, 0.05, 0.05), 0.01), 0.03))).ok());
  return world;
}

// Within 5 mm of the blade, in cells of 12 mm: what is picked on a side of it goes with the piece on that side.
TEST(FilledCellsInAWorld, PicksNearABladeStayOnTheirSide) {
  test::Random random(17);
  int picks = 0, wrong = 0;
  for (int round = 0; round < 12; ++round) {
    World world{apart()};
    const TriangleMesh mesh = round % 3 == 0   ? boxMesh(Vec3(0.16, 0.12, 0.1), 0.008)
                              : round % 3 == 1 ? sphereMesh(0.08, 0.007)
                                               : liverMesh();
    ASSERT_TRUE(world.addSceneBody(test::shared(soft(mesh, 0.0125))).ok());
    const Plane plane{random.vector(1.0).normalized(), solidCentroid(mesh) + random.vector(0.01)};
    const Points surface = world.snapshot({true, false, false}).bodies[0].surface;
    std::map<PickId, double> height;
    for (int k = 0; k < 2000 && height.size() < 90; ++k) {
      const Vec3& p = surface[static_cast<std::size_t>(random.integer(0, static_cast<int>(surface.size()) - 1))];
      if (std::abs(plane.height(p)) > 0.005) continue;
      PickCommand pick;
      pick.direction = solidCentroid(mesh) - p;
      pick.point = p - 0.5 * pick.direction;
      const PickReply reply = replyOf<PickReply>(world.apply(pick));
      if (const double there = plane.height(reply.position); std::abs(there) > 1e-4) height[reply.pick] = there;
    }
    ASSERT_TRUE(world.apply(cutThrough(plane.point, plane.normal)).ok());
    const WorldSnapshot shot = world.snapshot({true, true, true});
    for (const Pick& pick : shot.picks) {
      if (!height.count(pick.id)) continue;
      for (const BodySnapshot& body : shot.bodies) {
        if (body.name != shot.pick_bodies.at(pick.id)) continue;
        double side = 0.0;
        for (const Vec3& p : body.surface) side += plane.height(p);
        ++picks;
        wrong += side * height.at(pick.id) < 0.0;
        EXPECT_LT((graspMean(pick, body.particles) - pick.position).norm(), 1e-9) << "nothing jumps";
      }
    }
  }
  EXPECT_GT(picks, 900);
  EXPECT_EQ(wrong, 0) << "of " << picks;
}

TEST(FilledCellsInAWorld, PicksGrabTissueAndFollowIt) {
  World world = bar();
  const PickId left = pickAt(world, Vec3(-0.1, 0.0, 0.0)), right = pickAt(world, Vec3(0.1, 0.0, 0.0));
  const auto grabbedTissue = [&] {
    const WorldSnapshot shot = world.snapshot({true, true, true});
    for (const Pick& pick : shot.picks)
      for (const BodySnapshot& body : shot.bodies)
        if (body.id == pick.body) EXPECT_TRUE(body.model->isTissue(pick.particle));
    return shot;
  };
  grabbedTissue();
  InciseCommand incise;
  incise.blade.origin = Vec3(-0.2, 0.003, 0.2);
  incise.blade.x_axis = Vec3::UnitX();
  incise.blade.y_axis = Vec3::UnitZ();
  incise.blade.length = 0.22;
  incise.blade.depth = 0.4;
  ASSERT_TRUE(world.apply(incise).ok());
  EXPECT_EQ(grabbedTissue().picks.size(), 2u);
  ASSERT_TRUE(world.apply(cutThrough(Vec3(0.052, 0, 0), Vec3::UnitX())).ok());
  const WorldSnapshot shot = grabbedTissue();
  ASSERT_EQ(shot.picks.size(), 2u);
  EXPECT_NE(shot.picks[0].body, shot.picks[1].body);
  for (const Pick& pick : shot.picks)
    for (const BodySnapshot& body : shot.bodies)
      if (body.id == pick.body) EXPECT_EQ(body.measures.centre_of_mass.x() > 0.052, pick.id == right) << left;
}

TEST(FilledCellsInAWorld, ACutAtRestMovesNothing) {
  World world = bar();
  ASSERT_TRUE(world.apply(cutThrough(Vec3(0.013, 0.002, 0), Vec3(1.0, 0.3, 0.2).normalized())).ok());
  const WorldSnapshot before = world.snapshot({true, true, true});
  ASSERT_EQ(before.bodies.size(), 2u);
  for (int n = 0; n < 60; ++n) world.step();
  const WorldSnapshot after = world.snapshot({true, true, true});
  for (std::size_t b = 0; b < 2; ++b)
    for (std::size_t v = 0; v < before.bodies[b].surface.size(); ++v)
      EXPECT_LT((after.bodies[b].surface[v] - before.bodies[b].surface[v]).norm(), 1e-9);
}

// A stretched bar is cut again and again; what is let go comes back to its volume, and no piece turns inside out.
// Crumbs of less than two samples follow cells that are hardly theirs.
TEST(FilledCellsInAWorld, PiecesOfAStretchedBarGoBackToTheirVolumes) {
  test::Random random(4);
  for (int round = 0; round < 4; ++round) {
    SCOPED_TRACE(round);
    World world = bar();
    const PickId left = pickAt(world, Vec3(-0.1, 0.0, 0.0)), right = pickAt(world, Vec3(0.1, 0.0, 0.0));
    for (const auto& [id, x] : {std::make_pair(left, -0.14), std::make_pair(right, 0.14)}) {
      MovePickCommand move;
      move.pick = id;
      move.target = Vec3(x, 0.02, 0.03);
      ASSERT_TRUE(world.apply(move).ok());
    }
    for (int n = 0; n < 60; ++n) world.step();
    for (int cut = 0; cut < 4; ++cut) {
      const auto reply = world.apply(cutThrough(random.vector(0.02) + Vec3(0, 0.01, 0.015), random.unit()));
      if (!reply.ok()) EXPECT_EQ(reply.error().code, ErrorCode::kMissed);
      for (int n = 0; n < 4; ++n) world.step();
    }
    for (const PickId id : {left, right}) {
      ReleaseCommand release;
      release.pick = id;
      (void)world.apply(release);
    }
    for (int n = 0; n < 240; ++n) world.step();
    const WorldSnapshot shot = world.snapshot({true, true, true});
    EXPECT_GE(shot.bodies.size(), 4u);
    double mass = 0.0;
    for (const BodySnapshot& body : shot.bodies) {
      mass += body.model->mass;
      if (body.model->rest_volume < 2.0 * std::pow(body.model->spacing / 4.0, 3)) continue;
      EXPECT_NEAR(body.measures.volume, body.model->rest_volume, 0.013 * body.model->rest_volume + 1e-12) << body.name;
    }
    EXPECT_NEAR(mass, 1000.0 * 0.21 * 0.05 * 0.05, 1e-9);
  }
}

TEST(FilledCellsInAWorld, ACutIsTakenBack) {
  World world = bar();
  ASSERT_TRUE(world.apply(cutThrough(Vec3(0.013, 0.002, 0), Vec3(1.0, 0.3, 0.2).normalized())).ok());
  ASSERT_TRUE(world.apply(UndoCutCommand{}).ok());
  const WorldSnapshot shot = world.snapshot({true, true, true});
  ASSERT_EQ(shot.bodies.size(), 1u);
  EXPECT_EQ(shot.bodies[0].name, "tissue");
  ASSERT_TRUE(shot.bodies[0].model->lattice);
  ASSERT_TRUE(world.apply(cutThrough(Vec3(0.013, 0.002, 0), Vec3(1.0, 0.3, 0.2).normalized())).ok());
}

}  // namespace filled_cells_test
}  // namespace meshless
