#include "live_training.h"

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <tuple>

#include <meshless_surgery/Metrics.h>
#include <meshless_surgery/Observe.h>
#include <meshless_surgery/Report.h>
#include <meshless_surgery/StartTask.h>
#include <meshless_surgery/TaskState.h>
#include <ros/publisher.h>
#include <std_srvs/Trigger.h>
#include <visualization_msgs/MarkerArray.h>

#include "answers.h"
#include "meshless_surgery/io/session_folder.h"
#include "meshless_surgery/training/followed_places.h"

namespace meshless {
namespace {

namespace fs = std::filesystem;

constexpr double kMetricsRate = 10.0;  // [Hz]
constexpr double kReportEvery = 5.0;   // [s]
constexpr std::size_t kMostTrainee = 100;
constexpr std::size_t kLongestName = 200;  // bytes of a folder's name, before its number
constexpr int kMostReports = 100000;
constexpr std::size_t kMostPlaces = 10000;
constexpr double kPlanLine = 0.002;  // [m] half of it is above the tissue

visualization_msgs::Marker markerOf(const std::string& ns, int type, float r, float g, float b, float a) {
  visualization_msgs::Marker marker;
  marker.ns = ns;
  marker.type = type;
  marker.pose.orientation.w = 1.0;
  marker.color.r = r;
  marker.color.g = g;
  marker.color.b = b;
  marker.color.a = a;
  return marker;
}

void setSize(visualization_msgs::Marker& marker, const Vec3& size) {
  marker.scale.x = size.x();
  marker.scale.y = size.y();
  marker.scale.z = size.z();
}

/// What of a task lies in the world: plan and target go with their tissue.
struct ShownTask {
  std::uint64_t version = ~std::uint64_t{0};
  std::optional<Target> target;
  std::optional<Box> tray;
  FollowedPlaces plan, middle;

  ShownTask() = default;
  ShownTask(const Training& training, std::uint64_t version_in)
      : version(version_in), target(training.task().target), tray(training.task().tray) {
    if (const auto& of = training.task().plan)
      plan = FollowedPlaces(of->body, training.tissue().planOutline(), of->side());
    if (target) middle = FollowedPlaces(target->body, {target->middle()}, Vec3::Zero());
  }

