#include "meshless_surgery/io/task.h"

#include <chrono>
#include <filesystem>
#include <fstream>

#include <Eigen/Eigenvalues>

#include "io/temporary_folder.h"
#include "meshless_surgery/training/followed_places.h"
#include "support/bodies.h"

namespace meshless {
namespace task_file_test {

const std::string kScene = R"(
bodies:
  - {name: pad, primitive: {box: [0.1, 0.1, 0.04]}, pose: {position: [0, 0, 0.2]}}
)";
const std::string kTask = R"(scene: scene
brief: what to do
plan: {body: pad, origin: [0, -1, 1], along: [0, 1, 0], out: [0, 0, 1], length: 2, depth: 2, tolerance: 0.003}
target: {body: pad, sphere: {centre: [0.03, 0, 0.2], radius: 0.01}}
tray: {min: [1, 1, 0], max: [2, 2, 1]}
stages:
  - {name: press, press_to: {force: 0.5, box: {min: [0, 0, 0], max: [1, 1, 1]}}, hold_for: 2}
  - cut_along: {share: 0.8}
  - remove_to: tray
  - leave_nothing: {share: 0.02}
  - {stretch_to: {body: pad, distance: 0.01}}
  - {reach: {tool: pick, sphere: {centre: [0, 0, 0], radius: 1}}}
  - let_go: all
  - clip: {body: pad, box: {min: [0, 0, 0], max: [1, 1, 1]}}
  - hold: {body: pad, picks: 2}
  - hand_over: {body: pad}
  - put_back: {body: pad, distance: 0.01}
limits: {time: 60, force: 2, strain: 0.4, forbidden: [{name: bed, box: {min: [3, 3, 0], max: [4, 4, 1]}}, {body: pad}], end: [time, force]}
metrics:
  plan_rms: {weight: 2, good: 0.001, bad: 0.004, pass: 0.003}
  sparc.pick: {good: -1.5, bad: -4}
pass_mark: 55
)";

class TaskFile : public ::testing::Test {
 protected:
  Result<LoadedTask> read(const std::string& text) {
    std::ofstream(folder_.path() + "/scene.yaml") << kScene;
    std::ofstream(folder_.path() + "/task.yaml") << text;
    return readTask(folder_.path() + "/task.yaml", folder_.path(), FileAccess());
  }
  /// The error of the task with `from` replaced.
  std::string errorOf(const std::string& from, const std::string& to) {
    std::string text = kTask;
    const std::size_t at = text.find(from);
    EXPECT_NE(std::string::npos, at) << from;
    text.replace(at, from.size(), to);
    const auto loaded = read(text);
    EXPECT_FALSE(loaded.ok()) << to;
    return loaded.ok() ? "" : loaded.error().detail;
  }
  TemporaryFolder folder_;
};

TEST_F(TaskFile, IsReadWhole) {
  const auto loaded = read(kTask);
  ASSERT_TRUE(loaded.ok()) << loaded.error().detail;
  const TaskDef& task = loaded->task;
  EXPECT_EQ("task", task.name);
  EXPECT_EQ("scene", loaded->scene.name);
  ASSERT_EQ(11u, task.stages.size());
  EXPECT_EQ("press", task.stages[0].name);
  EXPECT_EQ(2.0, task.stages[0].hold_for);
  EXPECT_EQ(0.5, std::get<PressTo>(task.stages[0].condition).force);
  EXPECT_TRUE(std::get<PressTo>(task.stages[0].condition).region.has_value());
  EXPECT_EQ("cut_along", task.stages[1].name);
  EXPECT_EQ(0.8, std::get<CutAlong>(task.stages[1].condition).share);
  EXPECT_TRUE(std::holds_alternative<RemoveToTray>(task.stages[2].condition));
  EXPECT_EQ(0.02, std::get<LeaveNothing>(task.stages[3].condition).share);
  EXPECT_EQ(ToolKind::kPick, std::get<Reach>(task.stages[5].condition).tool);
  EXPECT_TRUE(std::holds_alternative<LetGo>(task.stages[6].condition));
  EXPECT_EQ("pad", std::get<Clipped>(task.stages[7].condition).body);
  EXPECT_TRUE(std::get<Clipped>(task.stages[7].condition).region.has_value());
  EXPECT_EQ(2, std::get<Hold>(task.stages[8].condition).picks);
  EXPECT_EQ("pad", std::get<HandOver>(task.stages[9].condition).body);
  EXPECT_EQ(0.01, std::get<PutBack>(task.stages[10].condition).distance);
  EXPECT_EQ(60.0, task.limits.time);
  EXPECT_EQ(2.0, task.limits.measured.force);
  EXPECT_EQ((std::set<LimitKind>{LimitKind::kTime, LimitKind::kForce}), task.limits.ends);
  ASSERT_EQ(2u, task.limits.measured.forbidden.size());
  EXPECT_EQ("pad", task.limits.measured.forbidden[1].body);
  EXPECT_EQ(0.003, task.plan->tolerance);
  ASSERT_EQ(2u, task.metrics.size());
  EXPECT_EQ(0.003, task.metrics[0].pass);
  EXPECT_EQ(1.0, task.metrics[1].weight);
  EXPECT_EQ(55.0, task.pass_mark);
}

