#include "services.h"

#include <chrono>
#include <sstream>

#include <meshless_surgery/ApplyForce.h>
#include <meshless_surgery/Attach.h>
#include <meshless_surgery/AttachInstrument.h>
#include <meshless_surgery/Clip.h>
#include <meshless_surgery/Cut.h>
#include <meshless_surgery/Detach.h>
#include <meshless_surgery/DetachInstrument.h>
#include <meshless_surgery/GetBody.h>
#include <meshless_surgery/GetLoad.h>
#include <meshless_surgery/Incise.h>
#include <meshless_surgery/LoadState.h>
#include <meshless_surgery/Lock.h>
#include <meshless_surgery/MoveClamp.h>
#include <meshless_surgery/MovePick.h>
#include <meshless_surgery/Pick.h>
#include <meshless_surgery/Probe.h>
#include <meshless_surgery/Push.h>
#include <meshless_surgery/Release.h>
#include <meshless_surgery/Remove.h>
#include <meshless_surgery/ResetBodies.h>
#include <meshless_surgery/SaveState.h>
#include <meshless_surgery/SetGravity.h>
#include <meshless_surgery/SetMaterial.h>
#include <meshless_surgery/SetPose.h>
#include <meshless_surgery/Spawn.h>
#include <meshless_surgery/SpawnCloud.h>
#include <meshless_surgery/Step.h>
#include <meshless_surgery/Unclip.h>
#include <ros/names.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include "actions.h"
#include "long_work.h"

namespace meshless {
namespace {

constexpr double kLongestMove = 3600.0;  // [s]
static_assert(kLongestMove == kMaxClampTime);
constexpr double kLongestPush = 3600.0;  // [s]
static_assert(kLongestPush == kLongestForce);
constexpr std::size_t kMaxLoadPoints = 10000;
constexpr double kMaxSpeed = 1e3;                           // [m/s]
constexpr double kMaxStiffness = 1e9;                       // [N/m]
constexpr double kMaxPerArea = 1e15;                        // [N/m^3], [Pa]
constexpr double kMaxCloudTimeout = 60.0;                   // [s]
constexpr double kCloudTimeout = 5.0;                       // [s]
constexpr double kCloudPoll = 0.05;                         // [s]
constexpr double kMaxOutliers = 100.0;                      // standard deviations
constexpr std::size_t kMaxYaml = 64 * 1024;                 // bytes
constexpr int kCutThreads = WorldRunner::kMostClosing + 1;  // one is always there for a cut that need not wait
constexpr int kSpawnThreads = 2;                            // a large body must not hold up a small one

}  // namespace

struct Services::Handlers : Answers {
  Handlers(const ros::NodeHandle& private_handle, WorldRunner& runner_in, Frames& frames_in,
           const BodyLoader& loader_in, Rejections& rejections_in, Session& session_in, const StreamedTools& tools_in,
           const LiveTraining& training_in)
      : Answers{rejections_in},
        runner(runner_in),
        frames(frames_in),
        session(session_in),
        tools(tools_in),
        training(training_in),
        work(runner_in, frames_in, loader_in, rejections_in, training_in),
        actions(private_handle, work, {cut_queue, step_queue, spawn_queue}) {
    advertise(private_handle, "pick", &Handlers::pick);
    advertise(private_handle, "move_pick", &Handlers::movePick);
    advertise(private_handle, "lock", &Handlers::lock);
    advertise(private_handle, "release", &Handlers::release);
    advertise(private_handle, "clear_picks", &Handlers::clearPicks);
    advertise(private_handle, "open_scissors", &Handlers::openScissors);
    advertise(private_handle, "lift_scissors", &Handlers::liftScissors);
    advertise(private_handle, "undo_cut", &Handlers::undoCut);
    advertise(private_handle, "probe", &Handlers::probe);
    advertise(private_handle, "push", &Handlers::push);
    advertise(private_handle, "incise", &Handlers::incise);
    advertise(private_handle, "remove", &Handlers::remove);
    advertise(private_handle, "attach", &Handlers::attach);
    advertise(private_handle, "detach", &Handlers::detach);
    advertise(private_handle, "clip", &Handlers::clip);
    advertise(private_handle, "unclip", &Handlers::unclip);
    advertise(private_handle, "move_clamp", &Handlers::moveClamp);
    advertise(private_handle, "apply_force", &Handlers::applyForce);
    advertise(private_handle, "set_gravity", &Handlers::setGravity);
    advertise(private_handle, "set_pose", &Handlers::setPose);
    advertise(private_handle, "reset_bodies", &Handlers::resetBodies);
    advertise(private_handle, "attach_instrument", &Handlers::attachInstrument);
    advertise(private_handle, "detach_instrument", &Handlers::detachInstrument);
    advertise(private_handle, "set_material", &Handlers::setMaterial);
    advertise(private_handle, "get_body", &Handlers::getBody);
    advertise(private_handle, "get_load", &Handlers::getLoad);
    advertise(private_handle, "pause", &Handlers::pause);
    advertise(private_handle, "reset", &Handlers::reset);
    advertise(private_handle, "hash", &Handlers::hash);
    advertiseApart(private_handle, cut_queue, "cut", &Handlers::cut);
    advertiseApart(private_handle, step_queue, "step", &Handlers::step);
    advertiseApart(private_handle, spawn_queue, "spawn", &Handlers::spawn);
    advertiseApart(private_handle, cloud_queue, "spawn_cloud", &Handlers::spawnCloud);
    advertiseApart(private_handle, session_queue, "save", &Handlers::save);
    advertiseApart(private_handle, session_queue, "load", &Handlers::load);
    cut_spinner.start();
    session_spinner.start();
    step_spinner.start();
    cloud_spinner.start();
    spawn_spinner.start();
  }

