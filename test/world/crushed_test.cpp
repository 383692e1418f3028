// Soft bodies that a fall presses through themselves: what is crumpled unfolds.
#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"

namespace meshless {
namespace crushed_test {

struct Shape {
  std::string name;
  TriangleMesh mesh;
  double spacing;  // [m]
  bool round;      // its height is the same whatever it has rolled on
};

std::vector<Shape> shapes() {
  return {{"ball of 2 cm", sphereMesh(0.02, 0.006), 0.005, true},
          {"ball of 5 cm", sphereMesh(0.05, 0.012), 0.012, true},
          {"torus", torusMesh(0.05, 0.02, 0.01), 0.009, false},
          {"organ", *randomOrgan(1, 0, 0.1, 2000), 0.01, false},
          {"organ with a handle", *randomOrgan(2, 1, 0.12, 2000), 0.01, false}};
}

struct Fall {
  double youngs_modulus, poissons_ratio, damping, height;  // [Pa], 1, [1/s], [m]
};

double heightOf(const Points& points) {
  Box box;
  for (const Vec3& p : points) box.extend(p);
  return box.max.z() - box.min.z();
}

struct Seen {
  double volume = 0.0, height = 0.0;  // [m^3], [m] two seconds after it met the ground
  std::size_t collapsed = 0;          // events
};

Seen fallen(const Shape& shape, const Fall& fall, double height) {
  BodyDef def = test::defOf(shape.mesh);
  def.spacing = shape.spacing;
  def.pose.translation.z() = height - boundsOf(shape.mesh.vertices).min.z();
  def.material.youngs_modulus = fall.youngs_modulus;
  def.material.poissons_ratio = fall.poissons_ratio;
  def.material.damping = fall.damping;
  World world{WorldSettings()};
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  const double seconds = std::sqrt(2.0 * height / 9.81) + 2.0;
  Seen seen;
  for (int step = 0; step < seconds * WorldSettings().step_rate; ++step) {
    world.step();
    for (const Event& event : world.takeEvents()) seen.collapsed += event.type == EventType::kCollapsed;
  }
  const BodySnapshot body = world.snapshot({true, false, true}).bodies[0];
  seen.volume = body.measures.volume;
  seen.height = heightOf(body.surface);
  return seen;
}

// Surfaces that were pressed through each other are not held on the wrong sides.
void expectThatItUnfolds(const Shape& shape, const Fall& fall) {
  SCOPED_TRACE(testing::Message() << shape.name << ", " << fall.youngs_modulus << " Pa, " << fall.poissons_ratio);
  const Seen laid = fallen(shape, fall, 0.0005), after = fallen(shape, fall, fall.height);
  EXPECT_NEAR(after.volume, laid.volume, 0.05 * laid.volume);
  if (shape.round) EXPECT_GT(after.height, 0.9 * laid.height) << "higher where it bounces on";
}

TEST(Crushed, WhoFellIsSoonAsLargeAndAsHighAsWhoWasLaidDown) {
  expectThatItUnfolds(shapes()[1], {1200.0, 0.3, 10.0, 0.3});
  expectThatItUnfolds(shapes()[3], {3000.0, 0.3, 10.0, 1.0});
}

TEST(Crushed, WhateverFellIsSoonAsLargeAndAsHighAsWhatWasLaidDown_Long) {
  for (const Shape& shape : shapes())
    for (const Fall& fall : {Fall{1200.0, 0.3, 10.0, 0.3}, Fall{1000.0, 0.45, 10.0, 0.3}, Fall{3000.0, 0.3, 10.0, 1.0},
                             Fall{3000.0, 0.45, 2.0, 1.0}})
      expectThatItUnfolds(shape, fall);
}

TEST(Crushed, ABodyThatIsBelowAFifthOfItsVolumeSaysSo) {
  const Shape ball{"ball", sphereMesh(0.05, 0.012), 0.012, true};
  const Fall soft{1000.0, 0.3, 10.0, 0.3};
  EXPECT_EQ(fallen(ball, soft, 0.0005).collapsed, 0u);
  EXPECT_GE(fallen(ball, soft, 1.0).collapsed, 1u);
}

}  // namespace crushed_test
}  // namespace meshless