TEST_F(TaskFile, ErrorsNameLineKeyAndWhatIsAccepted) {
  struct Wrong {
    std::string from, to, line, says, accepted;
  };
  const Wrong wrong[] = {
      {"scene: scene", "scene: scena", "", "there is no scene", "YAML"},
      {"brief: what", "breif: what", ":2:", "did you mean 'brief'", "pass_mark"},
      {"plan: {body: pad", "plan: {body: pat", ":3:", "no body 'pat'", "pad"},
      {"origin: [0, -1, 1]", "origin: [0.3, -1, 1]", ":3:", "no part of the plan", "meets"},
      {"out: [0, 0, 1]", "out: [0, 1, 0]", ":3:", "right angle", "direction"},
      {"tolerance: 0.003", "tolerance: .nan", ":3:", "tolerance is .nan", "above 0"},
      {"target: {body: pad, ", "target: {body: pad, box: {min: [0, 0, 0], max: [1, 1, 1]}, ", ":4:", "several shapes",
       "sphere"},
      {"centre: [0.03, 0, 0.2]", "centre: [0.3, 0, 0.2]", ":4:", "no tissue of 'pad'", "region"},
      {"tray: {min: [1, 1, 0]", "tray: {min: [9, 1, 0]", ":5:", "min above its max", "up to max"},
      {"tray: {min: [1, 1, 0], max: [2, 2, 1]}", "pass_mork: 3", "", "did you mean 'pass_mark'", "stages"},
      {"force: 0.5", "force: 2.5", ":7:", "can never be met", "up to that"},
      {"hold_for: 2", "hold_for: 61", ":7:", "61 s", "less"},
      {"cut_along: {share: 0.8}", "cut_along: {share: 1.8}", ":8:", "share is 1.8", "above 0 to 1"},
      {"cut_along: {share: 0.8}", "cut_alone: {share: 0.8}", ":8:", "did you mean 'cut_along'", "reach"},
      {"cut_along: {share: 0.8}", "{name: nothing}", ":8:", "no condition", "reach"},
      {"remove_to: tray", "remove_to: bin", ":9:", "remove_to is 'bin'", "tray"},
      {"stretch_to: {body: pad", "stretch_to: {body: bad", ":11:", "no body 'bad'", "pad"},
      {"tool: pick", "tool: pik", ":12:", "tool is 'pik'", "pick, push, scissors"},
      {"let_go: all", "separate: [pad, world]", ":13:", "no attachment joins", "attachment"},
      {"clip: {body: pad, box: {min: [0, 0, 0]", "clip: {body: bad, box: {min: [0, 0, 0]", ":14:", "no body 'bad'",
       "pad"},
      {"clip: {body: pad, box: {min: [0, 0, 0]", "clip: {body: pad, box: {min: [0.9, 0, 0]",
       ":14:", "no tissue of 'pad'", "region"},
      {"clip: {body: pad, ", "clip: {", ":14:", "clip has no body", "name"},
      {"hold: {body: pad, picks: 2}", "hold: {body: pid, picks: 2}", ":15:", "no body 'pid'", "pad"},
      {"hold: {body: pad, picks: 2}", "hold: {body: pad, picks: 0}", ":15:", "picks is '0'", "1 to 10"},
      {"hand_over: {body: pad}", "hand_over: {body: pod}", ":16:", "no body 'pod'", "pad"},
      {"hand_over: {body: pad}", "hand_over: {bode: pad}", ":16:", "hand_over has no body", "name"},
      {"put_back: {body: pad", "put_back: {body: pud", ":17:", "no body 'pud'", "pad"},
      {"body: pad, distance: 0.01}\nlimits", "body: pad}\nlimits", ":17:", "no distance", "above 0"},
      {"- {name: press", "- put_back: {body: pad, distance: 1}\n  - {name: press", ":7:", "met from the start",
       "a stage before it"},
      {"end: [time, force]", "end: [time, forbidden]", ":8:", "the body of the plan is forbidden", "another body"},
      {"end: [time, force]", "end: [time, farce]", ":18:", "'farce'", "strain"},
      {"strain: 0.4", "strain: -1", ":18:", "strain is -1", "above 0"},
      {"{body: pad}]", "{body: pet}]", ":18:", "no body 'pet'", "pad"},
      {"plan_rms:", "plan_rmse:", ":20:", "did you mean 'plan_rms'", "docs/metrics.md"},
      {"sparc.pick:", "sparc:", ":21:", "unknown metric 'sparc'", "docs/metrics.md"},
      {"good: -1.5", "good: -4", ":21:", "the same", "two"},
      {"pass_mark: 55", "pass_mark: 155", ":22:", "pass_mark is 155", "0 to 100"},
  };
  for (const Wrong& w : wrong) {
    const std::string error = errorOf(w.from, w.to);
    EXPECT_NE(std::string::npos, error.find("task.yaml" + w.line)) << w.to << ": " << error;
    EXPECT_NE(std::string::npos, error.find(w.says)) << w.to << ": " << error;
    EXPECT_NE(std::string::npos, error.find("accepted: ")) << w.to << ": " << error;
    EXPECT_NE(std::string::npos, error.find(w.accepted)) << w.to << ": " << error;
  }
}

