// A bend that stays, in materials of both kinds; in the world at its defaults.
#include <gtest/gtest.h>

#include "meshless_surgery/world/world.h"
#include "support/bodies.h"

namespace meshless {
namespace plastic_bend_test {

void run(World& world, double seconds) {
  for (int step = 0; step < std::lround(seconds * world.settings().step_rate); ++step) world.step();
}

/// Of a bar that is held at one end, bent upwards by a pick for five seconds and let go: the share of the bend that is
/// there five seconds later.
double share(bool elastic, MatchMode mode, double creep) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.12, 0.02, 0.01), 0.005), "bar");
  def.material.mode = mode;
  def.material.alpha = 0.5;
  def.material.beta = 0.3;
  def.material.damping = 10.0;
  if (elastic) def.material.youngs_modulus = 2e4;
  def.material.plasticity = {0.02, creep, 1.0};
  def.spacing = 0.005;
  def.fixed = {HeldRegion(Vec3(-1, -1, -1), Vec3(-0.04, 1, 1))};
  World world{test::weightless()};
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  PickCommand pick;
  pick.point = Vec3(0.058, 0, 0);
  pick.max_distance = 0.02;
  const PickReply picked = test::replyOf<PickReply>(world.apply(pick));
  LockCommand lock;
  lock.pick = picked.pick;
  lock.target = Vec3(0.03, 0, 0.08);
  EXPECT_TRUE(world.apply(lock).ok());
  const auto tip = [&world] {
    const WorldSnapshot shot = world.snapshot({true, false, false});
    double height = 0.0, count = 0.0;
    for (std::size_t v = 0; v < shot.bodies[0].surface.size(); ++v)
      if ((shot.bodies[0].model->own * shot.bodies[0].model->surface.vertices[v]).x() > 0.055)
        height += shot.bodies[0].surface[v].z(), count += 1.0;
    return height / count;
  };
  run(world, 5.0);
  const double bent = tip();
  EXPECT_GT(bent, 0.05);
  EXPECT_TRUE(world.apply(ClearPicksCommand{}).ok());
  run(world, 5.0);
  return tip() / bent;
}

TEST(PlasticBend, StaysInMaterialsOfBothKindsThatFlowAndInNoOther) {
  EXPECT_GT(share(true, MatchMode::kLinear, 5.0), 0.4);
  EXPECT_GT(share(false, MatchMode::kLinear, 5.0), 0.3);
  EXPECT_GT(share(false, MatchMode::kQuadratic, 5.0), 0.3);
  EXPECT_LT(std::abs(share(true, MatchMode::kLinear, 0.0)), 0.01);
  EXPECT_LT(std::abs(share(false, MatchMode::kLinear, 0.0)), 0.2);  // goals bend back softly
}

}  // namespace plastic_bend_test
}  // namespace meshless
