// What takes long: cuts, incisions, steps, new bodies. Written once, for the services and the actions, whose goals and
// results have the fields of the services' requests and answers.
#pragma once

#include <algorithm>

#include <shape_msgs/SolidPrimitive.h>

#include "answers.h"
#include "body_loader.h"
#include "convert.h"
#include "frames.h"
#include "live_training.h"
#include "runner.h"

namespace meshless {

constexpr double kMaxCloseTime = 60.0;  // [s]
constexpr double kMaxScale = 1e6;
constexpr std::uint32_t kMaxSteps = 100000;
constexpr int kMostSuffix = 10000;  // <name>_N tried for a body without a name of its own

inline std::string clustersOf(const CutWork& work) {
  return std::to_string(work.rebuilt_clusters) + " clusters rebuilt, " + std::to_string(work.kept_clusters) + " kept";
}

inline MeshRepair repairOf(const std::string& name, BorderCheck& check) {
  const std::vector<std::string>& names = meshRepairNames();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found != names.end()) return static_cast<MeshRepair>(found - names.begin());
  if (!name.empty()) check.fault("repair is '" + printable(name) + "'; accepted: " + joined(names));
  return MeshRepair::kMend;
}

inline CavityFill fillOf(const std::string& yaml, BorderCheck& check) {
  constexpr std::size_t kMost = 1024;
  if (yaml.size() > kMost) {
    check.fault("cavities has " + std::to_string(yaml.size()) + " bytes; accepted: up to " + std::to_string(kMost));
    return {};
  }
  const Result<CavityFill> fill = readCavityFill(yaml);
  if (!fill) check.fault(fill.error().detail);
  return fill ? *fill : CavityFill();
}

/// [m] of one.
inline double unitOf(const std::string& name, BorderCheck& check) {
  std::vector<std::string> names;
  for (const auto& [unit, metres] : kLengthUnits) {
    if (name.empty() || name == unit) return metres;
    names.push_back(unit);
  }
  check.fault("units is '" + printable(name) + "'; accepted: " + joined(names));
  return 1.0;
}

template <class Response, class = void>
struct HasStepsDone : std::false_type {};  // the service's answer
template <class Response>
struct HasStepsDone<Response, std::void_t<decltype(Response::steps_done)>> : std::true_type {};

/// `caller` is the service or action as the diagnostics name it. Actions come with a `progress`.
struct LongWork : Answers {
  LongWork(WorldRunner& runner_in, Frames& frames_in, const BodyLoader& loader_in, Rejections& rejections_in,
           const LiveTraining& training_in)
      : Answers{rejections_in}, runner(runner_in), frames(frames_in), loader(loader_in), training(training_in) {}

  using Answers::refuse;
  /// What ended because it was cancelled is no rejection.
  template <class Response>
  bool refuse(Response& response, const std::string& caller, const Error& error, const Progress* progress) const {
    return progress != nullptr && progress->ended() ? fillRefused(response, error) : refuse(response, caller, error);
  }