  ~Handlers() { actions.end(); }

  template <class Request, class Response>
  void advertise(ros::NodeHandle handle, const std::string& name, bool (Handlers::*handler)(Request&, Response&)) {
    servers.push_back(handle.advertiseService(name, handler, this));
  }
  template <class Request, class Response>
  void advertiseApart(ros::NodeHandle handle, ros::CallbackQueue& queue, const std::string& name,
                      bool (Handlers::*handler)(Request&, Response&)) {
    handle.setCallbackQueue(&queue);
    servers.push_back(handle.advertiseService(name, handler, this));
  }

  /// For commands whose answer is that they are done.
  template <class Response>
  bool applied(Response& response, const std::string& service, const Command& command, const std::string& message) {
    const auto reply = runner.apply(command);
    return reply.ok() ? accept(response, message) : refuse(response, service, reply.error());
  }

  bool pick(meshless_surgery::Pick::Request& request, meshless_surgery::Pick::Response& response) {
    BorderCheck check;
    PickCommand command;
    const Vec3 point = check.point("point", request.point);
    const Vec3 direction = check.direction("direction", request.direction);
    command.max_distance = check.number("max_distance", request.max_distance, 0.0, kMaxLength, "m");
    command.stiffness = check.number("stiffness", request.stiffness, 0.0, kMaxStiffness, "N/m");
    if (!check.ok()) return refuse(response, "pick", check.error());
    const auto frame = frames.toWorld(request.header);
    if (!frame.ok()) return refuse(response, "pick", frame.error());
    command.point = check.place("point", *frame, point);
    if (!check.ok()) return refuse(response, "pick", check.error());
    command.direction = frame->rotation * direction;
    command.body = request.body;
    const auto reply = runner.apply(command);
    if (!reply.ok()) return refuse(response, "pick", reply.error());
    const auto& picked = std::get<PickReply>(*reply);
    response.pick_id = picked.pick;
    response.body = picked.body;
    response.particle = picked.particle;
    response.position = toPoint(picked.position);
    return accept(response, "grabbed " + picked.body + " at particle " + std::to_string(picked.particle));
  }

  bool movePick(meshless_surgery::MovePick::Request& request, meshless_surgery::MovePick::Response& response) {
    BorderCheck check;
    const Vec3 target = check.point("target", request.target);
    if (!check.ok()) return refuse(response, "move_pick", check.error());
    const auto frame = frames.toWorld(request.header);
    if (!frame.ok()) return refuse(response, "move_pick", frame.error());
    MovePickCommand command;
    command.pick = request.pick_id;
    command.target = check.place("target", *frame, target);
    if (!check.ok()) return refuse(response, "move_pick", check.error());
    return applied(response, "move_pick", command, "moved pick " + std::to_string(request.pick_id));
  }

  bool lock(meshless_surgery::Lock::Request& request, meshless_surgery::Lock::Response& response) {
    BorderCheck check;
    const Vec3 target = check.point("target", request.target);
    if (!check.ok()) return refuse(response, "lock", check.error());
    LockCommand command;
    command.pick = request.pick_id;
    if (request.at_target) {
      const auto frame = frames.toWorld(request.header);
      if (!frame.ok()) return refuse(response, "lock", frame.error());
      command.target = check.place("target", *frame, target);
      if (!check.ok()) return refuse(response, "lock", check.error());
    }
    return applied(response, "lock", command, "locked pick " + std::to_string(request.pick_id));
  }

