// The node. Everything that it offers is private to its name; see docs/interface.md.
#include <ros/ros.h>

#include "meshless_surgery/ros/node.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "deformer");
  const ros::NodeHandle private_handle("~");
  // Streams and services that answer at once; those that wait have threads of their own.
  ros::AsyncSpinner spinner(4);
  spinner.start();
  auto node = meshless::DeformerNode::start(private_handle);
  if (!node.ok()) {
    ROS_FATAL_STREAM(node.error().detail);
    ros::shutdown();
    return 1;
  }
  ros::waitForShutdown();
  // While callbacks can still be answered.
  node->reset();
  spinner.stop();
  return 0;
}
