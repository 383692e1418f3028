#include "meshless_surgery/ros/tool_inputs.h"

#include <cmath>

#include <ros/console.h>

#include "meshless_surgery/ros/border_check.h"
#include "meshless_surgery/ros/convert.h"

namespace meshless {
namespace {

constexpr double kComplainEvery = 5.0;  // [s] of a stream that goes wrong
constexpr double kMaxJaw = 3.2;         // [rad]

}  // namespace

ToolInputs::ToolInputs(const ros::NodeHandle& private_handle, const NodeSettings& settings, WorldRunner& runner,
                       Frames& frames, Rejections& rejections)
    : settings_(settings),
      runner_(runner),
      frames_(frames),
      rejections_(rejections),
      follow_posted_(std::make_shared<std::atomic<bool>>(false)) {
  ros::NodeHandle handle(private_handle);
  const std::pair<const char*, const ToolSettings*> tools[] = {
      {"pick", &settings_.pick}, {"push", &settings_.push}, {"scissors", &settings_.scissors}};
  bool follows = false;
  for (const auto& [tool, tool_settings] : tools) {
    if (!tool_settings->follow_frame.empty()) {
      follows = true;
      continue;
    }
    const std::string name = tool;
    subscribers_.push_back(handle.subscribe<geometry_msgs::PoseStamped>(
        name + "/servo_cp", 10, [this, name](const geometry_msgs::PoseStamped::ConstPtr& message) {
          onServo(name, message);
        }));
  }
  subscribers_.push_back(handle.subscribe<sensor_msgs::JointState>(
      "scissors/jaw/servo_js", 10, [this](const sensor_msgs::JointState::ConstPtr& message) { onJaw(message); }));
  if (follows) {
    const ros::WallDuration period(1.0 / runner_.worldSettings().step_rate);
    follow_timer_ = handle.createWallTimer(period, [this](const ros::WallTimerEvent&) { follow(); });
  }
}

ToolInputs::~ToolInputs() = default;

std::optional<Pose> ToolInputs::pickCursor() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return pick_pose_;
}

void ToolInputs::onServo(const std::string& tool, const geometry_msgs::PoseStamped::ConstPtr& message) {
  BorderCheck check;
  const Pose local =
      tool == "scissors" ? check.pose("pose", message->pose) : check.pointPose("pose", message->pose);
  std::optional<Error> error;
  Pose pose;
  if (!check.ok()) {
    error = check.error();
  } else {
    const auto frame = frames_.toWorld(message->header);
    if (frame.ok()) {
      pose.rotation = frame->rotation * local.rotation;
      pose.translation = *frame * local.translation;
    } else {
      error = frame.error();
    }
  }
  if (error) {
    rejections_.count("~" + tool + "/servo_cp", error->detail);
    ROS_WARN_STREAM_THROTTLE(kComplainEvery, "~" << tool << "/servo_cp: " << error->detail);
    return;
  }
  move(tool, pose);
}

void ToolInputs::follow() {
  // One poll in the runner at a time: a world that is late must not gather them.
  if (follow_posted_->exchange(true)) return;
  const std::pair<const char*, const ToolSettings*> tools[] = {
      {"pick", &settings_.pick}, {"push", &settings_.push}, {"scissors", &settings_.scissors}};
  for (const auto& [tool, tool_settings] : tools) {
    if (tool_settings->follow_frame.empty()) continue;
    const auto pose = frames_.latest(tool_settings->follow_frame);
    if (pose) {
      move(tool, *pose);
    } else {
      ROS_WARN_STREAM_THROTTLE(kComplainEvery, "tools/" << tool << "/follow_frame: tf2 cannot bring '"
                                                        << tool_settings->follow_frame << "' to '"
                                                        << frames_.worldFrame() << "' (yet)");
    }
  }
  runner_.post([posted = follow_posted_](World&) { *posted = false; });
}

void ToolInputs::move(const std::string& tool, const Pose& pose) {
  if (tool == "pick") movePick(pose);
  if (tool == "push") movePush(pose);
  if (tool == "scissors") moveScissors(pose);
}

void ToolInputs::movePick(const Pose& pose) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    pick_pose_ = pose;
  }
  runner_.post([target = pose.translation](World& world) {
    MovePickCommand command;
    command.pick = world.pickInHand();
    command.target = target;
    if (command.pick != 0) (void)world.apply(command);
  });
}

void ToolInputs::movePush(const Pose& pose) {
  runner_.post([position = pose.translation, max_speed = settings_.push_max_speed](World& world) {
    PushCommand command;
    command.position = position;
    // It appears where the stream is, and from then on travels, in the size that it has.
    if (world.push().enabled) {
      command.radius = world.push().radius;
      command.speed = max_speed;
    }
    (void)world.apply(command);
  });
}

void ToolInputs::moveScissors(const Pose& pose) {
  double angle = 0.0;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    scissors_pose_ = pose;
    angle = jaw_angle_;
  }
  const Blades blades = bladesAt(pose, settings_.scissors_length, settings_.scissors_width);
  runner_.post([blades, angle](World& world) { world.setScissors(blades, angle); });
}

void ToolInputs::onJaw(const sensor_msgs::JointState::ConstPtr& message) {
  const std::string name = "~scissors/jaw/servo_js";
  BorderCheck check;
  double angle = 0.0;
  if (message->position.empty()) {
    check.fault("position is empty; accepted: position[0], the opening angle in rad");
  } else {
    angle = check.number("position[0]", message->position[0], -kMaxJaw, kMaxJaw, "rad");
  }
  if (!check.ok()) {
    rejections_.count(name, check.error().detail);
    ROS_WARN_STREAM_THROTTLE(kComplainEvery, name << ": " << check.error().detail);
    return;
  }
  angle = std::max(0.0, angle);
  bool closes = false;
  std::optional<Pose> pose;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    jaw_angle_ = angle;
    pose = scissors_pose_;
    if (angle > kJawOpen) jaw_armed_ = true;
    if (angle < kJawClosed && jaw_armed_) {
      jaw_armed_ = false;
      closes = true;
    }
  }
  if (!pose) return;  // nobody said yet where the scissors are
  const Blades blades = bladesAt(*pose, settings_.scissors_length, settings_.scissors_width);
  runner_.post([blades, angle, closes, name, this](World& world) {
    world.setScissors(blades, angle);
    if (!closes) return;
    CutCommand command;
    command.blades = blades;
    const auto reply = world.apply(command);
    // Cutting the air is no fault of the input.
    if (!reply.ok() && reply.error().code != ErrorCode::kMissed) {
      rejections_.count(name, reply.error().detail);
      ROS_WARN_STREAM(name << ": " << reply.error().detail);
    }
  });
}

}  // namespace meshless
