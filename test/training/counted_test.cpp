// What counts: when a task begins, what ends it as failed, and what no trainee's hand does.
#include <limits>

#include "meshless_surgery/world/saved_world.h"
#include "training/played.h"

namespace meshless {
namespace {

using test::Played;

TaskDef pickTask() {
  TaskDef task;
  task.name = "task";
  task.stages.push_back({"hold", "", Hold{"block", 1, {}}, 0.1});
  task.metrics.push_back({"time", 1.0, 0.0, 10.0, {}});
  return task;
}

struct Session : Played {
  explicit Session(const TaskDef& task) : Played(test::weightless(), task) {
    EXPECT_TRUE(world.addSceneBody(test::shared(test::block())).ok());
    EXPECT_TRUE(world.addSceneBody(test::shared(test::ball("ball", Vec3(1, 0, 0.2)))).ok());
    BodyDef held = test::ball("held", Vec3(4, 0, 0.2));
    held.fixed = {HeldRegion(Vec3(3, -1, -1), Vec3(4, 1, 1))};
    EXPECT_TRUE(world.addSceneBody(test::shared(held)).ok());
    AttachCommand joint;
    joint.name = "joint";
    joint.body = "ball";
    joint.other = kWorldEnd;
    joint.stiffness = 1e4;
    joint.region = Region::sphere(Vec3(1, 0, 0.3), 0.05);
    EXPECT_TRUE(world.addSceneAttachment(joint).ok());
    begin();
  }
  PickReply pick(const Vec3& at = Vec3(-0.1, 0, 0.2)) {
    PickCommand command;
    command.point = at;
    command.max_distance = 0.05;
    return apply<PickReply>(command);
  }
};

CutCommand cutAcross(double x) {
  CutCommand cut;
  cut.blades.origin = Vec3(x, -1, 0.2);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3::UnitZ();
  cut.bodies = {"block"};
  return cut;
}

TEST(Counted, NothingIsScoredUntilAllStagesAreMet) {
  Session s(pickTask());
  s.step(60);
  EXPECT_EQ(0.0, s.training.score());
  s.pick();
  s.step(20);
  EXPECT_TRUE(s.training.passed());
  EXPECT_GT(s.training.score(), 90.0);
  EXPECT_TRUE(s.training.notCounted().empty());
}

TEST(Counted, WhatNoHandDoesIsSaidAndDoesNotPass) {
  using Do = std::function<void(Session&)>;
  const std::vector<std::pair<Intervention, Do>> all{
      {Intervention::kUndo,
       [](Session& s) {
         s.apply<CutReply>(cutAcross(0.05));
         s.apply<UndoCutReply>(UndoCutCommand{});
       }},
      {Intervention::kSlow,
       [](Session& s) {
         for (int k = 0; k < 200; ++k) {
           s.world.setWallTime(1e9 + k / 20.0);
           s.step();
         }
       }},
      {Intervention::kLoad,
       [](Session& s) {
         s.step(3);
         s.world.restore(*s.world.capture());
       }},
      {Intervention::kRemove, [](Session& s) { s.apply<Done>(RemoveCommand{"ball"}); }},
      {Intervention::kDetach,
       [](Session& s) {
         s.apply<DetachReply>(DetachCommand{"joint", {}});
       }},
      {Intervention::kAttach,
       [](Session& s) {
         AttachCommand attach;
         attach.body = "block";
         attach.other = kWorldEnd;
         attach.stiffness = 1e4;
         s.apply<AttachReply>(attach);
       }},
      {Intervention::kSpawn,
       [](Session& s) { s.apply<SpawnReply>(SpawnCommand{test::shared(test::ball("new", Vec3(2, 0, 0)))}); }},
      {Intervention::kMaterial,
       [](Session& s) {
         SetMaterialCommand command;
         command.change = [](const Material& now) -> Result<Material> { return now; };
         s.apply<Done>(command);
       }},
      {Intervention::kMoveClamp,
       [](Session& s) {
         MoveClampCommand command;
         command.body = "held";
         command.shift = Vec3(0, 0, 0.01);
         s.apply<MoveClampReply>(command);
       }},
      {Intervention::kGravity, [](Session& s) { s.apply<Done>(SetGravityCommand{Vec3(0, 0, -1e-3)}); }},
      {Intervention::kPlace,
       [](Session& s) {
         s.apply<Done>(PlaceBodyCommand{"held", {Quat::Identity(), Vec3(5, 0, 0)}});
       }},
      {Intervention::kResetBodies, [](Session& s) { s.apply<ResetBodiesReply>(ResetBodiesCommand{{"ball"}}); }},
      {Intervention::kForce,
       [](Session& s) {
         s.apply<ApplyForceReply>(ApplyForceCommand{"ball", {}, Vec3(0, 0, 1e-3), 0.1});
       }},
      {Intervention::kInstrument,
       [](Session& s) {
         AttachInstrumentCommand command;
         command.def.name = "left";
         command.def.pose.translation = Vec3(0, 0, 5);
         s.apply<Done>(command);
       }},
  };
  for (const auto& [intervention, act] : all)
    for (const bool allowed : {false, true}) {
      SCOPED_TRACE(std::string(toString(intervention)) + (allowed ? ", allowed" : ""));
      TaskDef task = pickTask();
      if (allowed) task.allow.insert(intervention);
      Session s(task);
      s.step(2);
      act(s);
      s.step(2);
      s.pick();
      s.step(20);
      EXPECT_TRUE(s.training.progress().done());
      EXPECT_EQ(allowed, s.training.passed());
      EXPECT_EQ(allowed, s.training.score() > 0.0);
      ASSERT_EQ(allowed ? 0u : 1u, s.training.notCounted().size());
      if (!allowed) EXPECT_NE(std::string::npos, s.training.notCounted()[0].find(toString(intervention)));
      const auto replayed = s.replayed();
      EXPECT_EQ(s.training.notCounted(), replayed->notCounted());
      test::expectSame(s.training, *replayed);
    }
}

TEST(Counted, WhatAHandDoesIsNoneOfThat) {
  Session s(pickTask());
  s.step(2);
  const auto picked = s.pick(Vec3(1, 0, 0.1));
  s.step(3);
  s.apply<Done>(ReleaseCommand{picked.pick});
  CutCommand cut = cutAcross(0.0);  // through the fibres of the joint
  cut.blades.origin = Vec3(0, -1, 0.295);
  cut.blades.x_axis = Vec3::UnitX();
  cut.blades.y_axis = Vec3::UnitY();
  cut.bodies.clear();
  (void)s.world.apply(cut);
  s.step(3);
  s.world.reset();
  s.step(3);
  s.pick();
  s.step(20);
  EXPECT_EQ(std::vector<std::string>(), s.training.notCounted());
  EXPECT_TRUE(s.training.passed());
}

TEST(Counted, ASavedStateIsNoBegin) {
  Session first(pickTask());
  first.step(5);
  const auto saved = first.world.capture();
  World world(test::weightless());
  world.restore(*saved);  // as a node that was killed takes it up
  (void)world.takeEvents();
  Training training(pickTask());
  world.step();
  ASSERT_TRUE(training.feed(frameOf(world, world.takeEvents(), training.wants())).ok());
  ASSERT_EQ(1u, training.notCounted().size());
  EXPECT_NE(std::string::npos, training.notCounted()[0].find("step 5"));
}

TEST(Counted, WhoStepsAWorldThatIsWatchedDoesNotCount) {
  for (const bool watched : {false, true}) {
    Session s(pickTask());
    for (int k = 0; k < 20; ++k) {
      if (watched) s.world.setWallTime(1e9 + k / 120.0);
      s.step();
    }
    s.world.setWallTime(std::numeric_limits<double>::quiet_NaN());
    s.pick();
    s.step(20);
    EXPECT_TRUE(s.training.progress().done());
    EXPECT_EQ(!watched, s.training.passed());
    EXPECT_EQ(watched ? 1u : 0u, s.training.notCounted().size());
    test::expectSame(s.training, *s.replayed());
  }
}

TEST(Counted, ALockedPickThatIsMovedIsAHand) {
  Session s(pickTask());
  const auto picked = s.pick();
  s.apply<Done>(LockCommand{picked.pick, {}});
  s.step(2);
  s.apply<Done>(LockCommand{picked.pick, picked.position + Vec3(-0.1, 0, 0)});
  s.step(2);
  s.apply<Done>(LockCommand{picked.pick, picked.position + Vec3(-0.2, 0, 0)});
  s.step(2);
  EXPECT_TRUE(std::isfinite(s.value("top_speed.pick")));
}

TEST(Counted, EachUndoCountsThoughNoTimePasses) {
  TaskDef task = pickTask();
  task.allow.insert(Intervention::kUndo);
  Session s(task);
  s.step(2);
  for (int k = 0; k < 7; ++k) {
    s.apply<CutReply>(cutAcross(0.01 * k));
    s.apply<UndoCutReply>(UndoCutCommand{});
  }
  s.step(2);
  EXPECT_EQ(7.0, s.value("cuts"));
  EXPECT_EQ(7.0, s.value("undos"));
  test::expectSame(s.training, *s.replayed());
}

TEST(Counted, AFailLimitEndsTheTaskAndSaysWhy) {
  TaskDef task = pickTask();
  task.limits.fail.push_back({"cuts", 1.0});
  task.limits.fail.push_back({"force_together_peak", 2.0});
  {
    Session s(task);
    s.step(2);
    s.apply<CutReply>(cutAcross(0.05));
    s.step(24);
    EXPECT_FALSE(s.training.over());
    s.apply<CutReply>([] {
      CutCommand cut = cutAcross(-0.05);
      cut.bodies.clear();
      return cut;
    }());
    s.step(24);
    EXPECT_EQ("cuts is 2, above the limit of 1", s.training.progress().failed());
    EXPECT_FALSE(s.training.passed());
    EXPECT_EQ(0.0, s.training.score());
    test::expectSame(s.training, *s.replayed());
  }
  {
    // Each of them pulls with less; and the last stage is met before anybody has looked.
    Session s(task);
    s.step(13);
    for (const double y : {-0.04, 0.0, 0.04}) {
      PickCommand pick;
      pick.point = Vec3(-0.1, y, 0.2);
      pick.max_distance = 0.05;
      pick.stiffness = 50.0;
      const auto picked = s.apply<PickReply>(pick);
      s.apply<Done>(MovePickCommand{picked.pick, picked.position - 0.02 * Vec3::UnitX()});
    }
    s.step(30);
    EXPECT_NE(std::string::npos, s.training.progress().failed().find("force_together_peak"))
        << s.training.progress().failed();
  }
  {
    // A metric of which more is better.
    TaskDef other = pickTask();
    other.target = Target{"block", Region::sphere(Vec3(0, 0, 0.2), 0.02)};
    other.limits.fail.push_back({"margin_least", 0.0});
    for (const double x : {0.05, 0.0}) {
      Session s(other);
      s.step(2);
      s.apply<CutReply>(cutAcross(x));
      s.step(24);
      EXPECT_EQ(x == 0.0, s.training.over());
    }
  }
}

TEST(Counted, BeginsWhenTheSceneHasSettledOrAHandActs) {
  TaskDef task = pickTask();
  task.settle = 0.5;
  for (const bool early : {false, true}) {
    SCOPED_TRACE(early);
    Session s(task);
    s.step(early ? 20 : 60);
    EXPECT_TRUE(s.training.settling());
    EXPECT_EQ(0.0, s.value("time"));
    if (early) s.pick();
    s.step(6);
    EXPECT_FALSE(s.training.settling());
    EXPECT_NEAR(6 / 120.0, s.value("time"), 1e-12);
    EXPECT_EQ(early ? 21u : 61u, s.training.firstStep());
    test::expectSame(s.training, *s.replayed());
  }
}

TEST(Counted, APickHoldsWhatItHoldsWhereThatIs) {
  TaskDef task = pickTask();
  task.stages[0].condition = Hold{"block", 1, Region::sphere(Vec3(0.1, 0, 0.2), 0.03)};
  for (const bool there : {false, true}) {
    Session s(task);
    const auto picked = s.pick(Vec3(there ? 0.1 : -0.1, 0, 0.2));
    s.apply<Done>(MovePickCommand{picked.pick, Vec3(0.1, 0, 0.2)});
    s.step(15);
    EXPECT_EQ(there, s.training.over());
  }
}

TEST(Counted, ATouchIsWhereTheTissueIsTouched) {
  for (const bool touch : {false, true}) {
    TaskDef task = pickTask();
    PressTo press;
    press.force = 0.01;
    press.region = Region::sphere(Vec3(0, 0, 0.25), 0.02);
    press.touch = touch;
    task.stages[0].condition = press;
    task.stages[0].hold_for = 0.0;
    Session s(task);
    PushCommand push;
    push.radius = 0.05;
    push.position = Vec3(0, 0, 0.31);
    s.apply<Done>(push);
    s.step(5);
    push.position.z() = 0.297;
    push.speed = 0.05;
    s.apply<Done>(push);
    s.step(60);
    EXPECT_EQ(touch, s.training.over());
  }
}

}  // namespace
}  // namespace meshless