TEST_F(TaskFile, APictureIsInTheReport) {
  std::ofstream(folder_.path() + "/scene.yaml") << kScene;
  std::ofstream(folder_.path() + "/a.png") << "\x89PNG\r\n\x1a\nxyz";
  std::ofstream(folder_.path() + "/b.png") << "GIF89a";
  std::ofstream(folder_.path() + "/c.png") << "\x89PNG\r\n\x1a\n" << std::string(2 << 20, 'x');
  const auto with = [&](const std::string& picture) {
    std::ofstream(folder_.path() + "/task.yaml") << "picture: " << picture << "\n" << kTask;
    return readTask(folder_.path() + "/task.yaml", folder_.path(), FileAccess());
  };
  const auto loaded = with("a.png");
  ASSERT_TRUE(loaded.ok()) << loaded.error().detail;
  EXPECT_EQ("data:image/png;base64,iVBORw0KGgp4eXo=", loaded->task.picture);
  EXPECT_NE(std::string::npos, reportHtml(Training(loaded->task), {}).find("src=\"data:image/png;base64,iVBOR"));
  for (const char* wrong : {"b.png", "c.png", "d.png", "/etc/hostname"}) {
    const auto refused = with(wrong);
    ASSERT_FALSE(refused.ok()) << wrong;
    EXPECT_NE(std::string::npos, refused.error().detail.find("task.yaml:1: picture")) << refused.error().detail;
    EXPECT_NE(std::string::npos, refused.error().detail.find("accepted: a PNG or JPEG")) << refused.error().detail;
  }
}

TEST_F(TaskFile, TheTissueOfAHollowOrganIsItsWall) {
  std::ofstream(folder_.path() + "/hollow.yaml")
      << "bodies: [{name: ball, primitive: {sphere: 0.04}, thickness: 0.005}]";
  const auto said = [&](const std::string& x, const std::string& radius) -> std::string {
    std::ofstream(folder_.path() + "/task.yaml")
        << "scene: hollow.yaml\ntarget: {body: ball, sphere: {centre: [" << x << ", 0, 0], radius: " << radius
        << "}}\ntray: {min: [1, 1, 0], max: [2, 2, 1]}\nstages: [{remove_to: tray}]\n";
    const auto loaded = readTask(folder_.path() + "/task.yaml", folder_.path(), FileAccess());
    return loaded.ok() ? "" : loaded.error().detail;
  };
  EXPECT_NE(std::string::npos, said("0", "0.02").find("task.yaml:2: no tissue of 'ball' is in the target"))
      << said("0", "0.02");
  EXPECT_NE(std::string::npos,
            said("0.03", "0.01").find("task.yaml:4: this stage can never be met: the middle of the target"))
      << said("0.03", "0.01");
  EXPECT_EQ("", said("0.0375", "0.01"));
}