  /// Ends of lines, two each [m]; none where a line's tissue is gone.
  Points planNow(const WorldSnapshot& shot) {
    Points lines = plan.now(shot);
    std::size_t kept = 0;
    for (std::size_t k = 0; k + 1 < lines.size(); k += 2) {
      if (!lines[k].allFinite() || !lines[k + 1].allFinite()) continue;
      lines[kept++] = lines[k];
      lines[kept++] = lines[k + 1];
    }
    lines.resize(kept);
    return lines;
  }
  /// [m] of the target's middle; NaN where there is none, or its tissue is gone.
  Vec3 middleNow(const WorldSnapshot& shot) {
    return target ? middle.now(shot)[0] : Vec3(Vec3::Constant(std::numeric_limits<double>::quiet_NaN()));
  }
};

visualization_msgs::MarkerArray toMarkers(ShownTask& shown, const WorldSnapshot& shot) {
  visualization_msgs::MarkerArray array;
  array.markers.emplace_back();
  array.markers.back().action = visualization_msgs::Marker::DELETEALL;
  if (const Points lines = shown.planNow(shot); !lines.empty()) {
    visualization_msgs::Marker plan = markerOf("plan", visualization_msgs::Marker::LINE_LIST, 0.1f, 0.3f, 1.0f, 1.0f);
    plan.scale.x = kPlanLine;
    for (const Vec3& p : lines) plan.points.push_back(toPoint(p));
    array.markers.push_back(std::move(plan));
  }
  if (const Vec3 middle = shown.middleNow(shot);
      middle.allFinite() && shown.target->region.kind == Region::Kind::kSphere) {
    visualization_msgs::Marker target = markerOf("target", visualization_msgs::Marker::SPHERE, 0.9f, 0.75f, 0.2f, 0.6f);
    target.pose.position = toPoint(middle);
    setSize(target, Vec3::Constant(2.0 * shown.target->region.radius));
    array.markers.push_back(std::move(target));
  }
  if (shown.tray) {
    visualization_msgs::Marker tray = markerOf("tray", visualization_msgs::Marker::CUBE, 0.3f, 0.7f, 0.4f, 0.2f);
    tray.pose.position = toPoint(0.5 * (shown.tray->min + shown.tray->max));
    setSize(tray, shown.tray->max - shown.tray->min);
    array.markers.push_back(std::move(tray));
  }
  return array;
}

}  // namespace

Result<LoadedTask> loadTask(const std::string& task, const TrainingFolders& folders) {
  const bool is_file = isTaskFile(task);
  std::string file = folders.tasks + "/" + task + ".yaml";
  if (is_file) {
    auto resolved = folders.access.resolve(task, fs::path(folders.scene_file).parent_path().string());
    if (!resolved.ok()) return resolved.error();
    file = *resolved;
  } else if (!SessionFolder::checkName(task).ok()) {
    return Error{ErrorCode::kInvalidArgument,
                 "task is '" + printable(task) + "'; accepted: a name of config/tasks, a path, or package://"};
  }
  return readTask(file, folders.scenes, folders.access, folders.scene_file);
}

/// Which run of which task.
struct RunId {
  std::uint64_t taken = 0;
  std::uint32_t run = 0;
  bool operator<(const RunId& other) const { return std::tie(taken, run) < std::tie(other.taken, other.run); }
  bool operator==(const RunId& other) const { return taken == other.taken && run == other.run; }
};
struct EndedRun {
  RunId id;
  std::string trainee;
  std::unique_ptr<Training> training;
};

struct LiveTraining::Handlers : Answers {
  Handlers(const ros::NodeHandle& private_handle, WorldRunner& runner_in, TrainingFolders folders_in,
           std::string world_frame_in, Rejections& rejections_in, const StreamedTools& tools_in)
      : Answers{rejections_in},
        tools(tools_in),
        handle(private_handle),
        runner(runner_in),
        folders(std::move(folders_in)),
        world_frame(std::move(world_frame_in)) {
    handle.setCallbackQueue(&queue);
  }

  void start() {
    task_topic = handle.advertise<meshless_surgery::TaskState>("task", 1, true);
    markers_topic = handle.advertise<visualization_msgs::MarkerArray>("task_markers", 1, true);
    metrics_topic = handle.advertise<meshless_surgery::Metrics>("metrics", 10);
    servers = {handle.advertiseService("start_task", &Handlers::startTask, this),
               handle.advertiseService("stop_task", &Handlers::stopTask, this),
               handle.advertiseService("report", &Handlers::report, this),
               handle.advertiseService("observe", &Handlers::observe, this)};
    timer = handle.createWallTimer(ros::WallDuration(1.0 / kMetricsRate), &Handlers::publish, this);
    spinner.start();
  }

  // --- on the runner's thread

  void take(TaskDef task, const std::string& of) {
    if (training) giveUp(nullptr);
    trainee = of;
    training = std::make_unique<Training>(std::move(task));
    stopped = false;
    ++version;
    ++taken;
    guard();
  }

  /// What a task that runs refuses.
  void guard() {
    const std::lock_guard<std::mutex> lock(guard_mutex);
    guarded = training && !stopped && !training->over() ? training->task().name : "";
    if (training) allowed = training->task().allow;
    if (!training || !training->tried()) allowed.insert(Intervention::kPause);  // nothing has been done yet
  }
  std::optional<Error> refuses(Intervention intervention) const {
    const std::lock_guard<std::mutex> lock(guard_mutex);
    if (guarded.empty() || allowed.count(intervention)) return std::nullopt;
    std::string words;
    for (const Intervention one : allowed) words += (words.empty() ? "" : ", ") + std::string(toString(one));
    return Error{ErrorCode::kForbidden,
                 "the task '" + guarded + "' runs and does not allow " + toString(intervention) +
                     "; accepted: " + (words.empty() ? "" : "what it allows (" + words + "), or ") +
                     "once it is over or stop_task has ended it, or in a task that is begun with allow: [" +
                     toString(intervention) + "]"};
  }

