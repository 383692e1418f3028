// Does again what a log of commands says, and writes how a task was done in it.
#include <algorithm>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "meshless_surgery/base/share_folder.h"
#include "meshless_surgery/io/session_folder.h"
#include "meshless_surgery/io/task.h"
#include "meshless_surgery/world/command_log.h"

namespace {

namespace fs = std::filesystem;

std::string configFolder() {
#ifdef CONFIG_FOLDER
  return CONFIG_FOLDER;  // of the checkout: a build without ROS has no share folder
#else
  return meshless::shareFolder() + "/config";
#endif
}

int refuse(const std::string& why) {
  std::fprintf(stderr, "report: %s\n", why.c_str());
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Replays a log of commands (the parameter command_log of deformer_node) and writes how a task was done in it: "
      "report.html, report.json and report.csv in the folder LOG.report below --out. Where the world was reset in the "
      "log, the task begins anew there: runs before the last one, in which something was done, have their reports in "
      "LOG.run1.report and so on. Exit status: 0 the last one passed, 1 not passed, 2 no report could be made.");
  std::string log_file, task_name, out = ".", trainee, date;
  std::vector<std::string> allow;
  double until = 1e300;
  int threads = 1;
  app.add_option("log", log_file, "the log")->required()->check(CLI::ExistingFile);
  app.add_option("--task", task_name, "a name of config/tasks, or a task file")->required();
  app.add_option("--out", out, "the folder of reports")->capture_default_str();
  app.add_option("--trainee", trainee, "whose report it is; earlier ones of the same name are compared with it");
  app.add_option("--date", date, "when it was done, where the log does not say it: as in 2026-03-01T14:05:09Z, in UTC");
  std::vector<std::string> words;
  for (std::size_t k = 0; k < meshless::kInterventions; ++k)
    words.emplace_back(toString(static_cast<meshless::Intervention>(k)));
  app.add_option("--allow", allow, "what start_task allowed beside what the task does, which the log does not know")
      ->check(CLI::IsMember(words));
  app.add_option("--until", until, "[s] after the task's start: what comes later does not count");
  app.add_option("--threads", threads, "1..64; the result does not depend on it")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;  // --help is no error
  }

  if (!date.empty() && !meshless::isDate(date))
    return refuse("--date is '" + date + "'; accepted: a date and time in UTC, as in 2026-03-01T14:05:09Z");
  if (date.size() == 20) date.insert(19, ".000");  // of the length of all others, for their order
  const bool is_file = task_name.find('/') != std::string::npos || fs::path(task_name).extension() == ".yaml";
  const std::string task_file = is_file ? task_name : configFolder() + "/tasks/" + task_name + ".yaml";
  auto loaded = meshless::readTask(task_file, std::nullopt, meshless::FileAccess());
  if (!loaded.ok()) return refuse(loaded.error().detail);

  for (std::size_t k = 0; k < meshless::kInterventions; ++k)
    if (std::find(allow.begin(), allow.end(), words[k]) != allow.end())
      loaded->task.allow.insert(static_cast<meshless::Intervention>(k));

  std::vector<std::unique_ptr<meshless::Training>> runs;
  runs.push_back(std::make_unique<meshless::Training>(loaded->task));
  std::optional<meshless::Error> misfit;
  std::ifstream log(log_file, std::ios::binary);
  const auto replayed = meshless::replay(log, threads, [&](meshless::World& world) {
    std::vector<meshless::Event> events = world.takeEvents();
    if (misfit) return;
    if (runs.back()->begun() && world.snapshot({}).run != runs.back()->run()) {
      if (!runs.back()->tried()) runs.pop_back();
      if (!runs.empty()) runs.back()->stop();
      runs.push_back(std::make_unique<meshless::Training>(loaded->task, true));
    }
    meshless::TrainingFrame frame = meshless::frameOf(world, std::move(events), runs.back()->wants());
    const meshless::Status fed = runs.back()->feed(std::move(frame));
    if (!fed.ok()) misfit = fed.error();
    if (runs.back()->metrics().time() >= until - 1e-9) runs.back()->stop();
  });
  if (!replayed.ok()) return refuse(log_file + ": " + replayed.error().detail);
  if (misfit) return refuse(log_file + ": " + misfit->detail);
  if (!runs.back()->begun())
    return refuse(log_file + ": the log has no step; accepted: a log in which time has passed");
  runs.back()->stop();

  const std::string log_name = fs::path(log_file).filename().string();
  const std::string lost = replayed->whatIsLost();
  for (std::size_t n = 0; n < runs.size(); ++n) {
    const meshless::Training& training = *runs[n];
    // The last one has the name that there always was.
    const std::string name = log_name + (n + 1 < runs.size() ? ".run" + std::to_string(n + 1) : "") + ".report";
    if (const meshless::Status fits = meshless::SessionFolder::checkName(name); !fits.ok())
      return refuse(fits.error().detail);
    meshless::ReportHead head{trainee, log_name, !replayed->difference, lost, {}, date};
    if (date.empty() && std::isfinite(training.startedAt())) head.date = meshless::dateText(training.startedAt());
    head.earlier = meshless::readEarlierReports(out, trainee, training.task().name, name);
    const meshless::SessionFolder folder((fs::path(out) / name).string());
    const std::pair<const char*, std::string> files[] = {{"report.json", meshless::reportJson(training, head)},
                                                         {"report.csv", meshless::reportCsv(training)},
                                                         {"report.html", meshless::reportHtml(training, head)}};
    for (const auto& [file, bytes] : files)
      if (const meshless::Status written = folder.write(file, bytes); !written.ok())
        return refuse(written.error().detail);
    if (runs.size() > 1) std::printf("run %zu of %zu\n", n + 1, runs.size());
    std::printf("%s: %zu of %zu stages, %.1f s, %.1f of 100 (pass mark %.1f): %s\n", training.task().name.c_str(),
                training.progress().stage(), training.task().stages.size(), training.metrics().time(), training.score(),
                training.task().pass_mark, training.passed() ? "passed" : "not passed");
    if (!training.progress().failed().empty()) std::printf("failed: %s\n", training.progress().failed().c_str());
    if (head.date.empty())
      std::printf("no date: nobody watched the steps; --date gives the report one, for learning curves\n");
    if (!lost.empty()) std::printf("%s; the report is of what there is\n", lost.c_str());
    if (replayed->difference)
      std::printf("DIFFERENT from step %" PRIu64
                  " on: the report is of another session than the one that was recorded\n",
                  replayed->difference->step);
    std::printf("%s/report.html\n", folder.folder().c_str());
    for (const std::string& why : training.notCounted()) std::printf("does not count: %s\n", why.c_str());
  }
  return runs.back()->passed() ? 0 : 1;
}