  template <class Request, class Response>
  bool cut(const Request& request, Response& response, const std::string& caller, Progress* progress = nullptr) const {
    BorderCheck check;
    CutCommand command;
    const Pose local = check.pose("blades.pose", request.blades.pose);
    const double length = check.number("length", request.length, 0.0, kMaxLength, "m");
    const double width = check.number("width", request.width, 0.0, kMaxLength, "m");
    command.close_time = check.number("close_time", request.close_time, 0.0, kMaxCloseTime, "s");
    command.roughness = check.number("roughness", request.roughness, 0.0, kMaxLength, "m");
    command.bodies = check.names("bodies", request.bodies);
    if (!check.ok()) return refuse(response, caller, check.error());
    const auto frame = frames.toWorld(request.blades.header);
    if (!frame.ok()) return refuse(response, caller, frame.error());
    Pose pose;
    pose.rotation = frame->rotation * local.rotation;
    pose.translation = check.place("blades.pose.position", *frame, local.translation);
    if (!check.ok()) return refuse(response, caller, check.error());
    command.blades = bladesAt(pose, length, width);
    const auto answer = runner.cut(std::move(command), progress);
    if (!answer.ok()) return refuse(response, caller, answer.error(), progress);
    response.cut_bodies = answer->reply.cut_bodies;
    response.new_bodies = answer->reply.new_bodies;
    response.cap_area = answer->reply.cap_area;
    response.duration = answer->reply.duration;
    response.kept_clusters = static_cast<std::uint32_t>(answer->reply.work.kept_clusters);
    response.rebuilt_clusters = static_cast<std::uint32_t>(answer->reply.work.rebuilt_clusters);
    std::string message = "no body was cut";
    if (!answer->reply.cut_bodies.empty())
      message = "cut " + joined(answer->reply.cut_bodies) + " into " + std::to_string(answer->reply.new_bodies.size()) +
                " pieces; " + clustersOf(answer->reply.work);
    if (answer->closed_at_once) message += "; the world is paused, so the blades met at once (close_time was not used)";
    for (const std::string& note : answer->reply.notes) message += "; " + note;
    return accept(response, message);
  }

  template <class Request, class Response>
  bool incise(const Request& request, Response& response, const std::string& caller,
              Progress* progress = nullptr) const {
    BorderCheck check;
    InciseCommand command;
    const Pose local = check.pose("blade.pose", request.blade.pose);
    command.blade.length = check.number("length", request.length, 1e-6, kMaxLength, "m");
    command.blade.depth = check.number("depth", request.depth, 1e-6, kMaxLength, "m");
    command.bodies = check.names("bodies", request.bodies);
    if (!check.ok()) return refuse(response, caller, check.error());
    const auto frame = frames.toWorld(request.blade.header);
    if (!frame.ok()) return refuse(response, caller, frame.error());
    const Mat3 axes = (frame->rotation * local.rotation).toRotationMatrix();
    command.blade.origin = check.place("blade.pose.position", *frame, local.translation);
    if (!check.ok()) return refuse(response, caller, check.error());
    command.blade.x_axis = axes.col(0);
    command.blade.y_axis = axes.col(1);
    const auto answer = runner.apply(command, progress);
    if (!answer.ok()) return refuse(response, caller, answer.error(), progress);
    const auto& reply = std::get<InciseReply>(*answer);
    response.cut_bodies = reply.cut_bodies;
    response.new_bodies = reply.new_bodies;
    response.opened_area = reply.opened_area;
    response.duration = reply.duration;
    response.kept_clusters = static_cast<std::uint32_t>(reply.work.kept_clusters);
    response.rebuilt_clusters = static_cast<std::uint32_t>(reply.work.rebuilt_clusters);
    std::string message = "opened " + joined(reply.cut_bodies);
    if (!reply.new_bodies.empty()) message += ", which came apart into " + joined(reply.new_bodies);
    message += "; " + clustersOf(reply.work);
    for (const std::string& note : reply.notes) message += "; " + note;
    return accept(response, message);
  }

  template <class Request, class Response>
  bool step(const Request& request, Response& response, const std::string& caller, Progress* progress = nullptr) const {
    if (request.steps < 1 || request.steps > kMaxSteps) {
      return refuse(response, caller,
                    {ErrorCode::kInvalidArgument,
                     "steps is " + std::to_string(request.steps) + "; accepted: 1.." + std::to_string(kMaxSteps)});
    }
    const auto time = runner.doSteps(request.steps, progress);
    if constexpr (HasStepsDone<Response>::value) {
      response.steps_done = static_cast<std::uint32_t>(progress->stepsDone());
      response.sim_time = progress->simTime();
    }
    if (!time.ok()) return refuse(response, caller, time.error(), progress);
    response.sim_time = *time;
    return accept(response, "did " + std::to_string(request.steps) + " steps");
  }