  bool release(meshless_surgery::Release::Request& request, meshless_surgery::Release::Response& response) {
    ReleaseCommand command;
    command.pick = request.pick_id;
    return applied(response, "release", command, "released pick " + std::to_string(request.pick_id));
  }

  bool clearPicks(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    std::size_t picks = 0;
    (void)runner.look([&](World& world) { picks = world.snapshot({}).picks.size(); });
    return applied(response, "clear_picks", ClearPicksCommand{},
                   picks == 0 ? "there was no pick to release" : "released all picks: " + std::to_string(picks));
  }

  bool push(meshless_surgery::Push::Request& request, meshless_surgery::Push::Response& response) {
    BorderCheck check;
    PushCommand command;
    command.enable = request.enable;
    command.radius = check.number("radius", request.radius, 0.0, kMaxLength, "m");
    command.speed = check.number("speed", request.speed, 0.0, kMaxSpeed, "m/s");
    const Pose pose = check.pose("pose.pose", request.pose.pose);
    if (!check.ok()) return refuse(response, "push", check.error());
    if (request.enable) {
      const auto frame = frames.toWorld(request.pose.header);
      if (!frame.ok()) return refuse(response, "push", frame.error());
      command.position = check.place("pose.pose.position", *frame, pose.translation);
      if (!check.ok()) return refuse(response, "push", check.error());
    }
    bool there = false;
    (void)runner.look([&](World& world) { there = world.push().enabled; });
    if (!command.enable)
      return applied(response, "push", command,
                     there ? "removed the push sphere" : "there was no push sphere to remove");
    std::string done = "placed the push sphere";
    if (command.speed > 0.0)
      done = there ? "the push sphere goes there at " + numberText(command.speed, 3) + " m/s"
                   : "placed the push sphere there: there was none that could go at a speed";
    return applied(response, "push", command, done);
  }

  bool cut(meshless_surgery::Cut::Request& request, meshless_surgery::Cut::Response& response) {
    return work.cut(request, response, "cut");
  }

  bool incise(meshless_surgery::Incise::Request& request, meshless_surgery::Incise::Response& response) {
    return work.incise(request, response, "incise");
  }

  bool openScissors(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    return applied(response, "open_scissors", OpenScissorsCommand{}, "opened the scissors; nothing was cut");
  }

  bool liftScissors(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    bool there = false;
    (void)runner.look([&](World& world) { there = world.scissors().shown; });
    return applied(response, "lift_scissors", LiftCommand{},
                   there ? "took the scissors away" : "there were no scissors to take away");
  }

  bool undoCut(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    if (const auto no = training.refuses(Intervention::kUndo)) return refuse(response, "undo_cut", *no);
    const auto reply = runner.apply(UndoCutCommand{});
    if (!reply.ok()) return refuse(response, "undo_cut", reply.error());
    return accept(response, "as before the cut: " + joined(std::get<UndoCutReply>(*reply).bodies));
  }

  bool probe(meshless_surgery::Probe::Request& request, meshless_surgery::Probe::Response& response) {
    BorderCheck check;
    const Vec3 point = check.point("point", request.point);
    const Vec3 direction = check.direction("direction", request.direction);
    if (!check.ok()) return refuse(response, "probe", check.error());
    const auto frame = frames.toWorld(request.header);
    if (!frame.ok()) return refuse(response, "probe", frame.error());
    const Vec3 place = check.place("point", *frame, point);
    if (!check.ok()) return refuse(response, "probe", check.error());
    Result<ProbeReply> met = Error{};
    const Status done = runner.look([&](World& world) { met = world.probe(place, frame->rotation * direction); });
    if (!done.ok()) return refuse(response, "probe", done.error());
    if (!met.ok()) return refuse(response, "probe", met.error());
    response.body = met->body;
    response.position = toPoint(met->position);
    response.normal = toVector(met->normal);
    return accept(response, "met " + met->body);
  }

  bool spawn(meshless_surgery::Spawn::Request& request, meshless_surgery::Spawn::Response& response) {
    return work.spawn(request, response, "spawn");
  }

