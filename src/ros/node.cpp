#include "meshless_surgery/ros/node.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include <ros/console.h>
#include <ros/package.h>
#include <ros/param.h>
#include <ros/this_node.h>

#include "border_check.h"
#include "clamp_follower.h"
#include "clock_publisher.h"
#include "convert.h"
#include "force_publisher.h"
#include "live_training.h"
#include "meshless_surgery/world/in_ground.h"
#include "publishers.h"
#include "services.h"
#include "session.h"
#include "tool_inputs.h"

namespace meshless {
namespace {

namespace fs = std::filesystem;

constexpr char kPackage[] = "meshless_surgery";

/// With links resolved, as FileAccess compares real paths; unchanged where there is nothing.
std::string realPath(const std::string& path) {
  std::error_code missing;
  const fs::path real = fs::canonical(path, missing);
  return missing ? path : real.string();
}

std::string scenesIn(const std::string& folder) {
  std::set<std::string> names;
  std::error_code failed;
  for (fs::directory_iterator entry(folder, failed), end; !failed && entry != end; entry.increment(failed))
    if (entry->path().extension() == ".yaml") names.insert(entry->path().stem().string());
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

/// The file of a scene that was given as a name in config/scenes, a path or package://.
Result<std::string> sceneFile(const std::string& scene, const std::string& package_folder, const FileAccess& access) {
  std::string path = package_folder + "/config/scenes/" + scene + ".yaml";
  if (scene.find('/') != std::string::npos || scene.find(".yaml") != std::string::npos) {
    const Result<std::string> located = access.located(scene, "");
    if (!located.ok())
      return Error{ErrorCode::kUnreadable,
                   "scene is '" + printable(scene) + "'; accepted: package://NAME/PATH of a package that is found"};
    path = *located;
  }
  std::error_code missing;
  if (!fs::is_regular_file(path, missing)) {
    return Error{ErrorCode::kUnreadable, "scene is '" + printable(scene) + "', and there is no file " +
                                             printable(path) + "; accepted: a path, or one of " +
                                             scenesIn(package_folder + "/config/scenes")};
  }
  return realPath(path);
}

/// A name of config/tasks, a path or package://: who starts the node may name any.
Result<LoadedTask> parameterTask(const std::string& task, const TrainingFolders& folders, const FileAccess& access) {
  const Result<std::string> file = isTaskFile(task) ? access.located(task, "") : folders.tasks + "/" + task + ".yaml";
  if (!file.ok()) return file.error();
  return readTask(*file, folders.scenes, access);
}

void applyOverrides(const NodeSettings& settings, WorldSettings& world) {
  if (settings.pick_max_distance) world.pick_max_distance = *settings.pick_max_distance;
  if (settings.pick_stiffness) world.pick_stiffness = *settings.pick_stiffness;
  if (settings.push_radius) world.push_radius = *settings.push_radius;
}

/// What a session's files are about. An autosave is taken up by the node that roslaunch starts again after a kill, not
/// by another launch.
SessionSettings sessionSettings(const NodeSettings& settings, const std::string& scene_file) {
  SessionSettings session;
  session.folder = sessionFolderOf(settings.session_directory);
  session.command_log = settings.command_log;
  session.autosave_period = settings.autosave_period;
  session.autosave_name = autosaveNameOf(ros::this_node::getName());
  std::string run_id;
  ros::param::get("/run_id", run_id);
  session.origin = "scene " + scene_file + ", launch " + run_id;
  return session;
}

}  // namespace

struct DeformerNode::Parts {
  Parts(const ros::NodeHandle& handle, const NodeSettings& settings, std::unique_ptr<World> world, BodyLoader loader_in,
        std::unique_ptr<Session> session_in, std::unique_ptr<Rejections> rejections_in,
        std::unique_ptr<ClockPublisher> clock_publisher_in, std::vector<ClampFollower::Followed> followed)
      : rejections(std::move(rejections_in)),
        clock_publisher(std::move(clock_publisher_in)),
        session(std::move(session_in)),
        runner(std::move(world), {settings.paused, settings.max_backlog}, clock_publisher ? wall : clock),
        frames(settings.world_frame, clock),
        loader(std::move(loader_in)),
        inputs(handle, settings, clock, runner, frames, *rejections),
        named(handle, settings, clock, runner, frames, *rejections, inputs.tools()),
        follower(handle, std::move(followed), runner, frames),
        publishers(handle, settings, runner, inputs.tools(), &named, *rejections),
        forces(handle, settings, clock, inputs.tools()) {}

