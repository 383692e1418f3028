// The deformer: a scene, the thread that runs it, and what ROS sees of it.
#pragma once

#include <memory>

#include <ros/node_handle.h>

#include "meshless_surgery/base/result.h"

namespace meshless {

class DeformerNode {
 public:
  /// Reads parameters and scene, prepares the bodies, starts the world and then offers the services. Refuses with the
  /// first thing that is wrong.
  static Result<std::unique_ptr<DeformerNode>> start(const ros::NodeHandle& private_handle);
  ~DeformerNode();

 private:
  struct Parts;
  explicit DeformerNode(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace meshless
