// Streams that move the tools: CRTK topics or tf frames.
#pragma once

#include <atomic>
#include <mutex>

#include <geometry_msgs/PoseStamped.h>
#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>

#include "meshless_surgery/ros/frames.h"
#include "meshless_surgery/ros/rejections.h"
#include "meshless_surgery/ros/runner.h"
#include "meshless_surgery/ros/settings.h"

namespace meshless {

constexpr double kJawOpen = 0.1;     // [rad] the jaw must have been opened beyond ...
constexpr double kJawClosed = 0.02;  // [rad] ... and close below, to cut

class ToolInputs {
 public:
  ToolInputs(const ros::NodeHandle& private_handle, const NodeSettings& settings, WorldRunner& runner, Frames& frames,
             Rejections& rejections);
  ~ToolInputs();

  /// The last streamed pose of the pick's hand: shown while no pick is in it.
  std::optional<Pose> pickCursor() const;

 private:
  void onServo(const std::string& tool, const geometry_msgs::PoseStamped::ConstPtr& message);
  void onJaw(const sensor_msgs::JointState::ConstPtr& message);
  void follow();
  void move(const std::string& tool, const Pose& pose);
  void movePick(const Pose& pose);
  void movePush(const Pose& pose);
  void moveScissors(const Pose& pose);

  NodeSettings settings_;
  WorldRunner& runner_;
  Frames& frames_;
  Rejections& rejections_;

  mutable std::mutex mutex_;
  std::optional<Pose> pick_pose_;
  std::optional<Pose> scissors_pose_;
  double jaw_angle_ = 0.5;    // [rad]
  bool jaw_armed_ = false;

  std::vector<ros::Subscriber> subscribers_;
  ros::WallTimer follow_timer_;
  std::shared_ptr<std::atomic<bool>> follow_posted_;  // a poll waits in the runner: no second one behind it
};

}  // namespace meshless
