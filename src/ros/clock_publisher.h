// The simulated time as /clock: the parameter publish_clock.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include <ros/message_event.h>
#include <ros/node_handle.h>
#include <rosgraph_msgs/Clock.h>

#include "meshless_surgery/base/result.h"
#include "rejections.h"

namespace meshless {

/// Goes on with each step, and never back: not by a reset either, as tf and filters of other nodes would forget what
/// they have. Thread-safe.
class ClockPublisher {
 public:
  /// Says the time at once, which is the date. Refuses kInvalidArgument where /use_sim_time is not true, as nobody
  /// would follow, and where somebody else publishes /clock. Of those that come later the log and the diagnostics tell.
  static Result<std::unique_ptr<ClockPublisher>> start(Rejections& rejections);

  /// One step more. [s]
  void advance(double dt);
  /// Without the way that a message takes back to this node.
  ros::Time now() const;

 private:
  explicit ClockPublisher(Rejections& rejections);
  void publish(const ros::Time& time);
  void heard(const ros::MessageEvent<rosgraph_msgs::Clock const>& event);

  Rejections& rejections_;
  const ros::Time begin_;
  mutable std::mutex mutex_;
  double elapsed_ = 0.0;          // [s]
  std::set<std::string> others_;  // that were heard
  ros::Publisher topic_;
  ros::Subscriber heard_;
};

}  // namespace meshless