  bool spawnCloud(meshless_surgery::SpawnCloud::Request& request, meshless_surgery::SpawnCloud::Response& response) {
    if (const auto no = training.refuses(Intervention::kSpawn)) return refuse(response, "spawn_cloud", *no);
    BorderCheck check;
    CloudRequest wanted;
    if (const std::string name = check.newName("name", request.name); !name.empty()) wanted.name = name;
    const double timeout = check.number("timeout", request.timeout, 0.0, kMaxCloudTimeout, "s");
    const double scale = check.number("scale", request.scale, 0.0, kMaxScale, "");
    wanted.filter.voxel = check.number("voxel", request.voxel, 0.0, kMaxLength, "m");
    const double outliers = check.number("outliers", request.outliers, 0.0, kMaxOutliers, "");
    if (outliers > 0.0) wanted.filter.outliers = outliers;
    wanted.material = request.material;
    const bool given = !request.cloud.data.empty();
    if (given == !request.topic.empty())
      check.fault(given ? "cloud and topic are given; accepted: one of them"
                        : "cloud has no points and topic is empty; accepted: one of them");
    std::string why;
    if (!ros::names::validate(request.topic, why))
      check.fault("topic is '" + printable(request.topic) + "'; accepted: a topic's name");
    if (!check.ok()) return refuse(response, "spawn_cloud", check.error());
    sensor_msgs::PointCloud2ConstPtr heard;
    if (!given) {
      heard = nextCloud(request.topic, timeout > 0.0 ? timeout : kCloudTimeout);
      if (!heard) {
        return refuse(response, "spawn_cloud",
                      {ErrorCode::kMissed, "no sensor_msgs/PointCloud2 came on '" + printable(request.topic) +
                                               "' within " + numberText(timeout > 0.0 ? timeout : kCloudTimeout) +
                                               " s; accepted: a topic that is published"});
      }
    }
    const sensor_msgs::PointCloud2& cloud = heard ? *heard : request.cloud;
    auto points = toPoints(cloud);
    if (!points.ok()) return refuse(response, "spawn_cloud", points.error());
    const auto frame = frames.toWorld(cloud.header);
    if (!frame.ok()) return refuse(response, "spawn_cloud", frame.error());
    // Lengths of the cloud are scaled, those of tf are metres.
    for (Vec3& p : *points) p = *frame * Vec3((scale > 0.0 ? scale : 1.0) * p);
    wanted.points = std::move(*points);
    std::size_t left = 0;
    auto body = work.loader.load(wanted, left);
    if (!body.ok()) return refuse(response, "spawn_cloud", body.error());
    response.points = static_cast<std::uint32_t>(left);
    return work.add(response, "spawn_cloud", *body, request.name.empty());
  }

  /// By the wall, as a simulated clock may stand still; null where none comes, or the node ends.
  sensor_msgs::PointCloud2ConstPtr nextCloud(const std::string& topic, double timeout) {
    sensor_msgs::PointCloud2ConstPtr heard;
    ros::CallbackQueue queue;
    ros::NodeHandle handle;
    handle.setCallbackQueue(&queue);
    const ros::Subscriber subscriber = handle.subscribe<sensor_msgs::PointCloud2>(
        topic, 1, [&heard](const sensor_msgs::PointCloud2ConstPtr& cloud) { heard = cloud; });
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout);
    while (!heard && std::chrono::steady_clock::now() < end && runner.look([](World&) {}).ok())
      queue.callAvailable(ros::WallDuration(kCloudPoll));
    return heard;
  }

  bool remove(meshless_surgery::Remove::Request& request, meshless_surgery::Remove::Response& response) {
    if (const auto no = training.refuses(Intervention::kRemove)) return refuse(response, "remove", *no);
    RemoveCommand command;
    command.body = request.name;
    return applied(response, "remove", command, "removed " + request.name);
  }

  /// The sphere of centre and radius; none where the radius is 0.
  template <class Request>
  Result<std::optional<Region>> regionOf(const Request& request, BorderCheck& check) const {
    const Vec3 centre = check.point("centre", request.centre);
    const double radius = check.number("radius", request.radius, 0.0, kMaxLength, "m");
    if (!check.ok()) return check.error();
    if (radius == 0.0) return std::optional<Region>();
    const auto frame = frames.toWorld(request.header);
    if (!frame.ok()) return frame.error();
    const Vec3 place = check.place("centre", *frame, centre);
    if (!check.ok()) return check.error();
    return std::optional<Region>(Region::sphere(place, radius));
  }

