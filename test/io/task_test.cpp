#include "meshless_surgery/io/task.h"

#include <chrono>
#include <filesystem>
#include <fstream>

#include "io/shipped_task.h"
#include "io/temporary_folder.h"
#include "support/bodies.h"

namespace meshless {
namespace task_file_test {

const std::string kScene = R"(
bodies:
  - {name: pad, primitive: {box: [0.1, 0.1, 0.04]}, pose: {position: [0, 0, 0.2]}}
instruments: {scope: {type: endoscope}}
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
  - see: {body: pad, off_centre: 0.2, fills_least: 0.1, fills_most: 0.9}
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
  ASSERT_EQ(12u, task.stages.size());
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
  const See& see = std::get<See>(task.stages[11].condition);
  EXPECT_EQ("pad", see.body);
  EXPECT_EQ(0.2, see.off_centre);
  EXPECT_EQ(0.1, see.fills_least);
  EXPECT_EQ(0.9, see.fills_most);
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
      {"put_back: {body: pad, distance: 0.01}", "put_back: {body: pad}", ":17:", "no distance", "above 0"},
      {"see: {body: pad", "see: {body: pod", ":18:", "no body 'pod'", "pad"},
      {"see: {body: pad, ", "see: {", ":18:", "see has no body", "name"},
      {"off_centre: 0.2", "off_centre: 1.1", ":18:", "off_centre is 1.1", "above 0 to 1"},
      {"fills_least: 0.1", "fills_least: 0.9", ":18:", "fills_least is 0.9", "below fills_most, 0.9"},
      {"- {name: press", "- put_back: {body: pad, distance: 1}\n  - {name: press", ":7:", "met from the start",
       "a stage before it"},
      {"end: [time, force]", "end: [time, forbidden]", ":8:", "the body of the plan is forbidden", "another body"},
      {"end: [time, force]", "end: [time, farce]", ":19:", "'farce'", "strain"},
      {"strain: 0.4", "strain: -1", ":19:", "strain is -1", "above 0"},
      {"{body: pad}]", "{body: pet}]", ":19:", "no body 'pet'", "pad"},
      {"plan_rms:", "plan_rmse:", ":21:", "did you mean 'plan_rms'", "docs/metrics.md"},
      {"sparc.pick:", "sparc:", ":22:", "unknown metric 'sparc'", "docs/metrics.md"},
      {"good: -1.5", "good: -4", ":22:", "the same", "two"},
      {"pass_mark: 55", "pass_mark: 155", ":23:", "pass_mark is 155", "0 to 100"},
  };
  for (const Wrong& w : wrong) {
    const std::string error = errorOf(w.from, w.to);
    EXPECT_NE(std::string::npos, error.find("task.yaml" + w.line)) << w.to << ": " << error;
    EXPECT_NE(std::string::npos, error.find(w.says)) << w.to << ": " << error;
    EXPECT_NE(std::string::npos, error.find("accepted: ")) << w.to << ": " << error;
    EXPECT_NE(std::string::npos, error.find(w.accepted)) << w.to << ": " << error;
  }
}

TEST_F(TaskFile, NothingIsSeenWithoutAnEndoscope) {
  std::ofstream(folder_.path() + "/blind.yaml") << "bodies: [{name: pad, primitive: {sphere: 0.1}}]\n"
                                                << "instruments: {rod: {type: probe}}\n";
  std::ofstream(folder_.path() + "/task.yaml") << "scene: blind.yaml\nstages:\n  - see: {body: pad}\n";
  const auto loaded = readTask(folder_.path() + "/task.yaml", folder_.path(), FileAccess());
  ASSERT_FALSE(loaded.ok());
  EXPECT_NE(std::string::npos, loaded.error().detail.find("task.yaml:3: ")) << loaded.error().detail;
  EXPECT_NE(std::string::npos, loaded.error().detail.find("the scene has no endoscope")) << loaded.error().detail;
}

