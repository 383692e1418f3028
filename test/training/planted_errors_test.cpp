// Errors of known size, made by commands in a world, must come out as large as they are, live as from the log.
#include <cmath>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "shapes/organs.h"
#include "support/plane_cut.h"
#include "training/played.h"

namespace meshless {
namespace {

using test::Played;

constexpr double kWithin = 0.02;

struct Case {
  std::string name;
  BodyDef def;
};

const std::vector<Case>& cases() {
  static const std::vector<Case> all = [] {
    std::vector<Case> made;
    made.push_back({"block", test::block("tissue", Vec3(0.1, -0.2, 0.3))});
    made.push_back({"ball", test::ball("tissue", Vec3(-0.1, 0.1, 0.2))});
    made.push_back({"liver", test::defOf(liverMesh(), "tissue")});
    made.back().def.pose.translation = Vec3(0.02, 0.05, 0.4);
    made.back().def.pose.rotation = Quat(Eigen::AngleAxisd(0.4, Vec3(0.3, 0.1, 0.9).normalized()));
    return made;
  }();
  return all;
}

TriangleMesh placed(const BodyDef& def) {
  TriangleMesh mesh = def.mesh;
  for (Vec3& p : mesh.vertices) p = def.pose * p;
  return mesh;
}

/// A plane normal to x that leaves a third of the bounds above it.
double cutPlace(const BodyDef& def) {
  const Box bounds = boundsOf(placed(def).vertices);
  return bounds.min.x() + 0.66 * (bounds.max.x() - bounds.min.x());
}

CutCommand cutAt(double x) {
  CutCommand cut;
  cut.blades.origin = Vec3(x, -1.0, 0.3);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3::UnitZ();
  return cut;
}

CutPlan planAt(double x) {
  CutPlan plan;
  plan.body = "tissue";
  plan.origin = Vec3(x, -1.0, 1.0);
  plan.along = Vec3::UnitY();
  plan.out = Vec3::UnitZ();
  plan.length = plan.depth = 2.0;
  return plan;
}

double volumeAbove(const BodyDef& def, double x) {
  const auto cut = cutByPlane(placed(def), {Vec3::UnitX(), Vec3(x, 0, 0)});
  EXPECT_TRUE(cut.ok());
  double volume = 0.0;
  for (const CutPiece& piece : cut->pieces)
    if (piece.side > 0) volume += signedVolume(piece.mesh);
  return volume;
}

TEST(PlantedErrors, ACutTwoMillimetresOffItsPlan) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    TaskDef task = test::openTask();
    task.plan = planAt(cutPlace(c.def));
    task.plan->tolerance = 0.001;
    Played played(test::weightless(), task);
    ASSERT_TRUE(played.world.addSceneBody(test::shared(c.def)).ok());
    played.begin();
    played.step(3);
    EXPECT_TRUE(std::isnan(played.value("plan_rms")));
    const auto cut = played.apply<CutReply>(cutAt(cutPlace(c.def) + 0.002));
    played.step(3);
    EXPECT_NEAR(0.002, played.value("plan_rms"), kWithin * 0.002);
    // Where the section is narrower there, its rim is farther from the plan.
    EXPECT_GT(played.value("plan_hausdorff"), (1.0 - kWithin) * 0.002);
    EXPECT_LT(played.value("plan_hausdorff"), c.name == "block" ? (1.0 + kWithin) * 0.002 : 0.01);
    EXPECT_NEAR(cut.cap_area, played.value("cut_area"), kWithin * cut.cap_area);
    EXPECT_NEAR(cut.cap_area, played.value("off_plan_area"), kWithin * cut.cap_area);
    EXPECT_EQ(1.0, played.value("cuts"));
    EXPECT_EQ(0.0, played.training.tissue().planDone());
    played.apply<UndoCutReply>(UndoCutCommand{});
    played.step(2);
    EXPECT_EQ(1.0, played.value("undos"));
    EXPECT_EQ(0.0, played.value("cut_area"));
    played.apply<CutReply>(cutAt(cutPlace(c.def)));
    played.step(2);
    EXPECT_LT(played.value("plan_rms"), 1e-5);
    EXPECT_EQ(1.0, played.training.tissue().planDone());
    test::expectSame(played.training, *played.replayed());
  }
}

TEST(PlantedErrors, APeakOfThreeNewton) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    TaskDef task = test::openTask();
    task.limits.measured.force = 2.0;
    BodyDef def = c.def;
    def.fixed.emplace_back(Vec3::Constant(-9.0), Vec3::Constant(9.0));  // so that the spring alone gives way
    Played played(test::weightless(), task);
    ASSERT_TRUE(played.world.addSceneBody(test::shared(def)).ok());
    played.begin();
    PickCommand pick;
    pick.point = placed(def).vertices[0];
    pick.max_distance = 0.1;
    pick.stiffness = 500.0;
    const auto picked = played.apply<PickReply>(pick);
    played.step(10);
    for (const double force : {1.0, 3.0, 2.5}) {
      played.apply<Done>(MovePickCommand{picked.pick, picked.position + force / 500.0 * Vec3(0, 0.6, 0.8)});
      played.step(60);
    }
    EXPECT_NEAR(3.0, played.value("force_peak"), kWithin * 3.0);
    EXPECT_EQ(played.most_force, played.value("force_peak"));
    EXPECT_NEAR(0.5 * (1.0 + 3.0 + 2.5), played.value("impulse"), kWithin * 3.25);
    EXPECT_NEAR(6.5 / 3.0, played.value("force_mean"), kWithin * 2.2);
    EXPECT_NEAR(1.0, played.value("force_time_above"), kWithin);
    test::expectSame(played.training, *played.replayed());
  }
}

