// Streams that move the tools: CRTK topics or tf frames. A tool follows at a bounded speed, and is lifted off when its
// stream falls silent.
#pragma once

#include <array>
#include <mutex>

#include <geometry_msgs/PoseStamped.h>
#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>

#include "meshless_surgery/ros/frames.h"
#include "meshless_surgery/ros/rejections.h"
#include "meshless_surgery/ros/runner.h"
#include "meshless_surgery/ros/settings.h"
#include "meshless_surgery/ros/tool_motion.h"

namespace meshless {

constexpr double kJawOpen = 0.1;     // [rad] the jaw must have been opened beyond ...
constexpr double kJawClosed = 0.02;  // [rad] ... and close below, to cut

class ToolInputs {
 public:
  ToolInputs(const ros::NodeHandle& private_handle, const NodeSettings& settings, WorldRunner& runner, Frames& frames,
             Rejections& rejections);
  ~ToolInputs();

  /// Where its stream last wanted a tool, while the stream speaks.
  std::optional<Pose> hand(ToolKind tool) const;

 private:
  struct Tool {
    std::string name;
    ToolKind kind;
    std::string follow_frame;
    ToolMotion motion;
    ros::Time frame_stamp;  // of the transform that was last followed
    bool posted = false;    // a move waits in the runner: no second one behind it
  };

  void onServo(Tool& tool, const geometry_msgs::PoseStamped::ConstPtr& message);
  void onJaw(const sensor_msgs::JointState::ConstPtr& message);
  void reject(const std::string& input, const Error& error);
  void follow();
  void watch();
  void hear(Tool& tool, const Pose& pose, const ros::Time& stamp, const std::string& input);
  void postMove(Tool& tool);
  void move(Tool& tool, World& world);
  void movePick(Tool& tool, World& world);
  void movePush(Tool& tool, World& world);
  void moveScissors(Tool& tool, World& world);
  void lift(Tool& tool);

  NodeSettings settings_;
  WorldRunner& runner_;
  Frames& frames_;
  Rejections& rejections_;

  mutable std::mutex mutex_;  // of all below; the runner's jobs take it too
  std::array<Tool, 3> tools_;
  double watched_ = 0.0;    // [s] the last look for silence
  double jaw_angle_ = 0.5;  // [rad]
  bool jaw_armed_ = false;

  std::vector<ros::Subscriber> subscribers_;
  ros::WallTimer follow_timer_;
  ros::WallTimer watch_timer_;  // runs while a tool is there
};

}  // namespace meshless
