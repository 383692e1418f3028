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
  app.add_option("--task", task_name, "a name of config/tasks, or a task file; by default those that the log says");
  app.add_option("--out", out, "the folder of reports")->capture_default_str();
  app.add_option("--trainee", trainee, "whose report it is, by default whom the log says; earlier ones of the same name are compared with it");
  app.add_option("--date", date, "when it was done, where the log does not say it: as in 2026-03-01T14:05:09Z, in UTC");
  std::vector<std::string> words;
  for (std::size_t k = 0; k < meshless::kInterventions; ++k)
    words.emplace_back(toString(static_cast<meshless::Intervention>(k)));
  app.add_option("--allow", allow, "what is allowed beside what the task and the log say")
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
  const auto allowIn = [&words](const std::vector<std::string>& what, meshless::TaskDef& task) {
    for (std::size_t k = 0; k < meshless::kInterventions; ++k)
      if (std::find(what.begin(), what.end(), words[k]) != what.end())
        task.allow.insert(static_cast<meshless::Intervention>(k));
  };
  struct Run {
    std::unique_ptr<meshless::Training> training;
    std::string trainee;
  };
  std::vector<Run> runs;
  std::optional<meshless::TaskDef> task;  // of the run that comes
  std::string whose = trainee;
  const auto take = [&](const std::string& of) -> meshless::Status {
    auto loaded = meshless::readTask(meshless::isTaskFile(of) ? of : configFolder() + "/tasks/" + of + ".yaml",
                                     std::nullopt, meshless::FileAccess());
    if (!loaded.ok()) return loaded.error();
    task = std::move(loaded->task);
    allowIn(allow, *task);
    return meshless::Done{};
  };
  const auto begin = [&](bool again) {
    runs.push_back({std::make_unique<meshless::Training>(*task, again), whose});
  };
  if (!task_name.empty()) {
    if (const meshless::Status taken = take(task_name); !taken.ok()) return refuse(taken.error().detail);
    begin(false);
  }
  std::optional<meshless::Error> misfit;
  bool ended = false;  // by stop_task: what comes then is of no task
  std::ifstream log(log_file, std::ios::binary);
  const auto replayed = meshless::replay(log, threads, [&](meshless::World& world) {
    std::vector<meshless::Event> events = world.takeEvents();
    if (misfit) return;
    bool taken_anew = false;
    for (const meshless::Event& event : events) {
      if (!event.task) continue;
      if (!event.task->begins) {
        ended = true;
        if (runs.empty()) continue;
        runs.back().training->stop();
        if (!runs.back().training->begun()) runs.pop_back();
        continue;
      }
      ended = false;
      if (!runs.empty()) runs.back().training->stop();
      if (const meshless::Status taken = take(task_name.empty() ? event.task->task : task_name); !taken.ok()) {
        misfit = meshless::Error{taken.error().code, "the task that the log says cannot be read: " + taken.error().detail +
                                                         "; or --task says another one"};
        return;
      }
      allowIn(event.task->allow, *task);
      if (trainee.empty()) whose = event.task->trainee;
      taken_anew = true;
      if (!runs.empty() && !runs.back().training->begun()) runs.pop_back();
      if (runs.empty()) begin(false);
    }
    if (runs.empty() || ended) return;  // nobody has begun a task yet, or it was stopped
    if (runs.back().training->begun() && world.snapshot({}).run != runs.back().training->run()) {
      runs.back().training->stop();
      if (!runs.back().training->tried()) runs.pop_back();
      begin(!taken_anew);
    }
    meshless::Training& training = *runs.back().training;
    meshless::TrainingFrame frame = meshless::frameOf(world, std::move(events), training.wants());
    const meshless::Status fed = training.feed(std::move(frame));
    if (!fed.ok()) misfit = fed.error();
    if (training.metrics().time() >= until - 1e-9) training.stop();
  });
  if (!replayed.ok()) return refuse(log_file + ": " + replayed.error().detail);
  if (misfit) return refuse(log_file + ": " + misfit->detail);
  if (runs.empty()) return refuse(log_file + ": the log says of no task; accepted: a log of a task, or --task");
  if (!runs.back().training->begun())
    return refuse(log_file + ": the log has no step; accepted: a log in which time has passed");
  runs.back().training->stop();

  const std::string log_name = fs::path(log_file).filename().string();
  const std::string lost = replayed->whatIsLost();
  for (std::size_t n = 0; n < runs.size(); ++n) {
    const auto& [of_run, of_whom] = runs[n];
    const meshless::Training& training = *of_run;
    // The last one has the name that there always was.
    const std::string name = log_name + (n + 1 < runs.size() ? ".run" + std::to_string(n + 1) : "") + ".report";
    if (const meshless::Status fits = meshless::SessionFolder::checkName(name); !fits.ok())
      return refuse(fits.error().detail);
    meshless::ReportHead head{of_whom, log_name, !replayed->difference, lost, {}, date};
    if (date.empty() && std::isfinite(training.startedAt())) head.date = meshless::dateText(training.startedAt());
    head.earlier = meshless::readEarlierReports(out, of_whom, training.task().name, name);
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
  return runs.back().training->passed() ? 0 : 1;
}
