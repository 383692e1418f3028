#include "tool_inputs.h"

#include <ros/console.h>

#include "border_check.h"
#include "crtk_messages.h"

namespace meshless {
namespace {

constexpr double kComplainEvery = 5.0;    // [s] of a stream that goes wrong
constexpr double kMaxJaw = 3.2;           // [rad]
constexpr double kLookEvery = 0.005;      // [s] on the wall: also where /clock is played ten times as fast
constexpr std::size_t kMostWaiting = 10;  // messages of a stream
constexpr const char* kJaws[] = {"scissors/jaw/servo_js", "scissors/jaw/servo_jp"};

}  // namespace

ToolInputs::ToolInputs(const ros::NodeHandle& private_handle, const NodeSettings& settings, const Clock& clock,
                       WorldRunner& runner, Frames& frames, Rejections& rejections)
    : frames_(frames),
      rejections_(rejections),
      tools_(
          settings, clock, [&runner](std::function<void(World&)> job) { runner.post(std::move(job)); },
          [this](const Error& error) { reject(std::string("~") + kJaws[0], error); }),
      inputs_{Input{"pick", ToolKind::kPick, settings.pick.follow_frame, {}, {}},
              Input{"push", ToolKind::kPush, settings.push.follow_frame, {}, {}},
              Input{"scissors", ToolKind::kScissors, settings.scissors.follow_frame, {}, {}}} {
  ros::NodeHandle handle(private_handle);
  // Small messages that must not wait for one another on their way.
  const auto hints = ros::TransportHints().tcpNoDelay();
  for (Input& input : inputs_) {
    const std::string topic = input.name + "/servo_cp";
    const std::string commands = input.name + "/state_command";
    subscribers_.push_back(handle.subscribe<CrtkString>(
        commands, 10, [this, &input, commands](const boost::shared_ptr<const CrtkString>& message) {
          const Status done = tools_.command(input.tool, message->string);
          if (!done.ok()) reject("~" + commands, done.error());
        }));
    input.name = input.follow_frame.empty() ? "~" + topic : "tools/" + input.name + "/follow_frame";
    if (!input.follow_frame.empty()) continue;
    subscribers_.push_back(handle.subscribe<geometry_msgs::PoseStamped>(
        topic, 10, [this, &input](const geometry_msgs::PoseStamped::ConstPtr& message) { onServo(input, message); }, {},
        hints));
  }
  for (const std::string jaw : kJaws) {
    subscribers_.push_back(handle.subscribe<sensor_msgs::JointState>(
        jaw, 10, [this, jaw](const sensor_msgs::JointState::ConstPtr& message) { onJaw("~" + jaw, *message); }, {},
        hints));
  }
  look_timer_ = handle.createWallTimer(ros::WallDuration(kLookEvery), [this](const ros::WallTimerEvent&) { look(); });
}

void ToolInputs::reject(const std::string& input, const Error& error) {
  rejections_.count(input, error.detail);
  ROS_WARN_STREAM_THROTTLE(kComplainEvery, input << ": " << error.detail);
}

void ToolInputs::onServo(Input& input, const geometry_msgs::PoseStamped::ConstPtr& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  input.waiting.push_back({message, frames_.waitEnd()});
  hearWaiting(input);
}

void ToolInputs::hearWaiting(Input& input) {
  const auto now = std::chrono::steady_clock::now();
  for (auto next = input.waiting.begin(); next != input.waiting.end();) {
    const geometry_msgs::PoseStamped& message = *next->message;
    BorderCheck check;
    const Pose local = check.pose("pose", message.pose);
    const auto frame = check.ok() ? frames_.lookUp(message.header) : Result<Pose>(check.error());
    if (frame.ok()) {
      Pose pose;
      pose.rotation = frame->rotation * local.rotation;
      pose.translation = check.place("pose.position", *frame, local.translation);
      if (check.ok())
        hear(input, pose, message.header.stamp);
      else
        reject(input.name, check.error());
    } else if (!check.ok() || now >= next->until || input.waiting.size() > kMostWaiting) {
      reject(input.name, frame.error());
    } else {
      ++next;
      continue;
    }
    next = input.waiting.erase(next);
  }
}

void ToolInputs::follow(Input& input) {
  if (tools_.condition(input.tool).state != Operating::kEnabled) return;
  const auto latest = frames_.latest(input.follow_frame);
  if (!latest) {
    ROS_WARN_STREAM_DELAYED_THROTTLE(kComplainEvery, input.name << ": tf2 cannot bring '" << input.follow_frame
                                                                << "' to '" << frames_.worldFrame() << "' (yet)");
    return;
  }
  // tf2 goes on to give the last transform when nobody says new ones. One that never moves has no stamp.
  if (!latest->stamp.isZero() && latest->stamp == input.frame_stamp) return;
  input.frame_stamp = latest->stamp;
  hear(input, latest->pose, latest->stamp);
}

void ToolInputs::hear(const Input& input, const Pose& pose, const ros::Time& stamp) {
  const auto heard = tools_.hear(input.tool, pose, stamp.toSec());
  if (!heard.ok()) {
    reject(input.name, heard.error());
  } else if (!heard->empty()) {
    ROS_WARN_STREAM_THROTTLE(kComplainEvery, input.name << ": " << *heard);
  }
}

void ToolInputs::look() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (Input& input : inputs_) {
      hearWaiting(input);
      if (!input.follow_frame.empty()) follow(input);
    }
  }
  tools_.look();
}

void ToolInputs::onJaw(const std::string& topic, const sensor_msgs::JointState& message) {
  BorderCheck check;
  double angle = 0.0;
  if (message.position.empty()) {
    check.fault("position is empty; accepted: position[0], the opening angle in rad");
  } else {
    angle = check.number("position[0]", message.position[0], -kMaxJaw, kMaxJaw, "rad");
  }
  if (!check.ok()) return reject(topic, check.error());
  if (const Status heard = tools_.hearJaw(std::max(0.0, angle)); !heard.ok()) reject(topic, heard.error());
}

}  // namespace meshless