TEST_F(TaskFile, ItsSceneMayBeOfAPackage) {
  std::filesystem::create_directories(folder_.path() + "/trainer/scenes");
  std::ofstream(folder_.path() + "/trainer/scenes/scene.yaml") << kScene;
  std::string text = kTask;
  text.replace(text.find("scene: scene"), 12, "scene: package://my_trainer/scenes/scene.yaml");
  std::ofstream(folder_.path() + "/task.yaml") << text;
  FileAccess access;
  access.find_package = [&](const std::string& name) {
    return name == "my_trainer" ? folder_.path() + "/trainer" : "";
  };
  const auto loaded = readTask(folder_.path() + "/task.yaml", folder_.path(), access);
  ASSERT_TRUE(loaded.ok()) << loaded.error().detail;
  EXPECT_EQ(folder_.path() + "/trainer/scenes/scene.yaml", loaded->scene_file);
  access.find_package = [](const std::string&) { return ""; };
  const auto refused = readTask(folder_.path() + "/task.yaml", folder_.path(), access);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(std::string::npos, refused.error().detail.find("no package 'my_trainer'")) << refused.error().detail;
}

TEST_F(TaskFile, EarlierReportsAreThoseOfTheTrainee) {
  const auto write = [&](const std::string& name, const std::string& text) {
    std::filesystem::create_directories(folder_.path() + "/" + name);
    std::ofstream(folder_.path() + "/" + name + "/report.json") << text;
  };
  const auto report = [](const std::string& trainee, const std::string& task, const std::string& score) {
    return "{\"trainee\": \"" + trainee + "\", \"task\": \"" + task + "\", \"score\": " + score +
           ", \"passed\": true, \"metrics\": [{\"name\": \"time\", \"value\": 1.5}, {\"name\": \"ldlj.pick\", "
           "\"value\": null}]}";
  };
  // What has a date is in its order, whenever its file was written.
  const auto dated = [&](const std::string& score, const std::string& date) {
    return report("Ann", "resect", score).insert(1, "\"date\": \"" + date + "\", ");
  };
  write("y", dated("1", "2026-03-01T14:05:09.250Z"));
  write("x", dated("2", "2026-03-01T14:05:09.249Z"));
  write("w", dated("3", "2026-02-28T23:05:09.999Z"));
  write("b", report("Ann", "resect", "70.5"));
  const std::string oldest = folder_.path() + "/b/report.json";
  std::filesystem::last_write_time(oldest, std::filesystem::last_write_time(oldest) - std::chrono::hours(1));
  write("a", report("Ann", "resect", "60"));
  write("c", report("Bob", "resect", "10"));
  write("d", report("Ann", "incise", "20"));
  write("e", report("Ann", "resect", "99"));
  write("f", "{\"trainee\": ");
  write("g", "{}");
  write("h", report("Ann", "resect", "\"many\""));
  const auto found = readEarlierReports(folder_.path(), "Ann", "resect", "e");
  ASSERT_EQ(5u, found.size());
  std::vector<EarlierReport> undated;
  std::string order;
  for (const EarlierReport& earlier : found)
    if (earlier.score > 9.0)
      undated.push_back(earlier);
    else
      order += earlier.name;
  EXPECT_EQ("wxy", order);
  ASSERT_EQ(2u, undated.size());
  EXPECT_EQ("b", undated[0].name);  // the oldest
  EXPECT_EQ(70.5, undated[0].score);
  EXPECT_EQ("a", undated[1].name);
  EXPECT_EQ((std::map<std::string, double>{{"time", 1.5}}), undated[1].values);
  EXPECT_TRUE(readEarlierReports(folder_.path() + "/none", "Ann", "resect", "").empty());
}