  bool attach(meshless_surgery::Attach::Request& request, meshless_surgery::Attach::Response& response) {
    if (const auto no = training.refuses(Intervention::kAttach)) return refuse(response, "attach", *no);
    BorderCheck check;
    AttachCommand command;
    command.name = check.newName("name", request.name);
    command.body = check.names("body", {request.body}).front();
    command.other = check.names("other", {request.other}).front();
    command.distance = check.number("distance", request.distance, 0.0, kMaxLength, "m");
    command.stiffness = check.number("stiffness", request.stiffness, 0.0, kMaxPerArea, "N/m^3");
    const double strength = check.number("strength", request.strength, 0.0, kMaxPerArea, "Pa");
    if (strength > 0.0) command.strength = strength;
    const auto region = regionOf(request, check);
    if (!region.ok()) return refuse(response, "attach", region.error());
    command.region = *region;
    const auto reply = runner.apply(command);
    if (!reply.ok()) return refuse(response, "attach", reply.error());
    const auto& attached = std::get<AttachReply>(*reply);
    response.name = attached.name;
    response.fibres = static_cast<std::uint32_t>(attached.fibres);
    response.area = attached.area;
    return accept(response, "attached " + command.body + " to " + command.other + " by '" + attached.name +
                                "': " + attached.text());
  }

  bool isClip(const std::string& name) const {
    bool clip = false;
    (void)runner.look([&](World& world) {
      for (const AttachmentSnapshot& joint : world.snapshot({}).attachments)
        clip = clip || (joint.name == name && joint.jaws);
    });
    return clip;
  }

  bool detach(meshless_surgery::Detach::Request& request, meshless_surgery::Detach::Response& response) {
    BorderCheck check;
    DetachCommand command;
    command.name = request.name;
    const auto region = regionOf(request, check);
    if (!region.ok()) return refuse(response, "detach", region.error());
    command.region = *region;
    if (!isClip(command.name))
      if (const auto no = training.refuses(Intervention::kDetach)) return refuse(response, "detach", *no);
    const auto reply = runner.apply(command);
    if (!reply.ok()) return refuse(response, "detach", reply.error());
    const auto& detached = std::get<DetachReply>(*reply);
    response.gone = static_cast<std::uint32_t>(detached.gone);
    response.left = static_cast<std::uint32_t>(detached.left);
    return accept(response, "detached " + std::to_string(detached.gone) + " fibres of '" + command.name + "'; " +
                                std::to_string(detached.left) + " are left");
  }

  bool clip(meshless_surgery::Clip::Request& request, meshless_surgery::Clip::Response& response) {
    BorderCheck check;
    ClipCommand command;
    command.name = check.newName("name", request.name);
    if (!request.body.empty()) command.body = check.names("body", {request.body}).front();
    const Vec3 point = check.point("point", request.point);
    const Vec3 direction = check.direction("direction", request.direction);
    const double width = check.number("width", request.width, 0.0, kMaxLength, "m");
    const double opening = check.number("opening", request.opening, 0.0, kMaxLength, "m");
    if (width > 0.0) command.width = width;
    if (opening > 0.0) command.opening = opening;
    if (!check.ok()) return refuse(response, "clip", check.error());
    const auto frame = frames.toWorld(request.header);
    if (!frame.ok()) return refuse(response, "clip", frame.error());
    command.point = check.place("point", *frame, point);
    if (!check.ok()) return refuse(response, "clip", check.error());
    command.direction = frame->rotation * direction;
    const auto reply = runner.apply(command);
    if (!reply.ok()) return refuse(response, "clip", reply.error());
    const auto& clipped = std::get<ClipReply>(*reply);
    response.name = clipped.name;
    response.body = clipped.body;
    response.fibres = static_cast<std::uint32_t>(clipped.fibres);
    response.lumen = clipped.lumen;
    std::ostringstream lumen;
    lumen << 1e3 * clipped.lumen;
    return accept(response, "clip '" + clipped.name + "' closes a lumen of " + clipped.body + " that is " +
                                lumen.str() + " mm wide");
  }

  bool unclip(meshless_surgery::Unclip::Request& request, meshless_surgery::Unclip::Response& response) {
    DetachCommand command;
    command.name = request.name;
    if (!isClip(command.name))
      if (const auto no = training.refuses(Intervention::kDetach)) return refuse(response, "unclip", *no);
    return applied(response, "unclip", command, "took clip '" + request.name + "' off");
  }

