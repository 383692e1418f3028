#include "meshless_surgery/training/report.h"

#include <algorithm>
#include <fstream>

#include "training/played.h"

namespace meshless {
namespace {

using test::Played;

std::unique_ptr<Played> aSession() {
  TaskDef task = test::openTask();
  task.brief = "<b>Cut</b> & \"look\"";
  task.target = Target{"ball", Region::sphere(Vec3(0, 0, 0.2), 0.03)};
  task.limits.measured.force = 1.0;
  task.metrics.push_back({"time", 2.0, 0.0, 1.0, 0.5});
  task.metrics.push_back({"plan_rms", 1.0, 0.0, 1.0, {}});
  auto played = std::make_unique<Played>(test::weightless(), task);
  EXPECT_TRUE(played->world.addSceneBody(test::shared(test::ball())).ok());
  played->begin();
  PickCommand pick;
  pick.point = Vec3(0, 0, 0.3);
  pick.max_distance = 0.2;
  const auto picked = played->apply<PickReply>(pick);
  for (int k = 0; k < 30; ++k) {
    played->apply<Done>(MovePickCommand{picked.pick, picked.position + 0.001 * k * Vec3::UnitZ()});
    played->step();
  }
  CutCommand cut;
  cut.blades = {Vec3(-1, 0, 0.25), Vec3::UnitX(), Vec3::UnitY(), 0.0, 0.0};
  played->apply<CutReply>(cut);
  played->step(3);
  return played;
}

bool balanced(const std::string& text, char open, char close) {
  long depth = 0;
  bool quoted = false;
  for (std::size_t k = 0; k < text.size(); ++k) {
    if (text[k] == '"' && (k == 0 || text[k - 1] != '\\')) quoted = !quoted;
    if (quoted) continue;
    depth += (text[k] == open) - (text[k] == close);
    if (depth < 0) return false;
  }
  return depth == 0 && !quoted;
}

TEST(Report, NeedsNoNetworkAndHasAllValues) {
  const auto played = aSession();
  ReportHead head{"Ann <x>", "log", true, "", {{"earlier", 40.0, false, {{"time", 3.0}}}}};
  const std::string html = reportHtml(played->training, head), json = reportJson(played->training, head),
                    csv = reportCsv(played->training);
  EXPECT_EQ(std::string::npos, html.find("http"));
  EXPECT_EQ(std::string::npos, html.find("src="));
  EXPECT_EQ(std::string::npos, html.find("<b>Cut"));
  EXPECT_EQ(std::string::npos, html.find("Ann <x>"));
  EXPECT_NE(std::string::npos, html.find("Ann &lt;x&gt;"));
  EXPECT_GE(static_cast<int>(std::count(html.begin(), html.end(), '\n')), 50);
  std::size_t pictures = 0;
  for (std::size_t at = html.find("<svg"); at != std::string::npos; at = html.find("<svg", at + 1)) ++pictures;
  EXPECT_EQ(1u + 3u + 1u + 2u, pictures);  // time, three views, earlier ones, two metrics
  EXPECT_TRUE(balanced(json, '{', '}') && balanced(json, '[', ']'));
  for (const std::string& name : metricNames()) {
    EXPECT_NE(std::string::npos, json.find('"' + name + '"')) << name;
    EXPECT_NE(std::string::npos, csv.find('\n' + name + ',')) << name;
  }
  EXPECT_NE(std::string::npos, json.find("\"name\": \"plan_rms\", \"unit\": \"m\", \"value\": null"));
  EXPECT_EQ(metricNames().size() + 1, static_cast<std::size_t>(std::count(csv.begin(), csv.end(), '\n')));
}

TEST(Report, SaysWhyItIsNotPassedInUnitsThatSurgeonsUse) {
  const auto played = aSession();
  const std::string html = reportHtml(played->training, {});
  EXPECT_NE(std::string::npos, html.find("Why it is not passed"));
  EXPECT_NE(std::string::npos, html.find("The stage <b>far away</b> was not met"));
  EXPECT_EQ(std::string::npos, html.find(">m^3<"));
  EXPECT_NE(std::string::npos, html.find(">ml<"));
  EXPECT_EQ(std::string::npos, html.find("-0.0 of 100"));
  EXPECT_EQ(std::string::npos, html.find("Done well"));
  EXPECT_NE(std::string::npos, html.find("by a script"));
  EXPECT_NE(std::string::npos, html.find("largest force of a tool [N]"));
  EXPECT_NE(std::string::npos, html.find("<h2>The cut</h2>"));
}

TEST(Report, HasNoPlotOfNothingAndBeginsWithWhatWasDoneWell) {
  TaskDef task;
  task.name = "wait";
  task.stages.push_back({"wait", "", LetGo{}, 0.1});
  task.metrics = {{"time", 1.0, 0.2, 1.0, {}}, {"cuts", 1.0, -1.0, 0.0, 0.0}};
  Played played(test::weightless(), task);
  ASSERT_TRUE(played.world.addSceneBody(test::shared(test::ball())).ok());
  played.begin();
  played.step(20);
  const std::string html = reportHtml(played.training, {});
  EXPECT_EQ(std::string::npos, html.find("largest force of a tool [N]"));
  EXPECT_EQ(std::string::npos, html.find("speed of the hands [mm/s]"));
  EXPECT_LT(html.find("<h2>Done well</h2><ul><li class=\"good\"><b>time</b>"),
            html.find("<h2>To work on</h2><ul><li class=\"\"><b>cuts</b>"));
  EXPECT_NE(std::string::npos, html.find("<h2>Where it was done</h2>"));
}

TEST(Report, OfAReplayIsTheSameText) {
  const auto played = aSession();
  const auto replayed = played->replayed();
  EXPECT_EQ(reportJson(played->training, {}), reportJson(*replayed, {}));
  EXPECT_EQ(reportHtml(played->training, {}), reportHtml(*replayed, {}));
}

TEST(MetricsPage, HasTheTable) {
  EXPECT_GE(metricTable().size(), 25u);
  std::ifstream file(std::string(SOURCE_DIR) + "/docs/metrics.md");
  const std::string page((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  EXPECT_NE(std::string::npos, page.find(metricsMarkdown())) << "docs/metrics.md should have:\n" << metricsMarkdown();
}

TEST(Metrics, EveryNameIsFoundAndNoOther) {
  for (const std::string& name : metricNames()) EXPECT_NE(nullptr, findMetric(name)) << name;
  for (const char* name : {"", "path_length", "path_length.foot", "time.pick", "Time"})
    EXPECT_EQ(nullptr, findMetric(name)) << name;
}

}  // namespace
}  // namespace meshless
