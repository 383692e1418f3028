#include "meshless_surgery/training/task.h"

#include <cmath>

#include "shapes/hollow_organs.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
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

  for (const Condition& unknown : {Condition(Clipped{"vein", {}}), Condition(Hold{"vein", 1}),
                                   Condition(HandOver{"vein"}), Condition(PutBack{"vein", 0.01})})
    EXPECT_NE(std::string::npos, faultOf(withStage(unknown)).find("no body 'vein'"));
  EXPECT_EQ("", faultOf(withStage(Clipped{"tissue", Region(Vec3(0, 0, 0.3), Vec3(1, 1, 1))})));
  EXPECT_NE(std::string::npos,
            faultOf(withStage(Clipped{"tissue", Region(Vec3(0.5, 0, 0.3), Vec3(1, 1, 1))})).find("can never be met"));
  EXPECT_NE(std::string::npos, faultOf(withStage(PutBack{"tissue", 0.01})).find("met from the start"));
  SceneDef pegs = blockScene();
  for (const char* name : {"peg_1", "peg_2"}) pegs.obstacles.push_back({name, cylinderMesh(0.1, 0.01, 0.01), 0.5, {}});
  EXPECT_EQ("", faultOf(withStage(PutOn{{"tissue", "other"}, {"peg_1", "peg_2"}, true}), pegs));
  EXPECT_NE(std::string::npos, faultOf(withStage(PutOn{{"ring"}, {"peg_1"}, true}), pegs).find("no body 'ring'"));
  EXPECT_NE(std::string::npos, faultOf(withStage(PutOn{{"tissue"}, {"peg"}, true}), pegs).find("no obstacle 'peg'"));
  EXPECT_NE(std::string::npos,
            faultOf(withStage(PutOn{{"tissue", "other"}, {"peg_1"}, true}), pegs).find("2 bodies are to be put on 1"));
  for (const Condition& held : {Condition(Hold{"tissue", 1}), Condition(HandOver{"tissue"})}) {
    TaskDef held_task = withStage(held);
    held_task.limits.measured.forbidden.push_back({"tissue", "tissue", {}});
    EXPECT_EQ("", faultOf(held_task));
    held_task.limits.ends.insert(LimitKind::kForbidden);
    EXPECT_NE(std::string::npos, faultOf(held_task).find("can never be met"));
  }

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

PickReply pickAt(Played& played, const Vec3& point) {
  PickCommand pick;
  pick.point = point;
  pick.max_distance = 0.2;
  return played.apply<PickReply>(pick);
}

TEST(TaskProgress, HandsOverOnlyFromOneThatHeldItToAnother) {
  struct Case {
    std::string name, acts;  // a, b, c: that pick takes hold; A, B, C: it lets go; +: in the same step as what follows
    bool met;
  };
  for (const Case& c : {Case{"one hand", "a", false}, Case{"two hands", "ab", false}, Case{"handed over", "abA", true},
                        Case{"the second lets go again", "abB", false}, Case{"dropped and taken up", "aAb", false},
                        Case{"dropped after it", "abABc", false}, Case{"let go and taken within a step", "aA+b", false},
                        Case{"on to a third", "abAcB", true}, Case{"a third helps", "abAc", false},
                        Case{"back to a fourth act", "abcA", false}, Case{"two of three let go", "abcAB", true}}) {
    SCOPED_TRACE(c.name);
    Played played(test::weightless(), withStage(HandOver{"tissue"}, 0.1));
    ASSERT_TRUE(played.world.addSceneBody(test::shared(test::ball("tissue"))).ok());
    played.begin();
    const Vec3 places[] = {Vec3(0.1, 0, 0.2), Vec3(-0.1, 0, 0.2), Vec3(0, 0.1, 0.2)};
    std::map<char, PickReply> picks;
    for (std::size_t k = 0; k < c.acts.size(); ++k) {
      const char act = c.acts[k];
      if (act == '+') continue;
      const char low = static_cast<char>(std::tolower(act));
      if (act == low)
        picks[low] = pickAt(played, places[low - 'a']);
      else
        played.apply<Done>(ReleaseCommand{picks.at(low).pick});
      if (k + 1 == c.acts.size() || c.acts[k + 1] != '+') played.step(4);
    }
    played.step(10);
    EXPECT_EQ(c.met, played.training.progress().done());
    test::expectSame(played.training, *played.replayed());
  }
}

TEST(TaskProgress, HoldCountsThePicksOfTheBodyAlone) {
  Played played(test::weightless(), withStage(Hold{"tissue", 2}));
  ASSERT_TRUE(played.world.addSceneBody(test::shared(test::ball("tissue"))).ok());
  ASSERT_TRUE(played.world.addSceneBody(test::shared(test::ball("other", Vec3(0.5, 0, 0.2)))).ok());
  played.begin();
  pickAt(played, Vec3(0.1, 0, 0.2));
  pickAt(played, Vec3(0.5, 0, 0.3));
  played.step(3);
  EXPECT_FALSE(played.training.over());
  pickAt(played, Vec3(-0.1, 0, 0.2));
  played.step(1);
  EXPECT_TRUE(played.training.progress().done());
}

