// Streams that move the tools: CRTK topics or tf frames.
#pragma once

#include <array>
#include <chrono>
#include <deque>
#include <mutex>

#include <geometry_msgs/PoseStamped.h>
#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>

#include "frames.h"
#include "rejections.h"
#include "runner.h"
#include "settings.h"
#include "streamed_tools.h"

namespace meshless {

class ToolInputs {
 public:
  ToolInputs(const ros::NodeHandle& private_handle, const NodeSettings& settings, const Clock& clock,
             WorldRunner& runner, Frames& frames, Rejections& rejections);

  StreamedTools& tools() { return tools_; }

 private:
  struct Message {
    geometry_msgs::PoseStamped::ConstPtr message;
    std::chrono::steady_clock::time_point until;  // it waits for its transform
  };
  struct Input {
    std::string name;  // of the topic or parameter
    ToolKind tool;
    std::string follow_frame;
    ros::Time frame_stamp;        // of the transform that was last followed
    std::deque<Message> waiting;  // the oldest first
  };

  void onServo(Input& input, const geometry_msgs::PoseStamped::ConstPtr& message);
  void onJaw(const std::string& topic, const sensor_msgs::JointState& message);
  void look();
  void hearWaiting(Input& input);
  void follow(Input& input);
  void hear(const Input& input, const Pose& pose, const ros::Time& stamp);
  void reject(const std::string& input, const Error& error);

  Frames& frames_;
  Rejections& rejections_;
  StreamedTools tools_;

  std::mutex mutex_;  // of the inputs
  std::array<Input, 3> inputs_;
  std::vector<ros::Subscriber> subscribers_;
  ros::WallTimer look_timer_;
};

}  // namespace meshless
