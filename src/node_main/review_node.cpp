// The node that shows a log of commands; see docs/reference/sessions.md.
#include <ros/ros.h>

#include "end_on_signal.h"
#include "meshless_surgery/ros/review_node.h"

int main(int argc, char** argv) {
  meshless::EndOnSignal end;
  ros::init(argc, argv, "review", ros::init_options::NoSigintHandler);
  const ros::NodeHandle private_handle("~");
  auto node = meshless::ReviewNode::start(private_handle);
  if (!node.ok()) {
    ROS_FATAL_STREAM(node.error().detail);
    ros::shutdown();
    return 1;
  }
  end.wait();
  node->reset();
  ros::shutdown();
  return 0;
}
