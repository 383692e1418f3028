#include "meshless_surgery/training/rest_tissue.h"

#include <cmath>

#include "training/played.h"

namespace meshless {
namespace rest_tissue_test {

using test::Played;

CutCommand across(double x) {
  CutCommand cut;
  cut.blades = {Vec3(x, -1, 0), Vec3::UnitY(), Vec3::UnitZ(), 0.0, 0.0};
  return cut;
}

TEST(RestTissue, APlanIsWhereACopyWasPut) {
  TaskDef task = test::openTask();
  CutPlan plan;
  plan.body = "copy";
  plan.origin = Vec3(1.02, -1, 1);
  plan.along = Vec3::UnitY();
  plan.length = plan.depth = 2.0;
  task.plan = plan;
  Played played(test::weightless(), task);
  const PreparedBody first = test::prepared(test::block("first", Vec3(0, 0, 0.2)));
  const Pose pose{Quat(Eigen::AngleAxisd(0.5, Vec3::UnitZ())), Vec3(1, 0, 0.2)};
  ASSERT_TRUE(played.world.addSceneBody(std::make_shared<const PreparedBody>(placedCopy(first, "copy", pose))).ok());
  played.begin();
  played.step(2);
  played.apply<CutReply>(across(1.023));
  played.step(2);
  EXPECT_NEAR(0.003, played.value("plan_rms"), 1e-5);
  EXPECT_FALSE(played.training.tissue().planPoints().empty());
  test::expectSame(played.training, *played.replayed());
}

TEST(RestTissue, WhatWasRemovedOfAnUndoneCutIsThereAgain) {
  TaskDef task = test::openTask();
  task.target = Target{"block", Region::sphere(Vec3(0.06, 0, 0.2), 0.02)};
  Played played(test::weightless(), task);
  ASSERT_TRUE(played.world.addSceneBody(test::shared(test::block("block", Vec3(0, 0, 0.2)))).ok());
  played.begin();
  played.step(2);
  played.apply<CutReply>(across(0.02));
  played.step(1);
  const WorldSnapshot shot = played.world.snapshot({});
  const bool first = shot.bodies[0].model->rest_volume < shot.bodies[1].model->rest_volume;
  played.apply<Done>(RemoveCommand{shot.bodies[first ? 0 : 1].name});
  played.step(1);
  EXPECT_NEAR(0.08 * 0.1 * 0.1, played.value("volume_removed"), 1e-6);
  EXPECT_NEAR(0.0, played.value("target_left"), 1e-3);
  EXPECT_TRUE(played.training.tissue().targetRemoved());
  EXPECT_NEAR(0.01, played.value("cut_area"), 1e-5);  // of both sides, though one is gone
  played.apply<UndoCutReply>(UndoCutCommand{});
  played.step(1);
  EXPECT_EQ(0.0, played.value("volume_removed"));
  EXPECT_EQ(1.0, played.value("target_left"));
  EXPECT_EQ(0.0, played.value("cut_area"));
  EXPECT_TRUE(std::isnan(played.value("margin_least")));
  test::expectSame(played.training, *played.replayed());
}

TEST(RestTissue, WhatIsCutAndRemovedInOneStepIsMeasured) {
  // With a step between the two, and in one: the same.
  std::vector<std::vector<MetricValue>> told;
  for (const int between : {1, 0}) {
    TaskDef task = test::openTask();
    task.target = Target{"block", Region::sphere(Vec3(0.06, 0, 0.2), 0.02)};
    Played played(test::weightless(), task);
    ASSERT_TRUE(played.world.addSceneBody(test::shared(test::block("block", Vec3(0, 0, 0.2)))).ok());
    played.begin();
    played.step(3 - between);
    const auto cut = played.apply<CutReply>(across(0.02));
    played.step(between);
    const WorldSnapshot shot = played.world.snapshot({});
    ASSERT_EQ(2u, shot.bodies.size());
    const bool first = shot.bodies[0].model->rest_volume < shot.bodies[1].model->rest_volume;
    played.apply<Done>(RemoveCommand{shot.bodies[first ? 0 : 1].name});
    played.step(1);
    EXPECT_NEAR(0.08 * 0.1 * 0.1, played.value("volume_removed"), 1e-6);
    EXPECT_NEAR(0.0, played.value("target_left"), 1e-3);
    EXPECT_NEAR(0.01, played.value("cut_area"), 1e-5);
    EXPECT_TRUE(played.training.tissue().targetRemoved());
    told.push_back(played.training.values());
    test::expectSame(played.training, *played.replayed());
  }
  for (std::size_t k = 0; k < told[0].size(); ++k)
    EXPECT_TRUE(std::isnan(told[0][k].value) ? std::isnan(told[1][k].value)
                                             : std::abs(told[0][k].value - told[1][k].value) < 1e-12)
        << told[0][k].name << " " << told[0][k].value << " " << told[1][k].value;
}

TEST(RestTissue, TheTrayTakesWhatLiesInIt) {
  TaskDef task = test::openTask();
  task.target = Target{"block", Region::sphere(Vec3(0.06, 0, 0.2), 0.02)};
  task.tray = Box{Vec3(0.02, -1, 0), Vec3(1, 1, 1)};
  Played played(test::weightless(), task);
  ASSERT_TRUE(played.world.addSceneBody(test::shared(test::block("block", Vec3(0, 0, 0.2)))).ok());
  played.begin();
  played.step(24);
  EXPECT_EQ(0.0, played.value("volume_removed"));  // its middle is beside the tray
  played.apply<CutReply>(across(0.0));
  played.step(24);
  EXPECT_NEAR(1e-3, played.value("volume_removed"), 1e-6);  // half of it
  EXPECT_TRUE(played.training.tissue().targetRemoved());
  EXPECT_NEAR(1.0 - 4.0 / 3.0 * M_PI * 8e-6 / 1e-3, played.value("healthy_share"), 1e-3);
  EXPECT_NEAR(0.04, played.value("margin_least"), 1e-4);
  test::expectSame(played.training, *played.replayed());
}

}  // namespace rest_tissue_test
}  // namespace meshless
