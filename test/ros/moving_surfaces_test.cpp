#include "ros/moving_surfaces.h"

#include "ros/scene_support.h"

namespace meshless {
namespace moving_surfaces_test {

WorldSnapshot shown(World& world) {
  SnapshotWants wants;
  wants.surfaces = true;
  return world.snapshot(wants);
}

Vec3 placeOf(const meshless_surgery::BodyVertices& body, std::size_t v) {
  return Vec3(body.origin.x, body.origin.y, body.origin.z) +
         body.step * Vec3(body.xyz[3 * v], body.xyz[3 * v + 1], body.xyz[3 * v + 2]);
}

TEST(MovingSurfaces, TheTopologyIsSaidWhereItHasChangedAlone) {
  const auto world = twoBoxes();
  MovingSurfaces surfaces;
  const auto first = surfaces.change(shown(*world), {});
  ASSERT_TRUE(first);
  ASSERT_EQ(2u, first->bodies.size());
  EXPECT_EQ("a", first->bodies[0].name);
  EXPECT_EQ(3u * 12u * 9u, first->bodies[0].triangles.size());
  EXPECT_EQ(12u * 9u, first->bodies[0].cut.size());
  world->step();
  EXPECT_FALSE(surfaces.change(shown(*world), {}));
  ASSERT_TRUE(world->apply(cutAcross(0.01)).ok());
  const auto cut = surfaces.change(shown(*world), {});
  ASSERT_TRUE(cut);
  EXPECT_GT(cut->topology, first->topology);
  EXPECT_EQ(3u, cut->bodies.size());
  SetMaterialCommand colour;
  colour.change = [](const Material& present) {
    Material other = present;
    other.color.r = 0.125;
    return Result<Material>(other);
  };
  ASSERT_TRUE(world->apply(colour).ok());
  EXPECT_TRUE(surfaces.change(shown(*world), {}));
  EXPECT_FALSE(surfaces.change(shown(*world), {}));
  world->reset();
  const auto again = surfaces.change(shown(*world), {});
  ASSERT_TRUE(again);
  EXPECT_GT(again->run, first->run);
}

TEST(MovingSurfaces, VerticesAreWhereTheyAreToHalfAStep) {
  const auto world = twoBoxes();
  PickCommand pick;
  pick.point = Vec3(-0.05, 0, 0);
  pick.max_distance = 0.1;
  const auto picked = world->apply(pick);
  ASSERT_TRUE(picked.ok());
  MovePickCommand move;
  move.pick = std::get<PickReply>(*picked).pick;
  move.target = Vec3(-0.2, 0.1, 0.05);
  ASSERT_TRUE(world->apply(move).ok());
  for (int i = 0; i < 10; ++i) world->step();
  const auto snapshot = shown(*world);
  MovingSurfaces surfaces;
  const auto topology = surfaces.change(snapshot, {});
  const auto message = surfaces.vertices(snapshot, {}, false);
  EXPECT_TRUE(message.complete);  // the first
  EXPECT_EQ(topology->topology, message.topology);
  ASSERT_EQ(2u, message.bodies.size());
  for (std::size_t b = 0; b < 2; ++b) {
    const Points& wanted = snapshot.bodies[b].surface;
    const auto& body = message.bodies[b];
    ASSERT_EQ(3 * wanted.size(), body.xyz.size());
    EXPECT_EQ(topology->bodies[b].vertices, wanted.size());
    EXPECT_LT(body.step, 0.2 / 65535.0);
    for (std::size_t v = 0; v < wanted.size(); ++v) {
      EXPECT_LT((placeOf(body, v) - wanted[v]).cwiseAbs().maxCoeff(), 0.5001 * body.step);
    }
  }
}

TEST(MovingSurfaces, BodiesThatDoNotMoveAreLeftOutUnlessAllAreAskedFor) {
  const auto world = twoBoxes();
  MovingSurfaces surfaces;
  const auto say = [&](bool complete) {
    const auto snapshot = shown(*world);
    (void)surfaces.change(snapshot, {});
    return surfaces.vertices(snapshot, {}, complete);
  };
  EXPECT_EQ(2u, say(false).bodies.size());
  world->step();
  EXPECT_TRUE(say(false).bodies.empty());
  PickCommand pick;
  pick.point = Vec3(-0.05, 0, 0);
  pick.max_distance = 0.1;
  const auto picked = world->apply(pick);
  ASSERT_TRUE(picked.ok());
  MovePickCommand move;
  move.pick = std::get<PickReply>(*picked).pick;
  move.target = Vec3(-0.2, 0.1, 0.05);
  ASSERT_TRUE(world->apply(move).ok());
  world->step();
  const auto moved = say(false);
  EXPECT_FALSE(moved.complete);
  ASSERT_EQ(1u, moved.bodies.size());
  EXPECT_EQ(world->snapshot({}).bodies[0].number, moved.bodies[0].id);
  const auto all = say(true);
  EXPECT_TRUE(all.complete);
  EXPECT_EQ(2u, all.bodies.size());
  ASSERT_TRUE(world->apply(cutAcross(0.01)).ok());
  const auto cut = say(false);
  EXPECT_TRUE(cut.complete);
  EXPECT_EQ(3u, cut.bodies.size());
}

}  // namespace moving_surfaces_test
}  // namespace meshless