TEST_F(TaskFile, ALineOrACircleIsAPlanToo) {
  const auto read_plan = [&](const std::string& plan) {
    std::string text = kTask;
    const std::size_t from = text.find("plan: {"), to = text.find('\n', from);
    return read(text.replace(from, to - from, "plan: {body: pad, out: [0, 0, 1], depth: 0.01, " + plan + "}"));
  };
  const auto circle = read_plan("circle: {centre: [0, 0, 0.22], radius: 0.03}");
  ASSERT_TRUE(circle.ok()) << circle.error().detail;
  EXPECT_TRUE(circle->task.plan->closed());
  double length = 0.0;
  for (const CutPlan& part : circle->task.plan->parts()) {
    length += part.length;
    EXPECT_NEAR(0.03, (part.origin - Vec3(0, 0, 0.22)).norm(), 1e-12);
    EXPECT_NEAR(0.0, part.along.dot(part.out), 1e-12);
  }
  EXPECT_NEAR(2.0 * M_PI * 0.03, length, 1e-3 * length);
  const auto line = read_plan("line: [[-0.03, 0, 0.22], [0.0, 0.02, 0.22], [0.03, 0, 0.22]]");
  ASSERT_TRUE(line.ok()) << line.error().detail;
  EXPECT_EQ(2u, line->task.plan->parts().size());
  EXPECT_FALSE(line->task.plan->closed());
  for (const auto& [plan, says] :
       {std::make_pair("circle: {centre: [0, 0, 0.22]}", "circle has no radius"),
        {"circle: {centre: [0, 0, 0.22], radius: -1}", "radius is -1"},
        {"circle: {centre: [0, 0, 0.22], radius: 0.03}, length: 1", "and length"},
        {"circle: {centre: [0, 0, 0.22], radius: 0.03}, line: [[0, 0, 0], [1, 0, 0]]", "a line and a circle"},
        {"line: [[0, 0, 0.2]]", "line is a list of 1"},
        {"line: [[0, 0, 0.2], [0, 0]]", "a place of line is a list of 2"},
        {"line: [[0, 0, 0.2], [0, 0, 0.2]]", "where the one before is"},
        {"line: [[0, 0, 0.2], [0, 0.1, 0.3]]", "not at a right angle to the line"},
        {"length: 1", "no origin"}}) {
    const auto refused = read_plan(plan);
    ASSERT_FALSE(refused.ok()) << plan;
    EXPECT_NE(std::string::npos, refused.error().detail.find(says)) << refused.error().detail;
    EXPECT_NE(std::string::npos, refused.error().detail.find("accepted: ")) << refused.error().detail;
  }
}

TEST_F(TaskFile, SaysWhatIsToBePutOnWhat) {
  const auto read_put_on = [&](const std::string& put_on, const std::string& view) {
    std::ofstream(folder_.path() + "/pegs.yaml")
        << kScene << "obstacles:\n  - {name: peg, primitive: {cylinder: [0.1, 0.01]}, pose: {position: [1, 1, 0.2]}}\n"
        << "  - {name: bar, primitive: {box: [0.1, 0.1, 0.1]}, pose: {position: [2, 2, 0.2]}}\n";
    std::ofstream(folder_.path() + "/task.yaml")
        << "scene: pegs.yaml\nview: " << view << "\nstages:\n  - put_on: " << put_on << "\n";
    return readTask(folder_.path() + "/task.yaml", folder_.path(), FileAccess());
  };
  const std::string view = "{min: [-1, -1, 0], max: [1, 1, 2]}";
  const auto loaded = read_put_on("{bodies: [pad], obstacles: [peg, bar], handed_over: true}", view);
  ASSERT_TRUE(loaded.ok()) << loaded.error().detail;
  const auto& put = std::get<PutOn>(loaded->task.stages.at(0).condition);
  EXPECT_EQ(std::vector<std::string>{"pad"}, put.bodies);
  EXPECT_EQ((std::vector<std::string>{"peg", "bar"}), put.obstacles);
  EXPECT_TRUE(put.handed_over);
  EXPECT_EQ(2.0, loaded->task.view->max.z());
  const auto alone = read_put_on("{bodies: [pad], obstacles: [peg]}", view);
  ASSERT_TRUE(alone.ok()) << alone.error().detail;
  EXPECT_FALSE(std::get<PutOn>(alone->task.stages.at(0).condition).handed_over);
  for (const auto& [put_on, seen, says] :
       {std::make_tuple("{bodies: [pad]}", view.c_str(), "task.yaml:4: put_on has no obstacles"),
        {"{obstacles: [peg]}", view.c_str(), "put_on has no bodies"},
        {"{bodies: pad, obstacles: [peg]}", view.c_str(), "bodies is 'pad'"},
        {"{bodies: [pad, pad], obstacles: [peg, bar]}", view.c_str(), "bodies has 'pad' twice"},
        {"{bodies: [ring], obstacles: [peg]}", view.c_str(), "no body 'ring'"},
        {"{bodies: [pad], obstacles: [pag]}", view.c_str(), "no obstacle 'pag'"},
        {"{bodies: [pad], obstacles: [peg], handed_over: perhaps}", view.c_str(), "handed_over is 'perhaps'"},
        {"{bodies: [pad], obstacles: [peg], hand_over: true}", view.c_str(), "did you mean 'handed_over'"},
        {"{bodies: [pad], obstacles: [peg]}", "{min: [1, 1, 1], max: [0, 2, 2]}", "min above its max"}}) {
    const auto refused = read_put_on(put_on, seen);
    ASSERT_FALSE(refused.ok()) << put_on;
    EXPECT_NE(std::string::npos, refused.error().detail.find(says)) << refused.error().detail;
    EXPECT_NE(std::string::npos, refused.error().detail.find("accepted: ")) << refused.error().detail;
  }
}