  bool moveClamp(meshless_surgery::MoveClamp::Request& request, meshless_surgery::MoveClamp::Response& response) {
    if (const auto no = training.refuses(Intervention::kMoveClamp)) return refuse(response, "move_clamp", *no);
    BorderCheck check;
    MoveClampCommand command;
    command.body = request.name;
    command.clamp = request.clamp;
    const Vec3 shift = check.direction("shift", request.shift);
    const Quat turn = check.rotation("turn", request.turn);
    command.time = check.number("time", request.time, 0.0, kLongestMove, "s");
    if (!check.ok()) return refuse(response, "move_clamp", check.error());
    const auto frame = frames.toWorld(request.header);
    if (!frame.ok()) return refuse(response, "move_clamp", frame.error());
    command.shift = frame->rotation * shift;
    command.turn = (frame->rotation * turn * frame->rotation.conjugate()).normalized();
    const auto reply = runner.apply(command);
    if (!reply.ok()) return refuse(response, "move_clamp", reply.error());
    response.middle = toPoint(std::get<MoveClampReply>(*reply).middle);
    return accept(response, "moves what entry " + std::to_string(command.clamp) + " of `fixed` holds of " + command.body);
  }

  bool applyForce(meshless_surgery::ApplyForce::Request& request, meshless_surgery::ApplyForce::Response& response) {
    if (const auto no = training.refuses(Intervention::kForce)) return refuse(response, "apply_force", *no);
    BorderCheck check;
    ApplyForceCommand command;
    command.body = request.name;
    const Vec3 force = check.direction("force", request.force);
    command.time = check.number("time", request.time, 0.0, kLongestPush, "s");
    const auto region = regionOf(request, check);
    if (!region.ok()) return refuse(response, "apply_force", region.error());
    command.region = *region;
    const auto frame = frames.toWorld(request.header);
    if (!frame.ok()) return refuse(response, "apply_force", frame.error());
    command.force = frame->rotation * force;
    const auto reply = runner.apply(command);
    if (!reply.ok()) return refuse(response, "apply_force", reply.error());
    const auto& applied = std::get<ApplyForceReply>(*reply);
    response.area = applied.area;
    response.middle = toPoint(applied.middle);
    if (command.force.isZero(0.0)) return accept(response, "no force acts on " + command.body + " any more");
    return accept(response, numberText(command.force.norm(), 3) + " N act on " + numberText(1e4 * applied.area, 3) +
                                " cm^2 of " + command.body + " for " + numberText(command.time, 4) + " s");
  }

  bool setGravity(meshless_surgery::SetGravity::Request& request, meshless_surgery::SetGravity::Response& response) {
    if (const auto no = training.refuses(Intervention::kGravity)) return refuse(response, "set_gravity", *no);
    BorderCheck check;
    const Vec3 gravity = check.direction("gravity", request.gravity);
    if (!check.ok()) return refuse(response, "set_gravity", check.error());
    const auto frame = frames.toWorld(request.header);
    if (!frame.ok()) return refuse(response, "set_gravity", frame.error());
    return applied(response, "set_gravity", SetGravityCommand{frame->rotation * gravity}, "gravity is changed");
  }

  bool setPose(meshless_surgery::SetPose::Request& request, meshless_surgery::SetPose::Response& response) {
    if (const auto no = training.refuses(Intervention::kPlace)) return refuse(response, "set_pose", *no);
    BorderCheck check;
    PlaceBodyCommand command;
    command.body = request.name;
    const Pose local = check.pose("pose.pose", request.pose.pose);
    if (!check.ok()) return refuse(response, "set_pose", check.error());
    const auto frame = frames.toWorld(request.pose.header);
    if (!frame.ok()) return refuse(response, "set_pose", frame.error());
    command.pose.rotation = (frame->rotation * local.rotation).normalized();
    command.pose.translation = check.place("pose.pose.position", *frame, local.translation);
    if (!check.ok()) return refuse(response, "set_pose", check.error());
    return applied(response, "set_pose", command, request.name + " is there, at rest");
  }

  bool resetBodies(meshless_surgery::ResetBodies::Request& request, meshless_surgery::ResetBodies::Response& response) {
    if (const auto no = training.refuses(Intervention::kResetBodies)) return refuse(response, "reset_bodies", *no);
    BorderCheck check;
    const std::vector<std::string> bodies = check.names("bodies", request.bodies);
    if (!check.ok()) return refuse(response, "reset_bodies", check.error());
    const auto reply = runner.apply(ResetBodiesCommand{bodies});
    if (!reply.ok()) return refuse(response, "reset_bodies", reply.error());
    const auto& [reset_bodies, notes] = std::get<ResetBodiesReply>(*reply);
    response.reset_bodies = reset_bodies;
    std::string message = "as the scene began: " + joined(reset_bodies);
    for (const std::string& note : notes) message += "; " + note;
    return accept(response, message);
  }

