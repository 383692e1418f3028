#include "meshless_surgery/ros/tool_inputs.h"

#include <chrono>

#include <ros/console.h>

#include "meshless_surgery/ros/border_check.h"
#include "meshless_surgery/ros/convert.h"

namespace meshless {
namespace {

constexpr double kComplainEvery = 5.0;  // [s] of a stream that goes wrong
constexpr double kMaxJaw = 3.2;         // [rad]
constexpr double kHeldUp = 0.2;         // [s] between two looks
constexpr double kWatchEvery = 0.01;    // [s] while a tool is there: it goes on, or has fallen silent
constexpr double kTurnSpeed = 50.0;     // [rad/s]
constexpr double kUnbounded = 1e12;

double wallSeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

ToolInputs::ToolInputs(const ros::NodeHandle& private_handle, const NodeSettings& settings, WorldRunner& runner,
                       Frames& frames, Rejections& rejections)
    : settings_(settings),
      runner_(runner),
      frames_(frames),
      rejections_(rejections),
      tools_{Tool{"pick",
                  ToolKind::kPick,
                  settings.pick.follow_frame,
                  ToolMotion({settings.pick_max_speed, kTurnSpeed, settings.tools_silence}),
                  {},
                  false},
             // The world itself holds the sphere to its speed, in simulated time.
             Tool{"push",
                  ToolKind::kPush,
                  settings.push.follow_frame,
                  ToolMotion({kUnbounded, kUnbounded, settings.tools_silence}),
                  {},
                  false},
             Tool{"scissors",
                  ToolKind::kScissors,
                  settings.scissors.follow_frame,
                  ToolMotion({settings.scissors_max_speed, kTurnSpeed, settings.tools_silence}),
                  {},
                  false}} {
  ros::NodeHandle handle(private_handle);
  watch_timer_ = handle.createWallTimer(
      ros::WallDuration(kWatchEvery), [this](const ros::WallTimerEvent&) { watch(); }, false, false);
  bool follows = false;
  for (Tool& tool : tools_) {
    if (!tool.follow_frame.empty()) {
      follows = true;
      continue;
    }
    subscribers_.push_back(handle.subscribe<geometry_msgs::PoseStamped>(
        tool.name + "/servo_cp", 10,
        [this, &tool](const geometry_msgs::PoseStamped::ConstPtr& message) { onServo(tool, message); }));
  }
  subscribers_.push_back(handle.subscribe<sensor_msgs::JointState>(
      "scissors/jaw/servo_js", 10, [this](const sensor_msgs::JointState::ConstPtr& message) { onJaw(message); }));
  if (follows) {
    const ros::WallDuration period(1.0 / runner_.worldSettings().step_rate);
    follow_timer_ = handle.createWallTimer(period, [this](const ros::WallTimerEvent&) { follow(); });
  }
}

ToolInputs::~ToolInputs() = default;

std::optional<Pose> ToolInputs::hand(ToolKind tool) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const ToolMotion& motion = tools_[static_cast<std::size_t>(tool)].motion;
  return motion.alive() ? std::optional<Pose>(motion.wanted()) : std::nullopt;
}

void ToolInputs::reject(const std::string& input, const Error& error) {
  rejections_.count(input, error.detail);
  ROS_WARN_STREAM_THROTTLE(kComplainEvery, input << ": " << error.detail);
}

void ToolInputs::onServo(Tool& tool, const geometry_msgs::PoseStamped::ConstPtr& message) {
  const std::string input = "~" + tool.name + "/servo_cp";
  BorderCheck check;
  const Pose local =
      tool.kind == ToolKind::kScissors ? check.pose("pose", message->pose) : check.pointPose("pose", message->pose);
  if (!check.ok()) return reject(input, check.error());
  const auto frame = frames_.toWorld(message->header);
  if (!frame.ok()) return reject(input, frame.error());
  Pose pose;
  pose.rotation = frame->rotation * local.rotation;
  pose.translation = *frame * local.translation;
  hear(tool, pose, message->header.stamp, input);
}

void ToolInputs::follow() {
  for (Tool& tool : tools_) {
    if (tool.follow_frame.empty()) continue;
    const auto latest = frames_.latest(tool.follow_frame);
    if (!latest) {
      ROS_WARN_STREAM_THROTTLE(kComplainEvery, "tools/" << tool.name << "/follow_frame: tf2 cannot bring '"
                                                        << tool.follow_frame << "' to '" << frames_.worldFrame()
                                                        << "' (yet)");
      continue;
    }
    // tf2 goes on to give the last transform when nobody says new ones. One that never moves has no stamp.
    if (!latest->stamp.isZero() && latest->stamp == tool.frame_stamp) continue;
    tool.frame_stamp = latest->stamp;
    hear(tool, latest->pose, latest->stamp, "tools/" + tool.name + "/follow_frame");
  }
}

void ToolInputs::hear(Tool& tool, const Pose& pose, const ros::Time& stamp, const std::string& input) {
  Status heard = Done{};
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    heard = tool.motion.hear(pose, stamp.toSec(), wallSeconds());
  }
  if (!heard.ok()) return reject(input, heard.error());
  watch_timer_.start();
  postMove(tool);
}