// Jaws hold as picks do; an instrument that lies there begins nothing.
TEST(TaskProgress, AnInstrumentReachesHoldsAndLetsGo) {
  TaskDef task = withStage(Reach{ToolKind::kInstrument, Region::sphere(Vec3(0, 0, 0.22), 0.01)});
  task.stages.push_back({"hold", "", Hold{"tissue", 1}, 0.1});
  task.stages.push_back({"let go", "", LetGo{}, 0.0});
  task.settle = 5.0;
  Played played(test::weightless(), task);
  BodyDef block = test::defOf(boxMesh(Vec3(0.03, 0.01, 0.03), 0.005), "tissue");
  block.pose.translation = Vec3(0, 0, 0.2);
  block.material.youngs_modulus = 1e4;
  block.material.damping = 20.0;
  ASSERT_TRUE(played.world.addSceneBody(test::shared(block)).ok());
  InstrumentDef grasper;
  grasper.name = "left";
  grasper.type = InstrumentType::kGrasper;
  grasper.pose = {Quat(Eigen::AngleAxisd(0.5 * M_PI, Vec3::UnitY())), Vec3(0, 0, 0.25)};
  ASSERT_TRUE(played.world.addSceneInstrument(grasper).ok());
  played.begin();
  played.step(24);
  EXPECT_EQ(0.0, played.training.metrics().time());
  const auto lead = [&](double height, double jaw, int steps) {
    played.apply<Done>(LeadInstrumentCommand{"left", Pose{grasper.pose.rotation, Vec3(0, 0, height)}, jaw});
    played.step(steps);
  };
  lead(0.25, 1.2, 30);
  lead(0.205, 1.2, 60);
  EXPECT_EQ(1u, played.training.progress().stage());
  EXPECT_GT(played.training.metrics().time(), 0.0);
  lead(0.205, 0.0, 60);
  EXPECT_EQ(2u, played.training.progress().stage());
  lead(0.205, 1.2, 60);
  EXPECT_TRUE(played.training.progress().done());
  test::expectSame(played.training, *played.replayed());
}

TEST(TaskProgress, PutsBackWhereTheBodyWas) {
  TaskDef task = withStage(StretchTo{"tissue", 0.04});
  task.stages.push_back({"back", "", PutBack{"tissue", 0.005}, 0.5});
  Played played(test::weightless(), task);
  ASSERT_TRUE(played.world.addSceneBody(test::shared(test::block("tissue"))).ok());
  played.begin();
  played.step(30);
  const PickReply picked = pickAt(played, Vec3(0.1, 0, 0.2));
  Vec3 at = Vec3::Zero();
  const auto go = [&](const Vec3& to) {  // slowly
    for (int k = 1; k <= 240; ++k) {
      played.apply<Done>(MovePickCommand{picked.pick, picked.position + at + k / 240.0 * (to - at)});
      played.step();
    }
    at = to;
    played.step(240);
  };
  go(Vec3(0.06, 0, 0));
  EXPECT_EQ(1u, played.training.progress().stage());
  go(Vec3(0.008, 0, 0));
  EXPECT_FALSE(played.training.over());
  go(Vec3(0.001, 0, 0));
  EXPECT_TRUE(played.training.progress().done());
  test::expectSame(played.training, *played.replayed());
}

