#include "force_publisher.h"

#include <algorithm>
#include <chrono>

#include <geometry_msgs/WrenchStamped.h>

#include "convert.h"

namespace meshless {

ForcePublisher::ForcePublisher(const ros::NodeHandle& private_handle, const NodeSettings& settings, const Clock& clock,
                               const StreamedTools& tools)
    : settings_(settings), clock_(clock), tools_(tools), stream_(1.0 / settings.force_rate) {
  ros::NodeHandle handle(private_handle);
  const auto wake = [this](const ros::SingleSubscriberPublisher&) {
    const std::lock_guard<std::mutex> lock(mutex_);
    woken_.notify_all();
  };
  const char* names[] = {"pick", "push", "scissors"};
  for (std::size_t t = 0; t < topics_.size(); ++t)
    topics_[t] = handle.advertise<geometry_msgs::WrenchStamped>(std::string(names[t]) + "/measured_cf", 100, wake);
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
  const auto steps = forceSteps(world, settings_);
  const std::lock_guard<std::mutex> lock(mutex_);
  stream_.stepped(steps, dt, clock_.now());
}

bool ForcePublisher::listened() const {
  return std::any_of(topics_.begin(), topics_.end(),
                     [](const ros::Publisher& topic) { return topic.getNumSubscribers() > 0; });
}

void ForcePublisher::loop() {
  const auto place = [this](ToolKind tool) -> std::optional<Vec3> {
    const auto hand = tools_.hand(tool);
    return hand ? std::optional<Vec3>(hand->translation) : std::nullopt;
  };
  geometry_msgs::WrenchStamped message;
  message.header.frame_id = settings_.world_frame;
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stopping_) {
    if (!listened()) {
      // A listener wakes it; the wait has an end because one may have come between the question and the wait.
      woken_.wait_for(lock, std::chrono::milliseconds(100));
      stream_.begin(clock_.now());
      continue;
    }
    // No resistance for the scissors: where they are wanted does not matter.
    const PerTool<std::optional<Vec3>> hands{place(ToolKind::kPick), place(ToolKind::kPush), std::nullopt};
    const auto tick = stream_.next(clock_.now(), hands);
    if (!tick) {
      woken_.wait_for(lock, std::chrono::duration<double>(clock_.wallUntil(stream_.due())),
                      [this] { return stopping_; });
      continue;
    }
    lock.unlock();
    message.header.stamp = clock_.stampOf(tick->time);
    for (std::size_t t = 0; t < topics_.size(); ++t) {
      if (!tick->forces[t] || topics_[t].getNumSubscribers() == 0) continue;
      message.wrench.force = toVector(*tick->forces[t]);
      topics_[t].publish(message);
    }
    lock.lock();
  }
}

}  // namespace meshless
