#include "clock_publisher.h"

#include <ros/console.h>
#include <ros/master.h>
#include <ros/names.h>
#include <ros/this_node.h>

#include "border_check.h"

namespace meshless {
namespace {

constexpr char kTopic[] = "/clock";
constexpr std::uint32_t kQueue = 1000;  // messages: ~step goes faster than who records

/// Another node that the master knows to publish /clock; empty: there is none.
std::string otherPublisher() {
  XmlRpc::XmlRpcValue request, response, payload;
  request[0] = ros::this_node::getName();
  if (!ros::master::execute("getSystemState", request, response, payload, false)) return "";
  const std::string topic = ros::names::resolve(kTopic);
  XmlRpc::XmlRpcValue& topics = payload[0];
  for (int i = 0; i < topics.size(); ++i) {
    if (static_cast<std::string&>(topics[i][0]) != topic) continue;
    XmlRpc::XmlRpcValue& nodes = topics[i][1];
    for (int n = 0; n < nodes.size(); ++n) {
      const std::string name = static_cast<std::string&>(nodes[n]);
      if (name != ros::this_node::getName()) return name;
    }
  }
  return "";
}

ros::Time date() {
  const ros::WallTime now = ros::WallTime::now();
  return {now.sec, now.nsec};
}

}  // namespace

Result<std::unique_ptr<ClockPublisher>> ClockPublisher::start(Rejections& rejections) {
  if (!ros::Time::isSimTime()) {
    return Error{ErrorCode::kInvalidArgument,
                 "parameter ~publish_clock is true, and /use_sim_time was not when the node started; accepted: "
                 "/use_sim_time true before any node starts, as nodes follow /clock only then"};
  }
  std::unique_ptr<ClockPublisher> clock(new ClockPublisher(rejections));
  // Asked when this node is known already: of two that start at once, one at the least sees the other.
  if (const std::string other = otherPublisher(); !other.empty()) {
    return Error{ErrorCode::kInvalidArgument, "parameter ~publish_clock is true, and '" + printable(other) +
                                                  "' publishes /clock; accepted: one publisher of /clock (rosnode "
                                                  "cleanup makes the master forget nodes that were killed)"};
  }
  clock->publish(clock->begin_);
  return clock;
}

ClockPublisher::ClockPublisher(Rejections& rejections) : rejections_(rejections), begin_(date()) {
  ros::NodeHandle handle;
  // Latched: who comes while the world is paused needs the time, too.
  topic_ = handle.advertise<rosgraph_msgs::Clock>(kTopic, kQueue, true);
  heard_ = handle.subscribe(kTopic, kQueue, &ClockPublisher::heard, this);
}

void ClockPublisher::advance(double dt) {
  ros::Time time;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    elapsed_ += dt;
    time = begin_ + ros::Duration(elapsed_);
  }
  publish(time);
}

ros::Time ClockPublisher::now() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return begin_ + ros::Duration(elapsed_);
}

void ClockPublisher::publish(const ros::Time& time) {
  rosgraph_msgs::Clock message;
  message.clock = time;
  topic_.publish(message);
}

void ClockPublisher::heard(const ros::MessageEvent<rosgraph_msgs::Clock const>& event) {
  const std::string& name = event.getPublisherName();
  if (name == ros::this_node::getName()) return;
  const std::string why = "'" + printable(name) +
                          "' publishes it too, and stamps go by either of them; accepted: one "
                          "publisher, which is this node with ~publish_clock";
  rejections_.count(kTopic, why);
  const std::lock_guard<std::mutex> lock(mutex_);
  if (others_.insert(name).second) ROS_ERROR_STREAM(kTopic << ": " << why);
}

}  // namespace meshless