void ToolInputs::watch() {
  bool any = false;
  const double now = wallSeconds();
  {
    // Where the node itself was held up, streams have not been silent: what they said is still in their queues.
    const std::lock_guard<std::mutex> lock(mutex_);
    if (now - watched_ > kHeldUp)
      for (Tool& tool : tools_) tool.motion.keepAlive(now);
    watched_ = now;
  }
  for (Tool& tool : tools_) {
    bool silent = false;
    bool under_way = false;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      silent = tool.motion.fellSilent(now);
      under_way = tool.motion.alive() && !tool.motion.arrived();
      any = any || tool.motion.alive();
    }
    if (silent) lift(tool);
    if (under_way) postMove(tool);
  }
  if (any) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const Tool& tool : tools_)
    if (tool.motion.alive()) return;  // it spoke meanwhile
  watch_timer_.stop();
}

void ToolInputs::postMove(Tool& tool) {
  {
    // A world that is late must not gather them.
    const std::lock_guard<std::mutex> lock(mutex_);
    if (tool.posted) return;
    tool.posted = true;
  }
  runner_.post([this, &tool](World& world) { move(tool, world); });
}

void ToolInputs::move(Tool& tool, World& world) {
  const std::lock_guard<std::mutex> lock(mutex_);
  tool.posted = false;
  if (!tool.motion.alive()) return;  // silent since
  if (tool.kind == ToolKind::kPick) movePick(tool, world);
  if (tool.kind == ToolKind::kPush) movePush(tool, world);
  if (tool.kind == ToolKind::kScissors) moveScissors(tool, world);
}

void ToolInputs::movePick(Tool& tool, World& world) {
  const auto held = world.heldPick();
  // From where the spring's end is: it may have been taken into the hand just now.
  if (held) tool.motion.putAt(held->target);
  tool.motion.advance(wallSeconds());
  if (!held) return;
  MovePickCommand command;
  command.pick = held->id;
  command.target = tool.motion.pose().translation;
  (void)world.apply(command);
}

void ToolInputs::movePush(Tool& tool, World& world) {
  tool.motion.advance(wallSeconds());
  PushCommand command;
  command.position = tool.motion.pose().translation;
  command.streamed = true;
  // It appears where the stream is, and from then on travels, in the size that it has.
  if (world.push().enabled) {
    command.radius = world.push().radius;
    command.speed = settings_.push_max_speed;
  }
  (void)world.apply(command);
}

void ToolInputs::moveScissors(Tool& tool, World& world) {
  tool.motion.advance(wallSeconds());
  world.setScissors(bladesAt(tool.motion.pose(), settings_.scissors_length, settings_.scissors_width), jaw_angle_);
}

void ToolInputs::lift(Tool& tool) {
  if (tool.kind == ToolKind::kScissors) {
    const std::lock_guard<std::mutex> lock(mutex_);
    jaw_armed_ = false;
  }
  runner_.post([this, &tool](World& world) {
    LiftCommand command;
    command.tool = tool.kind;
    command.streamed_only = true;
    command.why = "the " + tool.name + " was lifted off: its stream was silent for " +
                  formatNumber(settings_.tools_silence) + " s";
    if (tool.kind == ToolKind::kPick) {
      const auto held = world.heldPick();
      const std::lock_guard<std::mutex> lock(mutex_);
      if (!held || held->target != tool.motion.pose().translation) return;  // somebody else has moved it
    }
    (void)world.apply(command);
  });
}

void ToolInputs::onJaw(const sensor_msgs::JointState::ConstPtr& message) {
  const std::string input = "~scissors/jaw/servo_js";
  BorderCheck check;
  double angle = 0.0;
  if (message->position.empty()) {
    check.fault("position is empty; accepted: position[0], the opening angle in rad");
  } else {
    angle = check.number("position[0]", message->position[0], -kMaxJaw, kMaxJaw, "rad");
  }
  if (!check.ok()) return reject(input, check.error());
  angle = std::max(0.0, angle);
  bool closes = false;
  Pose pose;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    jaw_angle_ = angle;
    if (angle > kJawOpen) jaw_armed_ = true;
    if (angle < kJawClosed && jaw_armed_) {
      jaw_armed_ = false;
      closes = true;
    }
    ToolMotion& motion = tools_[2].motion;
    if (!motion.alive()) return;  // nobody said (yet, or any more) where the scissors are
    motion.keepAlive(wallSeconds());
    pose = motion.pose();
  }
  const Blades blades = bladesAt(pose, settings_.scissors_length, settings_.scissors_width);
  runner_.post([blades, angle, closes, input, this](World& world) {
    world.setScissors(blades, angle);
    if (!closes) return;
    CutCommand command;
    command.blades = blades;
    const auto reply = world.apply(command);
    // Cutting the air is no fault of the input.
    if (!reply.ok() && reply.error().code != ErrorCode::kMissed) reject(input, reply.error());
  });
}

}  // namespace meshless