  /// A run that somebody has watched and done something in has a report, however it ends.
  static bool isWorthAReport(const Training& of) { return of.tried() && of.metrics().wallTime() > 0.0; }
  /// Another run begins: what is to be said of this one is.
  void giveUp(std::unique_ptr<Training> next) {
    training->stop();
    if (training->begun() && isWorthAReport(*training)) {
      const std::lock_guard<std::mutex> lock(ended_mutex);
      ended.push_back({RunId{taken, training->run()}, trainee, std::move(training)});
    }
    training = std::move(next);
  }

  void changed(World& world, double dt) {
    if (!training || stopped || !(dt > 0.0)) return;
    TrainingFrame frame = frameOf(world, std::exchange(events, {}), training->wants());
    if (training->begun() && frame.run != training->run() && training->tried())
      giveUp(std::make_unique<Training>(training->task(), true));
    const std::size_t stage = training->progress().stage();
    const double planned = training->tissue().planDone();
    const bool was_over = training->begun() && training->over(), had_begun = training->begun();
    const bool settled = !training->settling();
    const Status fed = training->feed(std::move(frame));
    if (!fed.ok()) {
      rejections.count("~task", fed.error().detail);
      training.reset();
      ++version;
    } else if (!had_begun || settled == training->settling() || stage != training->progress().stage() ||
               was_over != training->over() || (training->task().plan && planned != training->tissue().planDone())) {
      ++version;
    }
    guard();
  }

  /// The world as it is now, with the tissue that something of the task is shown in.
  WorldSnapshot see(World& world, SnapshotWants wants) {
    const std::uint64_t present = version.load();
    if (shown.version != present) shown = training ? ShownTask(*training, present) : ShownTask();
    wants.particles = wants.particles || (training && (training->task().plan || training->task().target));
    return world.snapshot(wants);
  }

  void fill(meshless_surgery::TaskState& state, meshless_surgery::Metrics& now) const {
    state.trainee = trainee;
    if (training) {
      const TaskDef& task = training->task();
      state.task = task.name;
      state.brief = task.brief;
      state.running = !training->over();
      for (const Stage& stage : task.stages) state.stages.push_back(stage.name);
      state.stage = static_cast<std::uint32_t>(training->progress().stage());
      if (state.stage < task.stages.size()) state.stage_brief = task.stages[state.stage].brief;
      state.failed = training->progress().failed();
      if (task.limits.time) state.time_limit = *task.limits.time;
      if (std::isfinite(task.limits.measured.force)) state.force_limit = task.limits.measured.force;
      state.score = training->score();
      state.passed = training->passed();
      state.settling = training->settling();
      state.not_counted = training->notCounted();
      for (const Intervention one : task.allow) state.allowed.push_back(toString(one));
      state.plan_done = training->tissue().planDone();
      now.time = training->metrics().time();
      now.held_for = training->progress().heldFor();
      for (MetricValue& value : training->values()) {
        now.names.push_back(std::move(value.name));
        now.values.push_back(value.value);
      }
    }
  }

  // --- on this thread

  void publish(const ros::WallTimerEvent&) {
    reportEnded();
    const bool news = !said_any || version.load() != said_version;
    const bool seen = markers_topic.getNumSubscribers() > 0;
    if (!news && !seen && metrics_topic.getNumSubscribers() == 0) return;
    meshless_surgery::TaskState state;
    meshless_surgery::Metrics now;
    std::optional<WorldSnapshot> shot;
    std::uint64_t present = 0;
    const Status looked = runner.look([&](World& world) {
      fill(state, now);
      if (news || seen) shot = see(world, {});
      present = version.load();
    });
    if (!looked.ok()) return;
    state.header.stamp = now.header.stamp = ros::Time::now();
    state.header.frame_id = now.header.frame_id = world_frame;
    if (news) task_topic.publish(state);
    // Also where nothing moves: who comes late is to find what is there now.
    if (shot) {
      visualization_msgs::MarkerArray markers = toMarkers(shown, *shot);
      for (visualization_msgs::Marker& marker : markers.markers) marker.header = state.header;
      markers_topic.publish(markers);
    }
    if (!now.names.empty() && (news || now.time != said_time)) metrics_topic.publish(now);
    said_any = true;
    said_version = present;
    said_time = now.time;
  }

