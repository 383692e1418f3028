// The push sphere ends where a slow approach would have brought it, however it came into the tissue.
#include <cmath>

#include "support/bodies.h"

namespace meshless {
namespace push_sphere_test {

using test::replyOf;

constexpr double kTop = 0.05;  // [m] of the pad

World pad(double friction) {
  WorldSettings settings;
  settings.sleep = false;
  World world(settings);
  BodyDef def = test::defOf(boxMesh(Vec3(0.16, 0.16, kTop), 0.012), "pad");
  def.pose.translation.z() = 0.5 * kTop;
  def.spacing = 0.01;
  def.material.youngs_modulus = 5000.0;
  def.material.poissons_ratio = 0.4;
  def.material.damping = 10.0;
  def.material.friction = friction;
  def.fixed.push_back(Box{Vec3(-1, -1, -1), Vec3(1, 1, 0.004)});
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  return world;
}

void run(World& world, double seconds) {
  for (int n = 0; n < seconds * world.settings().step_rate; ++n) world.step();
}

PushCommand at(double radius, double depth, double speed = 0.0) {
  PushCommand push;
  push.radius = radius;
  push.position = Vec3(0.003, 0.002, kTop + radius - depth);
  push.speed = speed;
  return push;
}

struct Pressed {
  double force = 0.0;   // [N] upwards, mean over a fifth of a second
  double inside = 0.0;  // [m] of tissue in the sphere, at most
};

Pressed pressed(World& world) {
  Pressed now;
  int steps = 0;
  for (; steps < 0.2 * world.settings().step_rate; ++steps) {
    world.step();
    now.force += world.push().force.z();
  }
  now.force /= steps;
  const WorldSnapshot shot = world.snapshot({true, true, false});
  for (const Vec3& p : shot.bodies[0].surface)
    now.inside = std::max(now.inside, world.push().radius - (p - world.push().position).norm());
  return now;
}

struct Press {
  double radius, depth;  // [m]
  double friction, bound;
};

// To 15 mm, to the centre, beyond it, and a large one. Where it is slippery, there is one rest; where tissue sticks, it
// sticks as it came, and that is a sixth of the force.
const Press kPresses[] = {{0.02, 0.015, 0.0, 0.02},
                          {0.02, 0.02, 0.0, 0.02},
                          {0.01, 0.018, 0.0, 0.02},
                          {0.05, 0.03, 0.0, 0.02},
                          {0.02, 0.02, 0.5, 0.1}};

Pressed slowly(const Press& press) {
  World world = pad(press.friction);
  replyOf<Done>(world.apply(at(press.radius, -0.001)));
  replyOf<Done>(world.apply(at(press.radius, press.depth, 0.03)));
  run(world, (press.depth + 0.001) / 0.03 + 1.0);
  return pressed(world);
}

void expectAsSlowly(World& world, const Press& press, const Pressed& slow, const std::string& how) {
  const Pressed now = pressed(world);
  std::printf("%-10s r %.0f mm, %.0f mm deep: %.3f N for %.3f, %.2f mm inside for %.2f\n", how.c_str(),
              1e3 * press.radius, 1e3 * press.depth, now.force, slow.force, 1e3 * now.inside, 1e3 * slow.inside);
  EXPECT_EQ(world.push().position, at(press.radius, press.depth).position) << how;
  EXPECT_NEAR(now.force, slow.force, press.bound * slow.force) << how << ' ' << press.radius << ' ' << press.depth;
  EXPECT_LT(now.inside, slow.inside + 0.001) << how << ' ' << press.radius << ' ' << press.depth;
}

TEST(PushSphere, EndsWithinASecondAsAfterASlowApproach) {
  for (const Press& press : kPresses) {
    const Pressed slow = slowly(press);
    ASSERT_GT(slow.force, 0.1);
    const PushCommand there = at(press.radius, press.depth);
    {
      World world = pad(press.friction);
      run(world, 0.5);
      replyOf<Done>(world.apply(there));
      run(world, 0.8);
      expectAsSlowly(world, press, slow, "appears");
      // A stream is lost, and comes back while the tissue closes, or has closed.
      for (const double silent : {0.05, 1.0}) {
        LiftCommand lift;
        lift.tool = ToolKind::kPush;
        replyOf<Done>(world.apply(lift));
        run(world, silent);
        PushCommand again = there;
        again.streamed = true;
        for (int n = 0; n < 0.8 * world.settings().step_rate; ++n) {
          replyOf<Done>(world.apply(again));
          again.speed = 1.0;
          world.step();
        }
        expectAsSlowly(world, press, slow, "returns");
      }
    }
    {
      World world = pad(press.friction);
      replyOf<Done>(world.apply(at(press.radius, -0.01)));
      run(world, 0.5);
      replyOf<Done>(world.apply(there));
      run(world, 0.8);
      expectAsSlowly(world, press, slow, "jumps");
    }
    {
      World world = pad(press.friction);
      PushCommand small = there;
      small.radius = 0.6 * press.radius;
      small.position.z() += 0.002;
      replyOf<Done>(world.apply(small));
      run(world, 0.5);
      replyOf<Done>(world.apply(there));
      run(world, 0.8);
      expectAsSlowly(world, press, slow, "grows");
    }
    {
      World world = pad(press.friction);  // a script that goes deeper bit by bit, each placed
      for (double depth = 0.0; depth < press.depth; depth += 0.0005) {
        replyOf<Done>(world.apply(at(press.radius, depth)));
        world.step();
      }
      replyOf<Done>(world.apply(there));
      run(world, 0.8);
      expectAsSlowly(world, press, slow, "in bits");
    }
  }
}

TEST(PushSphere, IsPlacedAtOnceWhereThereIsNoTissue) {
  World world = pad(0.5);
  replyOf<Done>(world.apply(at(0.02, 0.015)));
  EXPECT_GT(world.push().position.z(), kTop + 0.02 - 0.002) << "beside the tissue, on its way in";
  replyOf<Done>(world.apply(at(0.02, -0.001)));
  EXPECT_EQ(world.push().position, at(0.02, -0.001).position);
  // From where it presses it goes on, and does not come anew.
  replyOf<Done>(world.apply(at(0.02, 0.015)));
  run(world, 1.0);
  const double force = world.push().force.z();
  replyOf<Done>(world.apply(at(0.02, 0.016)));
  for (int n = 0; n < 60; ++n) {
    world.step();
    EXPECT_GT(world.push().force.z(), 0.9 * force);
  }
}

}  // namespace push_sphere_test
}  // namespace meshless