TEST(TaskProgress, AClipCountsWhereItIsAtRest) {
  // The vessel lies turned, and is drawn aside before it is clipped: what counts is the place in the tissue.
  BodyDef def = test::defOf(vesselMesh(), "vessel");
  def.spacing = 0.002;
  def.material.youngs_modulus = 2e4;
  def.material.damping = 20.0;
  def.pose.translation = Vec3(0.3, 0.1, 0.2);
  def.pose.rotation = Quat(Eigen::AngleAxisd(0.5 * M_PI, Vec3::UnitZ()));
  for (const double y : {0.075, 0.125})
    def.fixed.push_back(HeldRegion(Vec3(0.29, y - 0.004, 0.19), Vec3(0.31, y + 0.004, 0.21)));
  TaskDef task = withStage(Clipped{"vessel", Region(Vec3(0.29, 0.103, 0.198), Vec3(0.31, 0.115, 0.202))});
  task.stages.push_back({"never", "", Reach{ToolKind::kPush, Region::sphere(Vec3(9, 9, 9), 0.1)}, 0.0});
  WorldSettings settings = test::weightless();
  settings.max_substeps = 8;
  Played played(settings, task);
  ASSERT_TRUE(played.world.addSceneBody(test::shared(def)).ok());
  played.begin();
  const PickReply picked = pickAt(played, Vec3(0.3, 0.1, 0.203));
  for (int k = 1; k <= 30; ++k) {
    played.apply<Done>(MovePickCommand{picked.pick, picked.position + k * Vec3(0, 0, 0.0003)});
    played.step();
  }
  const auto clip = [&](double y) {
    ClipCommand command;
    command.point = Vec3(0.3, y, 0.206);
    command.width = 0.004;
    const auto reply = played.apply<ClipReply>(command);
    played.step(2);
    return reply.name;
  };
  const std::string beside = clip(0.092);
  EXPECT_EQ(0u, played.training.progress().stage());
  SnapshotWants wants;
  wants.surfaces = true;
  const WorldSnapshot shot = played.world.snapshot(wants);
  ASSERT_EQ(1u, shot.attachments.size());
  EXPECT_LT((shot.attachments[0].rest_place - Vec3(0.3, 0.092, 0.2)).norm(), 0.001)
      << shot.attachments[0].rest_place.transpose();
  Vec3 now = Vec3::Zero();
  for (const auto& line : shot.attachments[0].lines)
    now += 0.5 * (line[0] + line[1]) / static_cast<double>(shot.attachments[0].lines.size());
  EXPECT_GT(now.z(), 0.203);  // it was drawn aside
  clip(0.108);
  EXPECT_EQ(1u, played.training.progress().stage());
  EXPECT_EQ(0.0, played.value("bleeding_time"));
  // Cut between them nothing bleeds; where one is taken off, its piece does, for as long as it is off.
  CutCommand cut;
  cut.blades.origin = Vec3(-1, 0.1, 0.2);
  cut.blades.x_axis = Vec3::UnitX();
  cut.blades.y_axis = Vec3::UnitZ();
  ASSERT_EQ(2u, played.apply<CutReply>(cut).new_bodies.size());
  played.step(12);
  EXPECT_EQ(0.0, played.value("bleeding_time"));
  played.apply<DetachReply>(DetachCommand{beside, std::nullopt});
  played.step(30);
  EXPECT_NEAR(0.25, played.value("bleeding_time"), 1e-9);
  clip(0.092);
  played.step(10);
  EXPECT_NEAR(0.25, played.value("bleeding_time"), 1e-9);
  test::expectSame(played.training, *played.replayed());
}

TEST(Metrics, StrainIsWhatIsDoneToTheTissue) {
  // It hangs from one end, and swings.
  BodyDef def = test::block("tissue");
  def.material.youngs_modulus = 8e3;
  def.material.damping = 2.0;
  def.fixed.emplace_back(Vec3(-1, -1, -1), Vec3(-0.06, 1, 1));
  TaskDef task = test::openTask();
  task.limits.measured.strain = 0.02;
  task.metrics.push_back({"strain_peak", 1.0, 0.1, 1.0, {}});
  WorldSettings settings;
  settings.ground.reset();
  Played played(settings, task);
  ASSERT_TRUE(played.world.addSceneBody(test::shared(def)).ok());
  played.begin();
  played.step(240);
  const auto strainNow = [&] {
    SnapshotWants wants;
    wants.particles = true;
    const BodySnapshot body = played.world.snapshot(wants).bodies[0];
    const std::vector<double> strains = strainsOf(*body.model, body.particles);
    return *std::max_element(strains.begin(), strains.end());
  };
  EXPECT_GT(strainNow(), 0.05);  // of its weight
  EXPECT_EQ(0.0, played.value("strain_peak"));
  EXPECT_EQ(0.0, played.value("strained_volume"));
  // A pull of a trainee, and a cut, count; the weight still does not.
  const PickReply picked = pickAt(played, Vec3(0.1, 0.0, 0.15));
  played.step(12);
  const double held = strainNow();
  played.apply<Done>(MovePickCommand{picked.pick, picked.position + Vec3(0.12, 0, 0)});
  played.step(120);
  EXPECT_GT(played.value("strain_peak"), 0.1);
  EXPECT_GT(played.value("strained_volume"), 1e-4);
  EXPECT_LE(played.value("strain_peak"), strainNow() + 0.2);
  EXPECT_GT(strainNow(), held);
  played.apply<Done>(ReleaseCommand{picked.pick});
  const double before = played.value("strain_peak");
  CutCommand cut;
  cut.blades = {Vec3(0.05, -1, 0.2), Vec3::UnitY(), Vec3::UnitZ(), 0.0, 0.0};
  played.apply<CutReply>(cut);
  played.step(240);
  EXPECT_LT(played.value("strain_peak"), before + 0.2);  // pieces hang as their parent did
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
  EXPECT_TRUE(Training(task).wants().strains);
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