TEST_F(TaskFile, SaysWhatEndsItAndWhatItAllows) {
  std::string text = kTask;
  text.replace(text.find("limits: {"), 9,
               "settle: 1.5\nallow: [undo, pause]\nlimits: {fail: {cuts: 0, top_speed.pick: 6}, ");
  const auto loaded = read(text);
  ASSERT_TRUE(loaded.ok()) << loaded.error().detail;
  EXPECT_EQ(1.5, loaded->task.settle);
  EXPECT_EQ((std::set<Intervention>{Intervention::kUndo, Intervention::kPause}), loaded->task.allow);
  ASSERT_EQ(2u, loaded->task.limits.fail.size());
  EXPECT_EQ("top_speed.pick", loaded->task.limits.fail[1].metric);
  EXPECT_EQ(6.0, loaded->task.limits.fail[1].value);
  EXPECT_EQ(8u, loaded->task.version.size());
  EXPECT_NE(read(kTask)->task.version, loaded->task.version);
  for (const auto& [from, to, says] :
       {std::make_tuple("cuts: 0", "cut: 0", "unknown metric 'cut', did you mean 'cuts'"),
        {"cuts: 0", "cuts: many", "cuts is 'many'"},
        {"{cuts: 0, top_speed.pick: 6}", "[cuts]", "fail is a list of 1"},
        {"cuts: 0, top_speed.pick: 6", "cuts: 0, cuts: 1", "twice"},
        {"[undo, pause]", "[undo, cheat]", "allow has 'cheat'"},
        {"[undo, pause]", "undo", "allow is 'undo'"},
        {"settle: 1.5", "settle: 61", "settle is 61"}}) {
    std::string wrong = text;
    const auto refused = read(wrong.replace(wrong.find(from), std::string(from).size(), to));
    ASSERT_FALSE(refused.ok()) << to;
    EXPECT_NE(std::string::npos, refused.error().detail.find(says)) << refused.error().detail;
    EXPECT_NE(std::string::npos, refused.error().detail.find("accepted: ")) << refused.error().detail;
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

TEST(ShippedTasks, ArePassedByWhoDoesThemAsTheySay) {
  for (const auto& [name, play] : test::goodPlays()) {
    SCOPED_TRACE(name);
    test::ShippedTask task(name);
    play(task);
    EXPECT_TRUE(task.training->passed()) << task.told();
  }
}

TEST(ShippedTasks, AVesselThatIsCutBeforeItIsClippedBleeds) {
  for (const bool clips_first : {true, false}) {
    test::ShippedTask task("transect");
    test::playTransect(task, clips_first);
    EXPECT_EQ(clips_first, task.training->passed()) << task.told();
    if (clips_first) EXPECT_EQ(0.0, task.value("bleeding_time"));
    if (!clips_first) EXPECT_NEAR(0.5, task.value("bleeding_time"), 0.02);
  }
}

}  // namespace task_file_test
}  // namespace meshless
