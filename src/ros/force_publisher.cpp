#include "meshless_surgery/ros/force_publisher.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include <geometry_msgs/WrenchStamped.h>

#include "meshless_surgery/ros/convert.h"

namespace meshless {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kMostLate = 0.05;        // [s] that is caught up with
constexpr double kHole = 2.0;             // ticks without a word are a hole ...
constexpr double kLateStep = 3.0;         // ... and so many steps without one
constexpr double kClockSet = 0.1;         // [s] that ROS's clock is elsewhere at once
constexpr double kStiffestPush = 5000.0;  // [N/m] of tissue under the sphere

double wallSeconds() { return std::chrono::duration<double>(Clock::now().time_since_epoch()).count(); }

}  // namespace

ForcePublisher::ForcePublisher(const ros::NodeHandle& private_handle, const NodeSettings& settings,
                               const ToolInputs& inputs)
    : world_frame_(settings.world_frame),
      period_(1.0 / settings.force_rate),
      pick_max_speed_(settings.pick_max_speed),
      push_max_speed_(settings.push_max_speed),
      inputs_(inputs) {
  ros::NodeHandle handle(private_handle);
  const auto wake = [this](const ros::SingleSubscriberPublisher&) {
    const std::lock_guard<std::mutex> lock(mutex_);
    woken_.notify_all();
  };
  const char* names[] = {"pick", "push", "scissors"};
  for (std::size_t t = 0; t < tools_.size(); ++t)
    tools_[t].topic = handle.advertise<geometry_msgs::WrenchStamped>(std::string(names[t]) + "/measured_cf", 100, wake);
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
  ForceModel::Step pick;
  pick.pulls = true;
  if (const auto held = world.heldPick()) {
    pick.there = true;
    pick.id = held->id;
    pick.force = -held->force;
    pick.place = held->target;
    pick.stiffest = world.heldStiffness();
    pick.speed = pick_max_speed_;
  }
  ForceModel::Step push;
  push.there = world.push().enabled;
  push.force = world.push().force;
  push.place = world.push().position;
  push.stiffest = kStiffestPush;
  push.speed = world.push().streamed ? push_max_speed_ : 0.0;
  // The blades part the tissue without resistance.
  ForceModel::Step scissors;
  scissors.there = world.scissors().shown;
  const ForceModel::Step steps[] = {pick, push, scissors};
  const double now = wallSeconds();
  const std::lock_guard<std::mutex> lock(mutex_);
  if (dt > 0.0) {
    if (now - stepped_at_ > kLateStep * dt) bridge(now, now - stepped_at_);
    stepped_at_ = now;
  }
  for (std::size_t t = 0; t < tools_.size(); ++t) {
    tools_[t].there = steps[t].there;
    tools_[t].force.stepped(steps[t], dt, now);
  }
}

void ForcePublisher::bridge(double from, double length) {
  for (Tool& tool : tools_) tool.bridge.open(from, std::min(length, kMostLate));
}

bool ForcePublisher::listened() const {
  return std::any_of(tools_.begin(), tools_.end(), [](const Tool& tool) { return tool.topic.getNumSubscribers() > 0; });
}

void ForcePublisher::publish(Tool& tool, const std::optional<Pose>& hand, double now, const ros::Time& stamp) {
  if (tool.topic.getNumSubscribers() == 0) return;
  // A tool that is gone is heard until its force has gone too.
  if (!tool.there && !hand && tool.force.isZero(now) && !tool.bridge.isOpen(now)) return;
  geometry_msgs::WrenchStamped message;
  message.header.stamp = stamp;
  message.header.frame_id = world_frame_;
  const Vec3 force = tool.force.at(now, hand ? std::optional<Vec3>(hand->translation) : std::nullopt);
  message.wrench.force = toVector(tool.bridge.across(now, force));
  tool.topic.publish(message);
}

void ForcePublisher::loop() {
  double next = wallSeconds(), woke = next;
  double offset = -std::numeric_limits<double>::infinity();  // [s] of ROS's clock before ours
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stopping_) {
    if (!listened()) {
      // A listener wakes it; the wait has an end because one may have come between the question and the wait.
      woken_.wait_for(lock, std::chrono::milliseconds(100));
      next = woke = wallSeconds();
      continue;
    }
    lock.unlock();
    const std::optional<Pose> pick = inputs_.hand(ToolKind::kPick);
    const std::optional<Pose> push = inputs_.hand(ToolKind::kPush);
    ros::Time stamp = ros::Time::now();
    const double now = wallSeconds();
    // Who is woken late says what is due, each tick with its own time: an even rate, and a sum without holes.
    next = std::max(next, now - kMostLate);
    const double slept = now - woke;
    woke = now;
    // A simulated clock is read as it is. Between two looks at two clocks time may pass: it counts where least did, so
    // that stamps are even and never go back, unless the clock was set.
    if (!ros::Time::isSimTime()) {
      const double looked = stamp.toSec() - now;
      offset = std::abs(looked - offset) < kClockSet ? std::max(offset, looked) : looked;
      stamp.fromSec(next + offset);
    }
    lock.lock();
    if (slept > kHole * period_) bridge(next, slept);
    publish(tools_[0], pick, next, stamp);
    publish(tools_[1], push, next, stamp);
    publish(tools_[2], std::nullopt, next, stamp);
    next += period_;
    const auto due =
        Clock::time_point(std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(next)));
    woken_.wait_until(lock, due, [this] { return stopping_; });
  }
}

}  // namespace meshless