  template <class Request, class Response>
  bool spawn(const Request& request, Response& response, const std::string& caller,
             Progress* progress = nullptr) const {
    if (const auto no = training.refuses(Intervention::kSpawn)) return refuse(response, caller, *no);
    BorderCheck check;
    SpawnRequest wanted;
    wanted.name = check.newName("name", request.name);
    wanted.file = request.file;
    const Pose local = check.pose("pose.pose", request.pose.pose);
    wanted.scale = check.number("scale", request.scale, 0.0, kMaxScale, "");
    if (wanted.scale == 0.0) wanted.scale = 1.0;
    wanted.scale *= unitOf(request.units, check);
    wanted.thickness = check.number("thickness", request.thickness, 0.0, kMaxLength, "m");
    wanted.material = request.material;
    wanted.repair = repairOf(request.repair, check);
    wanted.cavities = fillOf(request.cavities, check);
    if (wanted.file.empty()) {
      switch (request.primitive.type) {
        case shape_msgs::SolidPrimitive::BOX:
          wanted.primitive = "box";
          break;
        case shape_msgs::SolidPrimitive::SPHERE:
          wanted.primitive = "sphere";
          break;
        case shape_msgs::SolidPrimitive::CYLINDER:
          wanted.primitive = "cylinder";
          break;
        default:
          check.fault("primitive.type is " + std::to_string(request.primitive.type) +
                      "; accepted: 1 (BOX), 2 (SPHERE), 3 (CYLINDER), or a file");
      }
      wanted.sizes.assign(request.primitive.dimensions.begin(), request.primitive.dimensions.end());
    }
    if (!check.ok()) return refuse(response, caller, check.error());
    const auto frame = frames.toWorld(request.pose.header);
    if (!frame.ok()) return refuse(response, caller, frame.error());
    wanted.pose.rotation = frame->rotation * local.rotation;
    wanted.pose.translation = check.place("pose.pose.position", *frame, local.translation);
    if (!check.ok()) return refuse(response, caller, check.error());
    auto body = loader.load(wanted, progress);
    if (!body.ok()) return refuse(response, caller, body.error(), progress);
    return add(response, caller, *body, request.name.empty(), progress);
  }

  /// `numbered`: <name>_2, <name>_3 ... where the name is taken.
  template <class Response>
  bool add(Response& response, const std::string& caller, const std::shared_ptr<const PreparedBody>& body,
           bool numbered, Progress* progress = nullptr) const {
    // A task may have begun while it was prepared.
    if (const auto no = training.refuses(Intervention::kSpawn)) return refuse(response, caller, *no);
    SpawnCommand command;
    command.body = body;
    auto reply = runner.apply(command, progress);
    for (int i = 2; numbered && !reply.ok() && reply.error().code == ErrorCode::kDuplicateName && i <= kMostSuffix;
         ++i) {
      // Looked for in one go: in a crowd each turn with the world may take long to come.
      const auto name = [&] { return body->def.name + "_" + std::to_string(i); };
      const Status done = runner.look([&](World& world) {
        while (i < kMostSuffix && world.nameUsed(name())) ++i;
      });
      if (!done.ok()) return refuse(response, caller, done.error());
      command.body = renamed(*body, name());
      reply = runner.apply(command, progress);
    }
    if (!reply.ok()) return refuse(response, caller, reply.error(), progress);
    const auto& spawned = std::get<SpawnReply>(*reply);
    response.name = spawned.name;
    response.particles = static_cast<std::uint32_t>(spawned.particles);
    response.triangles = static_cast<std::uint32_t>(spawned.triangles);
    response.clusters = static_cast<std::uint32_t>(spawned.clusters);
    // A node that ends just now has added it all the same.
    (void)runner.look(
        [&](World& world) { response.info = toInfo(spawned.name, *command.body->model, world.settings()); });
    std::string message = "added " + spawned.name;
    for (const std::string& note : command.body->def.notes) message += "; " + note;
    for (const std::string& warning : command.body->def.warnings) {
      message += "; " + warning;
      ROS_WARN_STREAM("body " << spawned.name << ": " << warning);
    }
    return accept(response, message);
  }

  WorldRunner& runner;
  Frames& frames;
  const BodyLoader& loader;
  const LiveTraining& training;
};

}  // namespace meshless