TEST(Dates, AreInTheOrderOfTime) {
  const auto at = [](long milliseconds) {
    return dateText(std::chrono::system_clock::time_point(std::chrono::milliseconds(milliseconds)));
  };
  EXPECT_EQ("1970-01-01T00:00:00.000Z", at(0));
  EXPECT_EQ("2026-03-01T14:05:09.250Z", at(1772373909250));
  EXPECT_EQ("1969-12-31T23:59:59.999Z", at(-1));
  std::string before;
  for (const long time : {0L, 1L, 999L, 1000L, 86399999L, 86400000L, 951782400000L, 1772373909250L}) {
    EXPECT_LT(before, at(time));
    EXPECT_TRUE(isDate(at(time))) << at(time);
    before = at(time);
  }
  for (const char* text : {"", "yesterday", "2026-03-01", "2026-13-01T14:05:09Z", "2026-03-01T24:05:09Z",
                           "2026-03-01T14:05:09", "2026-03-01T14:05:09.25Z", "2026-03-01T14:05:09Z\n"})
    EXPECT_FALSE(isDate(text)) << text;
  EXPECT_TRUE(isDate("2026-03-01T14:05:09Z"));
}

// --- those that ship, done by a script

class ShippedTask {
 public:
  explicit ShippedTask(const std::string& name) {
    const std::string config = std::string(SOURCE_DIR) + "/config";
    FileAccess access;
    access.folders = {config};
    auto loaded = readTask(config + "/tasks/" + name + ".yaml", config + "/scenes", access);
    EXPECT_TRUE(loaded.ok()) << (loaded.ok() ? "" : loaded.error().detail);
    if (!loaded.ok()) return;
    world = std::make_unique<World>(loaded->scene.world);
    for (BodyDef& def : loaded->scene.bodies)
      EXPECT_TRUE(world->addSceneBody(std::make_shared<const PreparedBody>(test::prepared(def))).ok());
    for (ObstacleDef& def : loaded->scene.obstacles) EXPECT_TRUE(world->addObstacle(std::move(def)).ok());
    for (const AttachCommand& attachment : loaded->scene.attachments)
      EXPECT_TRUE(world->addSceneAttachment(attachment).ok());
    training = std::make_unique<Training>(loaded->task);
  }
  void seconds(double time) {
    const int steps = static_cast<int>(std::lround(time * world->settings().step_rate));
    for (int k = 0; k < steps && !training->over(); ++k) {
      world->step();
      ASSERT_TRUE(training->feed(frameOf(*world, world->takeEvents(), training->wants())).ok());
    }
  }
  template <class T>
  T apply(const Command& command) {
    return test::replyOf<T>(world->apply(command));
  }
  /// A pick's hand goes there along a straight line, smoothly.
  void carry(const PickReply& pick, const Vec3& from, const Vec3& to, double time) {
    const int steps = static_cast<int>(std::lround(time * 120.0));
    for (int k = 1; k <= steps; ++k) {
      const double u = static_cast<double>(k) / steps, s = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
      apply<Done>(MovePickCommand{pick.pick, from + s * (to - from)});
      seconds(1.0 / 120.0);
    }
  }
  double value(const std::string& name) const {
    for (const MetricValue& metric : training->values())
      if (metric.name == name) return metric.value;
    return std::nan("");
  }
  /// Where the plan is drawn now, of those of its places that are so at rest.
  Points drawn(const std::function<bool(const Vec3& rest)>& wanted = [](const Vec3&) { return true; }) {
    const CutPlan& plan = *training->task().plan;
    SnapshotWants wants;
    wants.particles = true;
    const Points& rest = training->tissue().planOutline();
    const Points now = FollowedPlaces(plan.body, rest, plan.along.cross(plan.out)).now(world->snapshot(wants));
    Points some;
    for (std::size_t k = 0; k < rest.size(); ++k)
      if (wanted(rest[k])) some.push_back(now[k]);
    EXPECT_GT(some.size(), 20u);
    return some;
  }
  /// The vertex of a body's surface that is farthest in that direction now.
  Vec3 farthest(const std::string& name, const Vec3& direction) {
    SnapshotWants wants;
    wants.surfaces = true;
    std::optional<Vec3> found;
    for (const BodySnapshot& body : world->snapshot(wants).bodies)
      for (const Vec3& p : body.surface)
        if (body.name == name && (!found || p.dot(direction) > found->dot(direction))) found = p;
    EXPECT_TRUE(found.has_value()) << name;
    return found.value_or(Vec3::Zero());
  }
  std::string told() const {
    std::string text = "score " + std::to_string(training->score()) + " " + training->progress().failed();
    for (const MetricValue& metric : training->values())
      if (std::isfinite(metric.value)) text += "\n  " + metric.name + " " + std::to_string(metric.value);
    return text;
  }