TEST(PlantedErrors, FivePercentOfHealthyTissueRemoved) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const double at = cutPlace(c.def), removed = volumeAbove(c.def, at);
    double low = at, high = boundsOf(placed(c.def).vertices).max.x() - 1e-4;
    for (int k = 0; k < 25; ++k)
      (volumeAbove(c.def, 0.5 * (low + high)) > 0.95 * removed ? low : high) = 0.5 * (low + high);
    TaskDef task = test::openTask();
    task.target = Target{"tissue", Region::below({-Vec3::UnitX(), Vec3(low, 0, 0)})};
    Played played(test::weightless(), task);
    ASSERT_TRUE(played.world.addSceneBody(test::shared(c.def)).ok());
    played.begin();
    played.step(2);
    EXPECT_EQ(1.0, played.value("target_left"));
    const auto cut = played.apply<CutReply>(cutAt(at));
    ASSERT_EQ(2u, cut.new_bodies.size());
    played.step(2);
    EXPECT_NEAR(low - at, played.value("margin_least"), kWithin * (low - at));
    EXPECT_NEAR(low - at, played.value("margin_mean"), kWithin * (low - at));
    const WorldSnapshot shot = played.world.snapshot({});
    for (const BodySnapshot& body : shot.bodies)
      if (std::abs(body.model->rest_volume - removed) < 1e-3 * removed) played.apply<Done>(RemoveCommand{body.name});
    played.step(2);
    EXPECT_NEAR(removed, played.value("volume_removed"), 1e-3 * removed);
    EXPECT_NEAR(0.05, played.value("healthy_share"), kWithin * 0.05);
    EXPECT_NEAR(0.0, played.value("target_left"), 1e-3);
    test::expectSame(played.training, *played.replayed());
  }
}

TEST(PlantedErrors, APathOfKnownLength) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    Played played(test::weightless(), test::openTask());
    ASSERT_TRUE(played.world.addSceneBody(test::shared(c.def)).ok());
    played.begin();
    PickCommand pick;
    pick.point = placed(c.def).vertices[0];
    pick.max_distance = 0.1;
    pick.stiffness = 1.0;
    const auto picked = played.apply<PickReply>(pick);
    played.step(30);
    // Along three edges of a square of 0.06 m, in a second each, with a rest of a quarter of a second between.
    const Quat turn(Eigen::AngleAxisd(0.6, Vec3(0.3, -0.5, 0.8).normalized()));
    const Vec3 corners[] = {Vec3(0, 0, 0), turn * Vec3(0.06, 0, 0), turn * Vec3(0.06, 0.06, 0),
                            turn * Vec3(0, 0.06, 0)};
    for (int edge = 0; edge < 3; ++edge) {
      for (int k = 1; k <= 120; ++k) {
        const double u = k / 120.0, s = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
        played.apply<Done>(
            MovePickCommand{picked.pick, picked.position + (1.0 - s) * corners[edge] + s * corners[edge + 1]});
        played.step();
      }
      played.step(30);
    }
    played.apply<Done>(ReleaseCommand{picked.pick});
    played.step(60);
    EXPECT_NEAR(0.18, played.value("path_length.pick"), kWithin * 0.18);
    EXPECT_NEAR(0.06 / 0.18, played.value("economy.pick"), kWithin / 3.0);
    EXPECT_EQ(3.0, played.value("movements.pick"));
    EXPECT_TRUE(std::isnan(played.value("path_length.push")));
    EXPECT_NEAR(30 * 4 / 120.0 + 60 / 120.0, played.value("idle_time"), 0.3);
    EXPECT_NEAR(480 / 120.0 + 0.5 + 0.0, played.value("time"), 0.26);
    EXPECT_NEAR(-1.41, played.value("sparc.pick"), 0.1);  // of minimum jerk
    EXPECT_NEAR(-5.32, played.value("ldlj.pick"), 0.3);
    EXPECT_LT(played.value("tremor.pick"), 1e-4);
    EXPECT_EQ(0.0, played.value("hands_share"));
    EXPECT_EQ(0.0, played.value("hands_overlap"));
    test::expectSame(played.training, *played.replayed());
  }
}

TEST(PlantedErrors, ATremorOfEightHertzAndAMillimetre) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    Played played(test::weightless(), test::openTask());
    ASSERT_TRUE(played.world.addSceneBody(test::shared(c.def)).ok());
    played.begin();
    PickCommand pick;
    pick.point = placed(c.def).vertices[0];
    pick.max_distance = 0.1;
    pick.stiffness = 1.0;
    const auto picked = played.apply<PickReply>(pick);
    for (int k = 1; k <= 600; ++k) {
      const double t = k / 120.0;
      played.apply<Done>(MovePickCommand{picked.pick, picked.position + 0.02 * t * Vec3::UnitX() +
                                                          0.001 * std::sin(2.0 * M_PI * 8.0 * t) * Vec3(0, 0.6, 0.8)});
      played.step();
    }
    EXPECT_TRUE(std::isnan(played.value("sparc.pick")));  // it goes on
    played.training.stop();
    EXPECT_NEAR(0.001, played.value("tremor.pick"), kWithin * 0.001);
    EXPECT_LT(played.value("sparc.pick"), -1.8);
    test::expectSame(played.training, *played.replayed());
  }
}

}  // namespace
}  // namespace meshless