  bool startTask(meshless_surgery::StartTask::Request& request, meshless_surgery::StartTask::Response& response) {
    if (request.trainee.size() > kMostTrainee || request.trainee != printable(request.trainee, kMostTrainee))
      return refuse(response, "start_task",
                    {ErrorCode::kInvalidArgument, "trainee is '" + printable(request.trainee) +
                                                      "'; accepted: up to 100 bytes of UTF-8 in one line"});
    auto loaded = loadTask(request.task, folders);
    if (!loaded.ok()) return refuse(response, "start_task", loaded.error());
    for (const std::string& word : request.allow) {
      std::string words;
      std::size_t k = 0;
      for (; k < kInterventions && word != toString(static_cast<Intervention>(k)); ++k)
        words += (k ? ", " : "") + std::string(toString(static_cast<Intervention>(k)));
      if (k == kInterventions)
        return refuse(response, "start_task",
                      {ErrorCode::kInvalidArgument, "allow has '" + printable(word) + "'; accepted: " + words});
      loaded->task.allow.insert(static_cast<Intervention>(k));
    }
    const std::string name = loaded->task.name;
    // First the task, then the reset: it begins with the first step of the new run, as it does in a replay.
    const Status taken = runner.look([&](World& world) {
      take(std::move(loaded->task), request.trainee);
      world.noteTask({true, isTaskFile(request.task) ? loaded->file : request.task, request.trainee, request.allow});
    });
    if (!taken.ok()) return refuse(response, "start_task", taken.error());
    const Status reset = runner.reset();
    if (!reset.ok()) return refuse(response, "start_task", reset.error());
    return accept(response, "the task '" + name + "' begins" + tools.notEnabled());
  }

  bool stopTask(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    bool runs = false;
    const Status done = runner.look([&](World& world) {
      runs = training && !stopped;
      if (!runs) return;
      world.noteTask({false, training->task().name, trainee, {}});
      training->stop();
      stopped = true;
      ++version;
      guard();
    });
    if (!done.ok()) return refuse(response, "stop_task", done.error());
    if (!runs) return refuse(response, "stop_task", {ErrorCode::kMissed, "no task runs; start_task begins one"});
    return accept(response, "the task was stopped; report writes how it was done");
  }

  bool observe(meshless_surgery::Observe::Request& request, meshless_surgery::Observe::Response& response) {
    if (request.bodies.size() != request.particles.size() || request.bodies.size() > kMostPlaces)
      return refuse(response, "observe",
                    {ErrorCode::kInvalidArgument, std::to_string(request.bodies.size()) + " bodies and " +
                                                      std::to_string(request.particles.size()) +
                                                      " particles; accepted: one body a particle, up to 10000"});
    std::optional<WorldSnapshot> shot;
    const Status done = runner.look([&](World& world) {
      SnapshotWants wants;
      wants.particles = !request.bodies.empty();
      shot = see(world, wants);
      fill(response.task, response.metrics);
    });
    if (!done.ok()) return refuse(response, "observe", done.error());
    response.step = shot->step;
    response.sim_time = shot->sim_time;
    response.picks = toPicks(*shot);
    response.push = shot->push.enabled;
    response.push_position = toPoint(shot->push.position);
    response.push_force = toVector(shot->push.force);
    response.points.reserve(request.bodies.size());
    for (std::size_t k = 0; k < request.bodies.size(); ++k) {
      Vec3 place = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
      for (const BodySnapshot& body : shot->bodies)
        if (body.name == request.bodies[k] && request.particles[k] < body.particles.size())
          place = body.particles[request.particles[k]];
      response.points.push_back(toPoint(place));
    }
    for (const Vec3& p : shown.planNow(*shot)) response.plan.push_back(toPoint(p));
    response.target = toPoint(shown.middleNow(*shot));
    response.task.header.stamp = response.metrics.header.stamp = ros::Time::now();
    response.task.header.frame_id = response.metrics.header.frame_id = world_frame;
    return accept(response, "step " + std::to_string(shot->step));
  }