  std::unique_ptr<World> world;
  std::unique_ptr<Training> training;
};

TEST(ShippedTasks, Palpate) {
  ShippedTask task("palpate");
  PushCommand push;
  push.radius = 0.010;
  push.position = Vec3(0.015, 0.010, 0.075);
  task.apply<Done>(push);
  task.seconds(0.5);
  push.position.z() = 0.066;
  push.speed = 0.02;
  task.apply<Done>(push);
  task.seconds(2.0);
  EXPECT_EQ(1u, task.training->progress().stage()) << task.told();
  push.enable = false;
  task.apply<Done>(push);
  PickCommand pick;
  pick.point = Vec3(0.015, 0.010, 0.1);
  pick.direction = -Vec3::UnitZ();
  task.apply<PickReply>(pick);
  task.seconds(1.0);
  EXPECT_TRUE(task.training->passed()) << task.told();
}

TEST(ShippedTasks, Retract) {
  ShippedTask task("retract");
  task.seconds(1.0);
  PickCommand pick;
  pick.point = Vec3(-0.05, -0.06, 0.2);
  pick.direction = -Vec3::UnitZ();
  const auto picked = task.apply<PickReply>(pick);
  task.carry(picked, picked.position, picked.position + Vec3(0, 0.01, 0.035), 2.0);
  task.seconds(11.0);
  EXPECT_EQ(1u, task.training->progress().stage()) << task.told();
  task.apply<Done>(ReleaseCommand{picked.pick});
  task.seconds(0.1);
  EXPECT_TRUE(task.training->passed()) << task.told();
}

TEST(ShippedTasks, Incise) {
  // Along the line that is drawn on the skin, which sags.
  ShippedTask task("incise");
  task.seconds(1.0);
  const Points line = task.drawn([](const Vec3& rest) { return rest.z() > 0.0599; });
  Vec3 left = line[0], right = line[0], lowest = line[0];
  for (const Vec3& p : line) {
    if (p.x() < left.x()) left = p;
    if (p.x() > right.x()) right = p;
    if (p.z() < lowest.z()) lowest = p;
    const auto top = task.world->probe(p + 0.1 * Vec3::UnitZ(), -Vec3::UnitZ());
    ASSERT_TRUE(top.ok());
    EXPECT_LT((top->position - p).norm(), 0.0005) << p.transpose();
  }
  EXPECT_LT(lowest.z(), 0.055);
  EXPECT_EQ(0.0, task.value("plan_done"));
  InciseCommand incise;
  incise.blade = {left + 0.001 * Vec3::UnitZ(), (right - left).normalized(), Vec3::UnitZ(), (right - left).norm(),
                  left.z() - lowest.z() + 0.001 + 0.013};
  task.apply<InciseReply>(incise);
  task.seconds(0.5);
  EXPECT_TRUE(task.training->passed()) << task.told();
  EXPECT_GT(task.value("plan_done"), 0.9);
}

