// A body wakes by contact in the very step in which others have gone: what contacts remember of the step before is of
// other bodies then, with other triangles.
#include "support/bodies.h"

namespace meshless {
namespace woken_test {

BodyDef boxAt(const std::string& name, const Vec3& at, int parts) {
  BodyDef def = test::defOf(boxMesh(Vec3::Constant(0.1), parts, parts, parts), name);
  def.spacing = 0.05;
  def.pose.translation = at;
  return def;
}

TEST(Woken, WhileBodiesGo) {
  constexpr int kGuests = 80;
  World world{WorldSettings()};
  for (int k = 0; k < kGuests; ++k)
    ASSERT_TRUE(
        world.apply(SpawnCommand{test::shared(boxAt("guest" + std::to_string(k), Vec3(5.0 + k, 0, 50.0), 1))}).ok());
  ASSERT_TRUE(world.addSceneBody(test::shared(boxAt("sleeper", Vec3(-1, 0, 0.001), 2))).ok());
  for (int step = 0; step < 240; ++step) world.step();
  // Of a tower the finest is on top, so that each pair is followed by one of fewer triangles.
  ASSERT_TRUE(world.addSceneBody(test::shared(boxAt("fine", Vec3(0, 0, 0.22), 8))).ok());
  ASSERT_TRUE(world.addSceneBody(test::shared(boxAt("middle", Vec3(0, 0, 0.11), 8))).ok());
  ASSERT_TRUE(world.addSceneBody(test::shared(boxAt("coarse", Vec3(0, 0, 0.001), 1))).ok());
  ASSERT_TRUE(world.addSceneBody(test::shared(boxAt("falling", Vec3(-1, 0, 0.25), 2))).ok());
  bool slept = false, woke = false;
  for (int step = 0; step < kGuests; ++step) {
    ASSERT_TRUE(world.apply(RemoveCommand{"guest" + std::to_string(step)}).ok());
    world.step();
    const WorldSnapshot shot = world.snapshot({true, true, true});
    for (const BodySnapshot& body : shot.bodies) {
      ASSERT_TRUE(test::allFinite(body.surface)) << step;
      if (body.name != "sleeper") continue;
      slept = slept || body.asleep;
      woke = woke || (slept && !body.asleep);
    }
  }
  EXPECT_TRUE(slept);
  EXPECT_TRUE(woke);
}

}  // namespace woken_test
}  // namespace meshless