  bool report(meshless_surgery::Report::Request& request, meshless_surgery::Report::Response& response) {
    if (!request.name.empty())
      if (const Status valid = SessionFolder::checkName(request.name, "name"); !valid.ok())
        return refuse(response, "report", valid.error());
    const auto written = reportNow(request.name);
    if (!written.ok()) return refuse(response, "report", written.error());
    response.score = written->score;
    response.passed = written->passed;
    response.folder = written->folder;
    return accept(response, "wrote " + response.folder + "/report.html");
  }

  struct Pages {
    std::string json, csv, html, folder;
    double score = 0.0;
    bool passed = false;
  };
  static Pages pagesOf(const Training& of, const ReportHead& head) {
    return {reportJson(of, head), reportCsv(of), reportHtml(of, head), "", of.score(), of.passed()};
  }

  /// Of the run that goes on, or was the last. It keeps its folder, unless another name is asked for.
  Result<Pages> reportNow(const std::string& wanted) {
    bool there = false;
    ReportHead head;
    std::string task;
    RunId run;
    double started = 0.0;
    Status done = runner.look([&](World&) {
      there = training && training->begun();
      if (!there) return;
      task = training->task().name;
      run = {taken, training->run()};
      started = training->startedAt();
      head.trainee = trainee;
    });
    if (!done.ok()) return done.error();
    if (!there) return Error{ErrorCode::kMissed, "no task was begun; start_task begins one"};
    const std::string name = prepare(head, task, run, started, wanted);
    Pages pages;
    done = runner.look([&](World&) {
      there = training && training->begun() && run == RunId{taken, training->run()};
      if (there) pages = pagesOf(*training, head);
    });
    if (!done.ok()) return done.error();
    if (!there) return Error{ErrorCode::kMissed, "another run has begun meanwhile; report again"};
    return written(std::move(pages), name);
  }

  /// The name of the report's folder.
  std::string prepare(ReportHead& head, const std::string& task, const RunId& run, double started,
                      const std::string& wanted = "") {
    std::string& name = names_of_runs[run];
    if (!wanted.empty())
      name = wanted;
    else if (name.empty())
      name = freeName(head.trainee, task);
    head.log = folders.log;
    head.date = std::isfinite(started) ? dateText(started) : dateText(std::chrono::system_clock::now());
    head.earlier = readEarlierReports(folders.reports, head.trainee, task, name);
    return name;
  }

  Result<Pages> written(Pages pages, const std::string& name) const {
    pages.folder = folders.reports + "/" + name;
    const SessionFolder folder(pages.folder);
    for (const auto& [file, bytes] :
         {std::make_pair("report.json", &pages.json), {"report.csv", &pages.csv}, {"report.html", &pages.html}})
      if (const Status done = folder.write(file, *bytes); !done.ok()) return done.error();
    return pages;
  }

  /// Those of runs that another one has followed, and that of a run that is over.
  void reportEnded() {
    std::vector<EndedRun> runs;
    {
      const std::lock_guard<std::mutex> lock(ended_mutex);
      runs.swap(ended);
    }
    for (const EndedRun& run : runs) {
      if (reported.count(run.id)) continue;
      ReportHead head;
      head.trainee = run.trainee;
      const std::string name = prepare(head, run.training->task().name, run.id, run.training->startedAt());
      if (say(written(pagesOf(*run.training, head), name))) reported.insert(run.id);
    }
    RunId run;
    bool due = false;
    const Status done = runner.look([&](World&) {
      if (!training || !training->begun()) return;
      run = {taken, training->run()};
      due = training->over() && isWorthAReport(*training);
    });
    if (!done.ok() || !due || reported.count(run)) return;
    if (say(reportNow(""))) reported.insert(run);
  }