TEST(ShippedTasks, Resect) {
  ShippedTask task("resect");
  // Along what is drawn on the organ, which hangs.
  task.seconds(1.0);
  const Points line = task.drawn();
  Vec3 mean = Vec3::Zero();
  for (const Vec3& p : line) mean += p / static_cast<double>(line.size());
  Mat3 spread = Mat3::Zero();
  for (const Vec3& p : line) spread += (p - mean) * (p - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Mat3> axes(spread);
  CutCommand cut;
  cut.blades.x_axis = axes.eigenvectors().col(2);
  cut.blades.y_axis = axes.eigenvectors().col(1);
  cut.blades.origin = mean - cut.blades.x_axis;
  const auto reply = task.apply<CutReply>(cut);
  ASSERT_EQ(2u, reply.new_bodies.size());
  task.seconds(0.5);
  EXPECT_EQ(1u, task.training->progress().stage()) << task.told();
  PickCommand pick;
  pick.point = Vec3(-0.075, -0.005, 0.06);
  pick.max_distance = 0.05;
  pick.body = reply.new_bodies[1];
  const auto picked = task.apply<PickReply>(pick);
  task.carry(picked, picked.position, picked.position + Vec3(-0.05, 0, 0.05), 1.0);
  task.carry(picked, picked.position + Vec3(-0.05, 0, 0.05), picked.position + Vec3(-0.2, 0, 0.05), 2.0);
  task.seconds(1.0);
  EXPECT_EQ(2u, task.training->progress().stage()) << task.told();
  task.apply<Done>(ReleaseCommand{picked.pick});
  task.seconds(0.2);
  EXPECT_TRUE(task.training->passed()) << task.told();
}

TEST(ShippedTasks, Transect) {
  // Clips first; and cut at once, which bleeds until they are on.
  for (const bool clips_first : {true, false}) {
    SCOPED_TRACE(clips_first ? "clipped, then cut" : "cut, then clipped");
    ShippedTask task("transect");
    task.seconds(0.5);
    const auto clip = [&](double x) {
      ClipCommand command;
      command.point = Vec3(x, 0, 0.05);
      command.width = 0.004;
      task.apply<ClipReply>(command);
      task.seconds(0.4);
    };
    const auto cut = [&] {
      Vec3 middle = Vec3::Zero();
      const Points line = task.drawn();
      for (const Vec3& p : line) middle += p / static_cast<double>(line.size());
      CutCommand command;
      command.blades = {middle - 0.02 * Vec3::UnitY(), Vec3::UnitY(), Vec3::UnitZ(), 0.04, 0.02};
      EXPECT_EQ(2u, task.apply<CutReply>(command).new_bodies.size());
      task.seconds(0.1);
    };
    if (!clips_first) cut();
    clip(-0.008);
    EXPECT_EQ(1u, task.training->progress().stage()) << task.told();
    clip(0.008);
    if (clips_first) cut();
    task.seconds(2.0);
    EXPECT_TRUE(task.training->progress().done()) << task.told();
    EXPECT_EQ(clips_first, task.training->passed()) << task.told();
    if (clips_first) EXPECT_EQ(0.0, task.value("bleeding_time"));
    if (!clips_first) EXPECT_NEAR(0.5, task.value("bleeding_time"), 0.02);
  }
}

TEST(ShippedTasks, HandOver) {
  ShippedTask task("hand_over");
  task.seconds(0.5);
  PickCommand pick;
  pick.body = "block";
  pick.point = task.farthest("block", Vec3(-1, 0, 0.5));
  const auto first = task.apply<PickReply>(pick);
  task.carry(first, first.position, first.position + Vec3(0.05, 0, 0.08), 1.5);
  task.seconds(0.5);
  EXPECT_EQ(2u, task.training->progress().stage()) << task.told();
  pick.point = task.farthest("block", Vec3(0, 0, -1));  // it hangs
  const auto second = task.apply<PickReply>(pick);
  task.seconds(0.3);
  task.apply<Done>(ReleaseCommand{first.pick});
  task.seconds(0.3);
  EXPECT_EQ(4u, task.training->progress().stage()) << task.told();
  task.carry(second, second.position, Vec3(0.09, 0, 0.06), 2.0);
  task.carry(second, Vec3(0.09, 0, 0.06), Vec3(0.09, 0, 0.02), 0.5);
  task.seconds(0.5);
  EXPECT_EQ(5u, task.training->progress().stage()) << task.told();
  task.apply<Done>(ReleaseCommand{second.pick});
  task.seconds(0.2);
  EXPECT_TRUE(task.training->passed()) << task.told();
  EXPECT_EQ(0.0, task.value("instrument_crossings"));
}

TEST(ShippedTasks, Dissect) {
  ShippedTask task("dissect");
  task.seconds(0.5);
  const auto fibres = [&] {
    for (const AttachmentSnapshot& joint : task.world->snapshot({}).attachments)
      if (joint.name == "bed") return joint.fibres;
    return std::size_t{0};
  };
  // The fundus is drawn down, off the bed.
  PickCommand pick;
  pick.body = "gallbladder";
  pick.point = task.farthest("gallbladder", Vec3(-1, 0, -0.3));
  const auto picked = task.apply<PickReply>(pick);
  Vec3 at = picked.position;
  EXPECT_GT(fibres(), 20u);
  for (int k = 0; k < 30 && fibres() > 0; ++k) {
    task.carry(picked, at, at + Vec3(0.0005, 0, -0.0025), 0.1);
    at += Vec3(0.0005, 0, -0.0025);
  }
  EXPECT_EQ(1u, task.training->progress().stage()) << task.told();
  task.apply<Done>(ClearPicksCommand{});
  task.seconds(0.2);
  EXPECT_TRUE(task.training->passed()) << task.told();
}

}  // namespace task_file_test
}  // namespace meshless