  bool attachInstrument(meshless_surgery::AttachInstrument::Request& request,
                        meshless_surgery::AttachInstrument::Response& response) {
    if (const auto no = training.refuses(Intervention::kInstrument)) return refuse(response, "attach_instrument", *no);
    BorderCheck check;
    if (request.yaml.empty() || request.yaml.size() > kMaxYaml)
      check.fault("yaml has " + std::to_string(request.yaml.size()) + " bytes; accepted: 1.." +
                  std::to_string(kMaxYaml) + ", such as {type: grasper}");
    const Pose local = check.pose("pose.pose", request.pose.pose);
    if (!check.ok()) return refuse(response, "attach_instrument", check.error());
    auto def = readInstrument(request.name, request.yaml);
    if (!def.ok()) return refuse(response, "attach_instrument", def.error());
    const auto frame = frames.toWorld(request.pose.header);
    if (!frame.ok()) return refuse(response, "attach_instrument", frame.error());
    def->pose.rotation = (frame->rotation * local.rotation).normalized();
    def->pose.translation = check.place("pose.pose.position", *frame, local.translation);
    if (!check.ok()) return refuse(response, "attach_instrument", check.error());
    return applied(response, "attach_instrument", AttachInstrumentCommand{*def},
                   "instrument " + request.name + " is in the hand");
  }

  bool detachInstrument(meshless_surgery::DetachInstrument::Request& request,
                        meshless_surgery::DetachInstrument::Response& response) {
    if (const auto no = training.refuses(Intervention::kInstrument)) return refuse(response, "detach_instrument", *no);
    return applied(response, "detach_instrument", DetachInstrumentCommand{request.name},
                   "instrument " + request.name + " was put away");
  }

  bool setMaterial(meshless_surgery::SetMaterial::Request& request, meshless_surgery::SetMaterial::Response& response) {
    if (const auto no = training.refuses(Intervention::kMaterial)) return refuse(response, "set_material", *no);
    BorderCheck check;
    if (request.yaml.empty() || request.yaml.size() > kMaxYaml) {
      check.fault("yaml has " + std::to_string(request.yaml.size()) + " bytes; accepted: 1.." +
                  std::to_string(kMaxYaml) + ", such as {alpha: 0.3}");
    }
    if (!check.ok()) return refuse(response, "set_material", check.error());
    SetMaterialCommand command;
    command.body = request.body;
    std::vector<std::string> warnings;
    command.change = work.loader.materialChange(request.yaml, warnings);
    std::string said = "changed the material of " + (request.body.empty() ? std::string("all bodies") : request.body);
    for (const std::string& warning : warnings) said += "; " + warning;
    return applied(response, "set_material", command, said);
  }

  bool getBody(meshless_surgery::GetBody::Request& request, meshless_surgery::GetBody::Response& response) {
    std_msgs::Header header;
    header.stamp = ros::Time::now();
    header.frame_id = frames.worldFrame();
    Result<BodySnapshot> body = Error{};
    const Status done = runner.look([&](World& world) { body = world.inspect(request.name, request.rest); });
    if (!done.ok()) return refuse(response, "get_body", done.error());
    if (!body.ok()) return refuse(response, "get_body", body.error());
    response.surface = toMesh(body->surface, body->model->surface.triangles);
    response.particles = toCloud(body->particles, header);
    response.volume = body->measures.volume;
    response.rest_volume = body->model->rest_volume;
    response.area = body->measures.area;
    response.mass = body->model->mass;
    response.clusters = body->model->groups();
    response.tetrahedra = static_cast<std::uint32_t>(body->tetrahedra);
    response.cavities = toCavities(body->measures);
    return accept(response, request.name + (request.rest ? " at rest" : " as it is now"));
  }