  ~Parts() {
    (void)runner.setPaused(true);  // the log ends with the last step
    session->endLog(runner);
    // First the world, so that whoever waits for it gets an answer; the services last, as a body may be being prepared.
    follower.stop();
    runner.stop();
    if (training) training->stop();
    publishers.stop();
    forces.stop();
    session->stop();
    services.reset();
  }

  std::unique_ptr<Rejections> rejections;
  std::unique_ptr<ClockPublisher> clock_publisher;  // null: without publish_clock
  const Clock clock =
      clock_publisher ? Clock([this] { return clock_publisher->now(); }, true) : Clock();  // of all below
  const Clock wall = Clock::steady();  // of the steps alone, where they make the time
  std::unique_ptr<Session> session;
  WorldRunner runner;
  Frames frames;
  BodyLoader loader;
  ToolInputs inputs;
  NamedInstruments named;
  ClampFollower follower;
  Publishers publishers;
  ForcePublisher forces;
  std::unique_ptr<LiveTraining> training;
  std::unique_ptr<Services> services;
};

DeformerNode::DeformerNode(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
DeformerNode::~DeformerNode() = default;

Result<std::unique_ptr<DeformerNode>> DeformerNode::start(const ros::NodeHandle& private_handle) {
  std::vector<std::string> unknown;
  auto settings = readNodeSettings(private_handle, unknown);
  if (!settings.ok()) return settings.error();
  for (const std::string& name : unknown) ROS_WARN_STREAM("parameter ~" << name << " is not known, and not used");

  auto rejections = std::make_unique<Rejections>();
  std::unique_ptr<ClockPublisher> clock_publisher;
  if (settings->publish_clock) {
    auto started = ClockPublisher::start(*rejections);
    if (!started.ok()) return started.error();
    clock_publisher = std::move(*started);
  }

  const std::string package_folder = ros::package::getPath(kPackage);
  FileAccess access;
  access.find_package = [](const std::string& package) { return ros::package::getPath(package); };
  access.folders = {realPath(package_folder)};
  access.more = "below a folder of the parameter data_folders";
  for (const std::string& folder : settings->data_folders) {
    std::error_code missing;
    if (!fs::is_directory(folder, missing)) {
      return Error{
          ErrorCode::kUnreadable,
          "parameter ~data_folders names '" + printable(folder) + "'; accepted: folders that exist" +
              (folder[0] == '[' ? ", a list of them from a launch file, and one without brackets from a line of rosrun"
                                : "")};
    }
    access.folders.push_back(realPath(folder));
  }
  TrainingFolders training_folders;
  training_folders.scenes = package_folder + "/config/scenes";
  training_folders.tasks = package_folder + "/config/tasks";
  std::optional<TaskDef> task;
  std::string task_file;
  if (!settings->task.empty()) {
    auto loaded = parameterTask(settings->task, training_folders, access);
    if (!loaded.ok()) return Error{loaded.error().code, "parameter ~task: " + loaded.error().detail};
    task_file = isTaskFile(settings->task) ? loaded->file : settings->task;
    task = std::move(loaded->task);
    settings->scene = loaded->scene_file;
  }
  const auto file = sceneFile(settings->scene, package_folder, access);
  if (!file.ok()) return file.error();
  settings->scene = *file;
  const std::string scene_folder = fs::path(*file).parent_path().string();

  access.folders.push_back(scene_folder);
  auto scene = readScene(*file, access);
  if (!scene.ok()) return scene.error();
  applyOverrides(*settings, scene->world);
  const Status valid = scene->world.validate();
  if (!valid.ok()) return valid.error();
  auto world = std::make_unique<World>(scene->world);
  std::size_t particles = 0;
  std::size_t clusters = 0;
  for (const std::string& warning : scene->warnings) ROS_WARN_STREAM(warning);
  const std::size_t bodies = scene->bodies.size();
  std::shared_ptr<const PreparedBody> first;  // of the copies that share its model
  double blades = kBlades;                    // that fit every body
  std::vector<ClampFollower::Followed> followed;
  for (BodyDef& def : scene->bodies) {
    const std::string name = def.name;
    for (std::uint32_t clamp = 0; clamp < def.fixed.size(); ++clamp)
      if (!def.fixed[clamp].follows.empty()) followed.push_back({name, clamp, def.fixed[clamp].follows});
    std::shared_ptr<const PreparedBody> ready;
    if (first && def.copy && def.fixed.empty()) {  // boxes fix what is in them: each copy is then another body
      ready = std::make_shared<PreparedBody>(placedCopy(*first, name, def.pose));
    } else {
      auto body = prepareBody(std::move(def));
      if (!body.ok()) return Error{body.error().code, *file + ": body " + name + ": " + body.error().detail};
      ready = first = std::make_shared<PreparedBody>(std::move(*body));
      blades = std::min(blades, bladesFor(ready->model->surface.vertices));
      const auto info = toInfo(name, *ready->model, scene->world);
      ROS_INFO_STREAM("body " << name << ": " << info.particles << " particles, " << 1000.0 * info.spacing
                              << " mm apart, " << info.mass << " kg; needs " << info.substeps_needed
                              << " substeps a step, of up to " << scene->world.max_substeps);
      for (const std::string& note : ready->def.notes) ROS_INFO_STREAM("body " << name << ": " << note);
      for (const std::string& warning : ready->def.warnings) ROS_WARN_STREAM("body " << name << ": " << warning);
    }
    const auto added = world->addSceneBody(ready);
    if (!added.ok()) return Error{added.error().code, *file + ": body " + name + ": " + added.error().detail};
    if (const std::string in_ground = warnOfGround(*ready, scene->world.ground); !in_ground.empty())
      ROS_WARN_STREAM("body " << name << ": " << in_ground);
    particles += added->particles;
    clusters += added->clusters;
  }
  for (ObstacleDef& def : scene->obstacles)
    if (const Status added = world->addObstacle(std::move(def)); !added.ok())
      return Error{added.error().code, *file + ": " + added.error().detail};
  for (const AttachCommand& attachment : scene->attachments) {
    const auto added = world->addSceneAttachment(attachment);
    if (!added.ok()) return Error{added.error().code, *file + ": attachments: " + added.error().detail};
    ROS_INFO_STREAM("attachment " << added->name << ": " << added->text());
  }

  for (const InstrumentDef& def : scene->instruments)
    if (const Status added = world->addSceneInstrument(def); !added.ok())
      return Error{added.error().code, *file + ": instruments: " + added.error().detail};

  for (std::optional<double>* size : {&settings->scissors_length, &settings->scissors_width})
    if (!*size) *size = blades;

  const SessionSettings session_settings = sessionSettings(*settings, *file);
  training_folders.access = access;
  training_folders.scene_file = *file;
  training_folders.reports = session_settings.folder + "/reports";
  auto session = std::make_unique<Session>(session_settings);
  const auto taken_up = session->takeUp(*world);
  if (!taken_up.ok()) {
    return Error{taken_up.error().code,
                 "parameters ~autosave_period and ~session_directory: " + taken_up.error().detail};
  }
  if (!taken_up->empty()) ROS_WARN_STREAM(*taken_up);
  const auto log = session->startLog(*world);
  if (!log.ok()) return Error{log.error().code, "parameter ~command_log: " + log.error().detail};
  if (!log->empty()) ROS_INFO_STREAM("commands are logged to " << *log);
  training_folders.log = *log;
  if (task) world->noteTask({true, task_file, settings->trainee, {}});

  auto parts = std::make_unique<Parts>(
      private_handle, *settings, std::move(world), BodyLoader(access, scene_folder, std::move(scene->materials)),
      std::move(session), std::move(rejections), std::move(clock_publisher), std::move(followed));
  parts->training = std::make_unique<LiveTraining>(private_handle, parts->runner, std::move(training_folders),
                                                   settings->world_frame, *parts->rejections, parts->inputs.tools());
  if (task) parts->training->begin(std::move(*task), settings->trainee);
  parts->runner.setEventSink([publishers = &parts->publishers, training = parts->training.get(),
                              kept = parts->session.get()](std::vector<Event> events) {
    training->heard(events);
    kept->heard(events);
    publishers->queueEvents(std::move(events));
  });
  parts->runner.setStepSink([forces = &parts->forces, kept = parts->session.get(), training = parts->training.get(),
                             clock = parts->clock_publisher.get()](World& world_now, double dt) {
    if (clock != nullptr && dt > 0.0) clock->advance(dt);
    training->changed(world_now, dt);
    forces->changed(world_now, dt);
    kept->changed(world_now, dt);
  });
  parts->session->start(parts->runner);
  parts->runner.start();
  parts->publishers.start();
  parts->forces.start();
  parts->training->start();
  // Last, so that who finds them finds a world that runs.
  parts->services =
      std::make_unique<Services>(private_handle, parts->runner, parts->frames, parts->loader, *parts->rejections,
                                 *parts->session, parts->inputs.tools(), *parts->training);
  ROS_INFO_STREAM("scene " << *file << ": " << bodies << " bodies, " << particles << " particles, " << clusters
                           << " clusters, " << scene->world.step_rate << " steps/s of " << scene->world.substeps
                           << " substeps" << (settings->paused ? ", paused" : ""));
  return std::unique_ptr<DeformerNode>(new DeformerNode(std::move(parts)));
}

}  // namespace meshless
