// How hard hands press: it adds up to their forces, and is where they are.
#include "meshless_surgery/world/contact_pressure.h"

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/primitives.h"
#include "support/bodies.h"

namespace meshless {
namespace contact_pressure_test {

/// A block that lies on the ground, divided for looks so many times along an edge, and a sphere that presses from
/// above.
WorldSnapshot pressed(int divided, double depth) {
  WorldSettings settings;
  settings.sleep = false;
  World world(settings);
  BodyDef def = test::defOf(boxMesh(Vec3(0.06, 0.06, 0.03), divided, divided, divided), "block");
  def.pose.translation = Vec3(0, 0, 0.015);
  def.material.youngs_modulus = 2e4;
  def.material.damping = 10.0;
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  PushCommand push;
  push.enable = true;
  push.radius = 0.01;
  push.position = Vec3(0.01, 0, 0.045);
  EXPECT_TRUE(world.apply(push).ok());
  for (int step = 0; step < 60; ++step) {
    push.position.z() = 0.045 - (0.005 + depth) * std::min(1.0, step / 30.0);
    EXPECT_TRUE(world.apply(push).ok());
    world.step();
  }
  return world.snapshot({true, false, false, true});
}

TEST(ContactPressure, AddsUpToTheForceOfTheHandAndIsBelowIt) {
  for (const int divided : {1, 4, 30}) {
    SCOPED_TRACE(divided);
    const WorldSnapshot shot = pressed(divided, 0.003);
    const BodySnapshot& body = shot.bodies[0];
    double force = 0.0;
    for (const ContactPoint& point : shot.contacts)
      if (point.other == kPushName) force += point.pressed();
    EXPECT_GT(force, 0.05);
    const std::vector<float> pressure = contactPressure(shot, body);
    ASSERT_EQ(body.surface.size(), pressure.size());
    double sum = 0.0;
    for (const Triangle& t : body.model->surface.triangles) {
      const auto at = [&](int k) { return body.surface[t[k]]; };
      const double third = (at(1) - at(0)).cross(at(2) - at(0)).norm() / 6.0;
      for (const Index v : t) sum += third * static_cast<double>(pressure[v]);
    }
    EXPECT_NEAR(force, sum, 1e-4 * force);
    if (divided < 30) continue;
    for (Index v = 0; v < pressure.size(); ++v) {
      EXPECT_GE(pressure[v], 0.0f);
      if ((body.surface[v] - shot.push.position).norm() > 0.01 + 2.0 * body.model->spacing)
        EXPECT_EQ(0.0f, pressure[v]);
    }
  }
}

TEST(ContactPressure, IsNotOfTheGroundAndEmptyWhereNothingPresses) {
  const WorldSnapshot shot = pressed(4, -0.003);
  EXPECT_FALSE(shot.contacts.empty());  // it lies
  EXPECT_TRUE(contactPressure(shot, shot.bodies[0]).empty());
}

}  // namespace contact_pressure_test
}  // namespace meshless
