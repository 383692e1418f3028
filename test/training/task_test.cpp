#include "meshless_surgery/training/task.h"

#include <cmath>

#include "meshless_surgery/geometry/primitives.h"
#include "training/played.h"

namespace meshless {
namespace {

using test::Played;

SceneDef blockScene() {
  SceneDef scene;
  scene.name = "scene";
  scene.bodies.push_back(test::block("tissue", Vec3(0, 0, 0.3)));
  scene.bodies.push_back(test::ball("other", Vec3(0.5, 0, 0.3)));
  return scene;
}

TaskDef withStage(Condition condition, double hold_for = 0.0) {
  TaskDef task;
  task.name = "task";
  task.stages.push_back({"stage", "", std::move(condition), hold_for});
  return task;
}

std::string faultOf(const TaskDef& task, const SceneDef& scene = blockScene()) {
  const auto fault = findTaskFault(task, scene);
  return fault ? fault->where + ": " + fault->what : "";
}

CutPlan middlePlan() {
  CutPlan plan;
  plan.body = "tissue";
  plan.origin = Vec3(0, -1, 1.3);
  plan.along = Vec3::UnitY();
  plan.length = plan.depth = 2.0;
  return plan;
}

TEST(TaskFault, NamesWhatCanNeverBe) {
  EXPECT_NE("", faultOf(TaskDef()));
  EXPECT_EQ("", faultOf(withStage(Reach{ToolKind::kPick, Region::sphere(Vec3(0, 0, 0.3), 0.1)})));
  EXPECT_NE(std::string::npos, faultOf(withStage(StretchTo{"tisue", 0.01})).find("no body 'tisue'"));
  EXPECT_EQ("", faultOf(withStage(StretchTo{"tissue", 0.01})));
  EXPECT_NE(std::string::npos, faultOf(withStage(CutAlong{0.9})).find("no plan"));
  EXPECT_NE(std::string::npos, faultOf(withStage(RemoveToTray{})).find("no target"));
  EXPECT_NE(std::string::npos, faultOf(withStage(LeaveNothing{0.1})).find("no target"));
  EXPECT_NE(std::string::npos, faultOf(withStage(Separate{"tissue", "other"})).find("no attachment joins"));

  TaskDef plan = withStage(CutAlong{0.9});
  plan.plan = middlePlan();
  EXPECT_EQ("", faultOf(plan));
  plan.plan->origin.x() = 0.2;  // beside the block
  EXPECT_NE(std::string::npos, faultOf(plan).find("no part of the plan"));

  TaskDef target = withStage(RemoveToTray{});
  target.target = Target{"tissue", Region::sphere(Vec3(0, 0, 0.3), 0.02)};
  EXPECT_NE(std::string::npos, faultOf(target).find("no tray"));
  target.tray = Box{Vec3(1, 1, 0), Vec3(2, 2, 1)};
  EXPECT_EQ("", faultOf(target));
  target.target->region.centre.x() = 0.3;
  EXPECT_NE(std::string::npos, faultOf(target).find("no tissue of 'tissue'"));

  TaskDef time = withStage(StretchTo{"tissue", 0.01}, 8.0);
  time.limits.time = 10.0;
  EXPECT_EQ("", faultOf(time));
  time.stages.push_back(time.stages[0]);
  EXPECT_NE(std::string::npos, faultOf(time).find("16 s together"));

  TaskDef force = withStage(PressTo{ToolKind::kPush, 3.0, std::nullopt});
  force.limits.measured.force = 2.0;
  EXPECT_EQ("", faultOf(force));  // a limit that ends nothing
  force.limits.ends.insert(LimitKind::kForce);
  EXPECT_NE(std::string::npos, faultOf(force).find("can never be met"));

  TaskDef forbidden = withStage(Reach{ToolKind::kPick, Region::sphere(Vec3(0, 0, 0.3), 0.1)});
  forbidden.limits.measured.forbidden.push_back({"all", "", Region(Vec3(-1, -1, -1), Vec3(1, 1, 1))});
  EXPECT_EQ("", faultOf(forbidden));
  forbidden.limits.ends.insert(LimitKind::kForbidden);
  EXPECT_NE(std::string::npos, faultOf(forbidden).find("can never be met"));
}

TEST(TaskProgress, HoldsWithoutABreakAndInOrder) {
  TaskDef task = withStage(Reach{ToolKind::kPush, Region::sphere(Vec3(1, 0, 1), 0.05)}, 0.5);
  task.stages.push_back({"second", "", LetGo{}, 0.0});
  Played played(test::weightless(), task);
  ASSERT_TRUE(played.world.addSceneBody(test::shared(test::ball("tissue"))).ok());
  played.begin();
  PushCommand push;
  push.position = Vec3(1, 0, 1);
  played.apply<Done>(push);
  played.step(50);
  EXPECT_EQ(0u, played.training.progress().stage());
  push.position = Vec3(2, 0, 1);
  played.apply<Done>(push);
  played.step(5);
  push.position = Vec3(1, 0, 1);
  played.apply<Done>(push);
  played.step(59);
  EXPECT_EQ(0u, played.training.progress().stage());
  played.step(2);
  EXPECT_EQ(1u, played.training.progress().stage());
  EXPECT_FALSE(played.training.over());
  push.enable = false;
  played.apply<Done>(push);
  played.step(2);
  EXPECT_TRUE(played.training.progress().done());
  EXPECT_EQ(100.0, played.training.score());
  EXPECT_TRUE(played.training.passed());
  const double time = played.value("time");
  played.step(20);
  EXPECT_EQ(time, played.value("time"));  // it is over
  EXPECT_EQ(2.0, played.value("stages"));
  test::expectSame(played.training, *played.replayed());
}

TEST(TaskProgress, FailsWithTheReason) {
  TaskDef task = test::openTask();
  task.limits.time = 0.25;
  Played late(test::weightless(), task);
  ASSERT_TRUE(late.world.addSceneBody(test::shared(test::ball("tissue"))).ok());
  late.begin();
  late.step(30);
  EXPECT_FALSE(late.training.over());
  late.step(1);
  EXPECT_NE(std::string::npos, late.training.progress().failed().find("0.25 s"));
  EXPECT_FALSE(late.training.passed());

  task.limits.time.reset();
  task.limits.measured.forbidden.push_back({"there", "", Region::sphere(Vec3(1, 0, 1), 0.05)});
  for (const bool ends : {false, true}) {
    if (ends) task.limits.ends.insert(LimitKind::kForbidden);
    Played there(test::weightless(), task);
    ASSERT_TRUE(there.world.addSceneBody(test::shared(test::ball("tissue"))).ok());
    there.begin();
    for (int time = 0; time < 2; ++time) {
      PushCommand push;
      push.position = Vec3(1, 0, 1);
      there.apply<Done>(push);
      there.step(12);
      push.position = Vec3(2, 0, 1);
      there.apply<Done>(push);
      there.step(12);
    }
    EXPECT_EQ(ends, there.training.over());
    EXPECT_EQ(ends ? 1.0 : 2.0, there.value("forbidden_contacts"));
    EXPECT_NEAR(ends ? 1.0 / 120.0 : 0.2, there.value("forbidden_time"), 1e-9);
  }
}

TEST(TaskProgress, SeparatesTwoBodies) {
  WorldSettings settings = test::weightless();
  TaskDef task = withStage(Separate{"below", "above"});
  Played played(settings, task);
  ASSERT_TRUE(played.world.addSceneBody(test::shared(test::block("below", Vec3(0, 0, 0.2)))).ok());
  ASSERT_TRUE(played.world.addSceneBody(test::shared(test::block("above", Vec3(0, 0, 0.302)))).ok());
  AttachCommand attach;
  attach.body = "above";
  attach.other = "below";
  attach.distance = 0.005;
  attach.stiffness = 1e5;
  ASSERT_TRUE(played.world.addSceneAttachment(attach).ok());
  played.begin();
  played.step(5);
  EXPECT_FALSE(played.training.over());
  CutCommand cut;
  cut.blades = {Vec3(-1, 0, 0.251), Vec3::UnitX(), Vec3::UnitY(), 0.0, 0.0};
  ASSERT_TRUE(played.world.apply(cut).ok());
  played.step(2);
  EXPECT_TRUE(played.training.progress().done());
  test::expectSame(played.training, *played.replayed());
}

TEST(Training, BeginsAnewWithAReset) {
  Played played(test::weightless(), test::openTask());
  ASSERT_TRUE(played.world.addSceneBody(test::shared(test::ball("tissue"))).ok());
  played.begin();
  played.step(50);
  CutCommand cut;
  cut.blades = {Vec3(-1, 0, 0.2), Vec3::UnitX(), Vec3::UnitY(), 0.0, 0.0};
  played.apply<CutReply>(cut);  // between two steps, and before the reset
  played.world.reset();
  played.step(7);
  EXPECT_EQ(0.0, played.value("cuts"));
  EXPECT_EQ(0.0, played.value("cut_area"));
  EXPECT_NEAR(7 / 120.0, played.value("time"), 1e-12);
  test::expectSame(played.training, *played.replayed());
}

TEST(Training, RefusesTheWorldOfAnotherScene) {
  TaskDef task = withStage(StretchTo{"spleen", 0.01});
  Training training(task);
  World world(test::weightless());
  ASSERT_TRUE(world.addSceneBody(test::shared(test::ball("tissue"))).ok());
  world.step();
  const Status fed = training.feed(frameOf(world, world.takeEvents(), training.wants()));
  ASSERT_FALSE(fed.ok());
  EXPECT_NE(std::string::npos, fed.error().detail.find("spleen"));
  EXPECT_NE(std::string::npos, fed.error().detail.find("tissue"));
  EXPECT_FALSE(training.begun());
}

TEST(Training, AsksForNothingThatItsTaskDoesNotNeed) {
  TaskDef task = test::openTask();
  EXPECT_FALSE(Training(task).wants().any());
  task.metrics.push_back({"strain_peak", 1.0, 0.1, 1.0, {}});
  EXPECT_TRUE(Training(task).wants().strain_limit.has_value());
  EXPECT_FALSE(Training(task).wants().centres);
}

TEST(Score, IsEvenBetweenGoodAndBad) {
  const WeightedMetric lower{"time", 1.0, 10.0, 30.0, 20.0}, higher{"sparc.pick", 1.0, -1.5, -3.5, {}};
  EXPECT_EQ(1.0, scoreOf(lower, 5.0));
  EXPECT_EQ(0.5, scoreOf(lower, 20.0));
  EXPECT_EQ(0.0, scoreOf(lower, 31.0));
  EXPECT_EQ(0.75, scoreOf(higher, -2.0));
  EXPECT_EQ(0.0, scoreOf(higher, std::nan("")));
  EXPECT_TRUE(passes(lower, 20.0));
  EXPECT_FALSE(passes(lower, 20.1));
  EXPECT_FALSE(passes(lower, std::nan("")));
  EXPECT_TRUE(passes(higher, std::nan("")));
}

}  // namespace
}  // namespace meshless
