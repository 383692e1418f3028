// What an endoscope shows: where a body is in its picture, what hides it, and the stage that asks for it.
#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/training/training.h"
#include "support/bodies.h"
#include "support/random.h"

namespace meshless {
namespace see_test {

constexpr double kBall = 0.01;  // [m]

BodyDef ball(const std::string& name, const Vec3& at) {
  BodyDef def;
  def.name = name;
  def.mesh = sphereMesh(kBall, 0.003);
  def.pose.translation = at;
  def.spacing = 0.005;
  def.material.youngs_modulus = 2e4;
  return def;
}

InstrumentDef endoscope(const Pose& pose, double view_angle) {
  InstrumentDef def;
  def.name = "scope";
  def.type = InstrumentType::kEndoscope;
  def.pose = pose;
  def.view_angle = view_angle;
  return def;
}

World weightless() {
  WorldSettings settings;
  settings.gravity.setZero();
  settings.ground.reset();
  return World(settings);
}

FrameWants looksFor(const std::vector<std::string>& bodies) {
  FrameWants wants;
  wants.seen = bodies;
  return wants;
}

/// What the first tool shows next.
std::vector<TrainingFrame::Shown> shownIn(World& world, const FrameWants& wants) {
  for (int k = 0; k < 1000; ++k) {
    world.step();
    const TrainingFrame frame = frameOf(world, world.takeEvents(), wants);
    if (frame.pictures) return frame.tools.at(0).shown;
  }
  ADD_FAILURE() << "no picture";
  return {};
}

Quat turn(double angle, const Vec3& axis) { return Quat(Eigen::AngleAxisd(angle, axis)); }

TEST(Endoscope, IsUprightWhereverItLooks) {
  test::Random random(5);
  for (int k = 0; k < 200; ++k) {
    const Pose pose{random.rotation(), random.vector(1.0)};
    const InstrumentDef def = endoscope(pose, random.uniform(0.0, 1.5));
    const Mat3 sight = sightOf(def, pose).rotation.toRotationMatrix();
    EXPECT_NEAR(std::cos(def.view_angle), sight.col(0).dot(pose.rotation * Vec3::UnitX()), 1e-9);
    EXPECT_NEAR(0.0, sight.col(0).dot(pose.rotation * Vec3::UnitY()), 1e-9) << "it looks to its own -z";
    EXPECT_LE(sight.col(0).dot(pose.rotation * Vec3::UnitZ()), 1e-9);
    EXPECT_NEAR(0.0, sight(2, 1), 1e-9) << "the horizon is level";
    EXPECT_GE(sight(2, 2), 0.0) << "up is up";
  }
  const Pose down{turn(0.5 * M_PI, Vec3::UnitY()), Vec3::Zero()};
  EXPECT_TRUE(sightOf(endoscope(down, 0.0), down).rotation.coeffs().allFinite());
}

TEST(Endoscope, ShowsWhereAPinholeWould) {
  test::Random random(11);
  for (int k = 0; k < 20; ++k) {
    World world = weightless();
    const Vec3 at = random.vector(0.05);
    ASSERT_TRUE(world.addSceneBody(test::shared(ball("ball", at))).ok());
    const Vec3 away = random.unit();
    const Vec3 tip = at + random.uniform(0.03, 0.2) * away;
    // Turned so that the shaft does not go through the ball.
    const Pose pose{(Quat::FromTwoVectors(Vec3::UnitX(), -away) * turn(random.uniform(-M_PI, M_PI), Vec3::UnitX()) *
                     turn(random.uniform(-0.8, 0.8), Vec3::UnitY()))
                        .normalized(),
                    tip};
    InstrumentDef def = endoscope(pose, random.uniform(0.0, 1.2));
    def.field_of_view = random.uniform(0.5, 2.0);
    ASSERT_TRUE(world.addSceneInstrument(def).ok());
    const auto shown = shownIn(world, looksFor({"ball"}));
    ASSERT_EQ(1u, shown.size());
    EXPECT_EQ("ball", shown[0].body);
    EXPECT_FALSE(shown[0].hidden);
    // In the camera's own frame, by angles.
    const Pose sight = sightOf(def, pose);
    const Vec3 seen = sight.rotation.conjugate() * (at - sight.translation);
    const double aside = std::acos(seen.normalized().x());
    EXPECT_NEAR(aside / (0.5 * def.field_of_view), shown[0].off_centre, 0.02);
    const double wide = 2.0 * std::asin(kBall / seen.norm());
    EXPECT_NEAR(wide / def.field_of_view, shown[0].fills, 0.05 * shown[0].fills);
  }
}

TEST(Endoscope, DoesNotLookThroughTissueAndWalls) {
  const Pose pose{Quat::Identity(), Vec3(-0.1, 0, 0)};
  for (const bool wall : {true, false})
    for (const double beside : {0.0, 0.009, 0.03}) {
      World world = weightless();
      ASSERT_TRUE(world.addSceneBody(test::shared(ball("ball", Vec3::Zero()))).ok());
      if (wall) {
        TriangleMesh box = boxMesh(Vec3(0.004, 0.02, 0.02), 0.005);
        for (Vec3& p : box.vertices) p += Vec3(-0.05, beside, 0);
        ASSERT_TRUE(world.addObstacle({"wall", box, 0.5, {}}).ok());
      } else {
        ASSERT_TRUE(world.addSceneBody(test::shared(ball("other", Vec3(-0.05, beside, 0)))).ok());
      }
      ASSERT_TRUE(world.addSceneInstrument(endoscope(pose, 0.0)).ok());
      const auto shown = shownIn(world, looksFor({"ball"}));
      ASSERT_EQ(1u, shown.size());
      EXPECT_EQ(beside < 0.01, shown[0].hidden) << wall << " " << beside;
    }
  // What is behind it hides nothing.
  World world = weightless();
  ASSERT_TRUE(world.addSceneBody(test::shared(ball("ball", Vec3::Zero()))).ok());
  ASSERT_TRUE(world.addSceneBody(test::shared(ball("other", Vec3(0.05, 0, 0)))).ok());
  ASSERT_TRUE(world.addSceneInstrument(endoscope(pose, 0.0)).ok());
  const auto shown = shownIn(world, looksFor({"ball", "other"}));
  ASSERT_EQ(2u, shown.size());
  EXPECT_FALSE(shown[0].hidden);
  EXPECT_TRUE(shown[1].hidden);
}

TEST(SeeStage, IsMetByTheRightPictureHeldForSoLong) {
  const double distance = 0.1, at_rim = 0.6;  // [m], [rad]: half of the field of view
  const double fills = std::asin(kBall / distance) / at_rim;
  struct Case {
    double aside;  // [rad] of the line of sight
    double least, most, time;
    bool met;
  };
  for (const Case& c : {Case{0.0, 0.05, 1.0, 1.2, true}, Case{0.0, 0.05, 1.0, 0.8, false},
                        Case{0.28 * at_rim, 0.05, 1.0, 1.2, true}, Case{0.32 * at_rim, 0.05, 1.0, 1.2, false},
                        Case{2.0, 0.05, 1.0, 1.2, false}, Case{0.0, 1.05 * fills, 1.0, 1.2, false},
                        Case{0.0, 0.95 * fills, 1.05 * fills, 1.2, true}, Case{0.0, 0.05, 0.95 * fills, 1.2, false}}) {
    World world = weightless();
    ASSERT_TRUE(world.addSceneBody(test::shared(ball("ball", Vec3::Zero()))).ok());
    const Pose pose{turn(c.aside, Vec3::UnitZ()), Vec3(-distance, 0, 0)};
    ASSERT_TRUE(world.addSceneInstrument(endoscope(pose, 0.0)).ok());
    TaskDef task;
    task.name = "task";
    See see;
    see.body = "ball";
    see.fills_least = c.least;
    see.fills_most = c.most;
    task.stages.push_back({"see", "", see, 1.0});
    Training training(task);
    for (int k = 0; k < std::lround(c.time * world.settings().step_rate); ++k) {
      world.step();
      ASSERT_TRUE(training.feed(frameOf(world, world.takeEvents(), training.wants())).ok());
    }
    EXPECT_EQ(c.met, training.progress().done()) << c.aside << " " << c.least << " " << c.most << " " << c.time;
  }
}

}  // namespace see_test
}  // namespace meshless
