#include "meshless_surgery/ros/force_publisher.h"

#include <algorithm>
#include <chrono>

#include <geometry_msgs/WrenchStamped.h>

#include "meshless_surgery/ros/convert.h"

namespace meshless {
namespace {

using Clock = std::chrono::steady_clock;

double wallSeconds() { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }

}  // namespace

ForcePublisher::ForcePublisher(const ros::NodeHandle& private_handle, const NodeSettings& settings,
                               const ToolInputs& inputs)
    : world_frame_(settings.world_frame), period_(1.0 / settings.force_rate), inputs_(inputs) {
  ros::NodeHandle handle(private_handle);
  const auto wake = [this](const ros::SingleSubscriberPublisher&) {
    const std::lock_guard<std::mutex> lock(mutex_);
    woken_.notify_all();
  };
  const char* names[] = {"pick", "push", "scissors"};
  for (std::size_t t = 0; t < tools_.size(); ++t)
    tools_[t].topic = handle.advertise<geometry_msgs::WrenchStamped>(std::string(names[t]) + "/measured_cf", 10, wake);
}

ForcePublisher::~ForcePublisher() { stop(); }

void ForcePublisher::start() {
  thread_ = std::thread([this] { loop(); });
}

void ForcePublisher::stop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  woken_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void ForcePublisher::changed(const World& world, double dt) {
  const auto held = world.heldPick();
  const PushSphere& push = world.push();
  const double now = wallSeconds();
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto measure = [&](Tool& tool, bool there, std::uint32_t id, const Vec3& force) {
    // Another pick begins with its own force; without a step there is news only of what came and went.
    if (dt > 0.0 || there != tool.there || id != tool.id) tool.force.stepped(there ? force : Vec3::Zero(), dt, now);
    tool.there = there;
    tool.id = id;
  };
  measure(tools_[0], held.has_value(), held ? held->id : 0, held ? Vec3(-held->force) : Vec3::Zero());
  measure(tools_[1], push.enabled, 0, push.force);
  // The blades part the tissue without resistance.
  measure(tools_[2], world.scissors().shown, 0, Vec3::Zero());
}

bool ForcePublisher::listened() const {
  return std::any_of(tools_.begin(), tools_.end(), [](const Tool& tool) { return tool.topic.getNumSubscribers() > 0; });
}

void ForcePublisher::publish(Tool& tool, bool there, double now, const ros::Time& stamp) {
  if (tool.topic.getNumSubscribers() == 0) return;
  // A tool that is gone is heard until its force has gone too.
  if (!there && tool.force.isZero(now)) return;
  geometry_msgs::WrenchStamped message;
  message.header.stamp = stamp;
  message.header.frame_id = world_frame_;
  message.wrench.force = toVector(tool.force.at(now));
  tool.topic.publish(message);
}

void ForcePublisher::loop() {
  const auto period = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(period_));
  auto next = Clock::now();
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stopping_) {
    if (!listened()) {
      // A listener wakes it; the wait has an end because one may have come between the question and the wait.
      woken_.wait_for(lock, std::chrono::milliseconds(100));
      next = Clock::now();
      continue;
    }
    lock.unlock();
    const bool hand = inputs_.pickCursor().has_value();
    const ros::Time stamp = ros::Time::now();
    const double now = wallSeconds();
    lock.lock();
    publish(tools_[0], tools_[0].there || hand, now, stamp);
    publish(tools_[1], tools_[1].there, now, stamp);
    publish(tools_[2], tools_[2].there, now, stamp);
    next = std::max(next + period, Clock::now() - period);
    woken_.wait_until(lock, next, [this] { return stopping_; });
  }
}

}  // namespace meshless