  static bool say(const Result<Pages>& pages) {
    if (pages.ok())
      ROS_INFO_STREAM("the report is " << pages->folder << "/report.html");
    else
      ROS_WARN_STREAM_THROTTLE(kReportEvery, "no report could be written: " << pages.error().detail);
    return pages.ok();
  }

  /// Of what the node was in the middle of; nothing else runs any more.
  void reportLast() {
    if (training) giveUp(nullptr);
    reportEnded();
  }

  /// TRAINEE_TASK and the first number that no folder has. Letters of all alphabets stay: names are UTF-8.
  std::string freeName(const std::string& of, const std::string& task) const {
    std::string start;
    for (const char c : of.empty() ? task : of + "_" + task)
      start += std::isalnum(static_cast<unsigned char>(c)) || (c & 0x80) || c == '_' || c == '-' ? c : '_';
    if (start.size() > kLongestName) {
      std::size_t size = kLongestName;
      while (size > 0 && (start[size] & 0xc0) == 0x80) --size;  // whole letters
      start.resize(size);
    }
    for (int number = 1;; ++number) {
      const std::string name = start + "_" + std::to_string(number);
      std::error_code failed;
      if (number >= kMostReports || !fs::exists(folders.reports + "/" + name, failed)) return name;
    }
  }

  const StreamedTools& tools;
  ros::NodeHandle handle;
  WorldRunner& runner;
  const TrainingFolders folders;
  const std::string world_frame;
  ros::CallbackQueue queue;
  ros::AsyncSpinner spinner{1, &queue};
  ros::Publisher task_topic, metrics_topic, markers_topic;
  std::vector<ros::ServiceServer> servers;
  ros::WallTimer timer;

  mutable std::mutex guard_mutex;
  std::string guarded;  // the task that runs; empty: none
  std::set<Intervention> allowed;
  std::mutex ended_mutex;
  std::vector<EndedRun> ended;

  // of the timer and the services
  std::map<RunId, std::string> names_of_runs;
  std::set<RunId> reported;  // whole, as they are over

  // of the runner's thread
  std::uint64_t taken = 0;  // tasks
  std::unique_ptr<Training> training;
  std::string trainee;
  bool stopped = false;
  std::vector<Event> events;  // since the last step

  std::atomic<std::uint64_t> version{0};  // of what ~task says

  ShownTask shown;  // of the thread of the timer and the services

  // of the timer
  std::uint64_t said_version = 0;
  bool said_any = false;
  double said_time = -1.0;
};

LiveTraining::LiveTraining(const ros::NodeHandle& private_handle, WorldRunner& runner, TrainingFolders folders,
                           std::string world_frame, Rejections& rejections, const StreamedTools& tools)
    : handlers_(std::make_unique<Handlers>(private_handle, runner, std::move(folders), std::move(world_frame),
                                           rejections, tools)) {}

LiveTraining::~LiveTraining() { stop(); }

void LiveTraining::begin(TaskDef task, const std::string& trainee) { handlers_->take(std::move(task), trainee); }

void LiveTraining::start() { handlers_->start(); }

void LiveTraining::stop() {
  if (handlers_->servers.empty()) return;
  handlers_->spinner.stop();
  handlers_->servers.clear();
  handlers_->timer.stop();
  handlers_->reportLast();
}

std::optional<Error> LiveTraining::refuses(Intervention intervention) const { return handlers_->refuses(intervention); }

void LiveTraining::heard(const std::vector<Event>& events) {
  if (handlers_->training && !handlers_->stopped)
    handlers_->events.insert(handlers_->events.end(), events.begin(), events.end());
}

void LiveTraining::changed(World& world, double dt) { handlers_->changed(world, dt); }

}  // namespace meshless