  bool getLoad(meshless_surgery::GetLoad::Request& request, meshless_surgery::GetLoad::Response& response) {
    BorderCheck check;
    if (request.points.size() > kMaxLoadPoints)
      check.fault("points has " + std::to_string(request.points.size()) + " places; accepted: up to " +
                  std::to_string(kMaxLoadPoints));
    Points points;
    for (std::size_t k = 0; k < request.points.size() && check.ok(); ++k)
      points.push_back(check.point("points[" + std::to_string(k) + "]", request.points[k]));
    if (!check.ok()) return refuse(response, "get_load", check.error());
    const auto frame = frames.toWorld(request.header);
    if (!frame.ok()) return refuse(response, "get_load", frame.error());
    for (std::size_t k = 0; k < points.size() && check.ok(); ++k)
      points[k] = check.place("points[" + std::to_string(k) + "]", *frame, points[k]);
    if (!check.ok()) return refuse(response, "get_load", check.error());
    Result<BodyLoad> load = Error{};
    const Status done = runner.look([&](World& world) { load = world.load(request.name, points); });
    if (!done.ok()) return refuse(response, "get_load", done.error());
    if (!load.ok()) return refuse(response, "get_load", load.error());
    response.elastic_energy = load->elastic_energy;
    for (const Wrench& clamp : load->clamps) {
      response.clamps.emplace_back();
      response.clamps.back().force = toVector(clamp.force);
      response.clamps.back().torque = toVector(clamp.torque);
    }
    for (const CellLoad& cell : load->cells) {
      response.places.push_back(toPoint(cell.place));
      for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) response.deformation.push_back(cell.gradient(row, column));
      const Mat3& stress = cell.stress;
      for (const double component :
           {stress(0, 0), stress(1, 1), stress(2, 2), stress(0, 1), stress(1, 2), stress(2, 0)})
        response.stress.push_back(component);
      response.pressure.push_back(-stress.trace() / 3.0);
    }
    return accept(response, request.name + ": " + std::to_string(load->cells.size()) + " cells");
  }

  bool pause(std_srvs::SetBool::Request& request, std_srvs::SetBool::Response& response) {
    if (request.data && !runner.status().paused)
      if (const auto no = training.refuses(Intervention::kPause)) return refuse(response, "pause", *no);
    const auto step = runner.setPaused(request.data);
    if (!step.ok()) return refuse(response, "pause", step.error());
    return accept(response, (request.data ? "paused at step " : "runs from step ") + std::to_string(*step));
  }

  bool step(meshless_surgery::Step::Request& request, meshless_surgery::Step::Response& response) {
    return work.step(request, response, "step");
  }

  bool reset(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    const Status done = runner.reset();
    if (!done.ok()) return refuse(response, "reset", done.error());
    return accept(response, "back to the scene's start" + tools.notEnabled());
  }

  bool save(meshless_surgery::SaveState::Request& request, meshless_surgery::SaveState::Response& response) {
    const auto bytes = session.save(runner, request.file);
    if (!bytes.ok()) return refuse(response, "save", bytes.error());
    return accept(response, "saved " + request.file + ", " + std::to_string(*bytes) + " bytes");
  }

  bool load(meshless_surgery::LoadState::Request& request, meshless_surgery::LoadState::Response& response) {
    if (const auto no = training.refuses(Intervention::kLoad)) return refuse(response, "load", *no);
    const auto loaded = session.load(runner, request.file);
    if (!loaded.ok()) return refuse(response, "load", loaded.error());
    return accept(response, "loaded " + request.file + ": step " + std::to_string(loaded->step) + ", " +
                                std::to_string(loaded->bodies) + " bodies; cuts before it cannot be undone" +
                                tools.notEnabled());
  }

  bool hash(meshless_surgery::Hash::Request&, meshless_surgery::Hash::Response& response) {
    return answerHash(runner, response);
  }

  WorldRunner& runner;
  Frames& frames;
  Session& session;
  const StreamedTools& tools;
  const LiveTraining& training;
  const LongWork work;
  // Queues before servers before spinners: torn down in the other order.
  ros::CallbackQueue cut_queue, step_queue, spawn_queue, cloud_queue, session_queue;
  std::vector<ros::ServiceServer> servers;
  Actions actions;
  ros::AsyncSpinner cut_spinner{kCutThreads, &cut_queue};
  ros::AsyncSpinner step_spinner{1, &step_queue};
  ros::AsyncSpinner spawn_spinner{kSpawnThreads, &spawn_queue};
  ros::AsyncSpinner cloud_spinner{kSpawnThreads, &cloud_queue};
  ros::AsyncSpinner session_spinner{1, &session_queue};
};

Services::Services(const ros::NodeHandle& private_handle, WorldRunner& runner, Frames& frames, const BodyLoader& loader,
                   Rejections& rejections, Session& session, const StreamedTools& tools, const LiveTraining& training)
    : handlers_(
          std::make_unique<Handlers>(private_handle, runner, frames, loader, rejections, session, tools, training)) {}

Services::~Services() = default;

}  // namespace meshless
