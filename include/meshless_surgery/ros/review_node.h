// A node that shows a log of commands: its bodies, tools and obstacles as topics of a running node, at any moment.
#pragma once

#include <memory>

#include <ros/node_handle.h>

#include "meshless_surgery/base/result.h"

namespace meshless {

class ReviewNode {
 public:
  /// Reads ~log and its index, which is made where there is none of it.
  static Result<std::unique_ptr<ReviewNode>> start(const ros::NodeHandle& private_handle);
  ~ReviewNode();

 private:
  struct Parts;
  explicit ReviewNode(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace meshless
