// Hands, the node's tools, a world and the forces, in a time that the test makes: what streams, timers and threads do
// in the node is done here in turn, and nothing is left to the wall.
#pragma once

#include <deque>
#include <vector>

#include "ros/force_stream.h"
#include "ros/streamed_tools.h"
#include "ros/hand_clock.h"
#include "ros/scene_support.h"

namespace meshless {

inline Pose poseAt(const Vec3& place) {
  Pose pose;
  pose.translation = place;
  return pose;
}

class ToolBench {
 public:
  static constexpr double kQuantum = 0.0005;  // [s]
  static constexpr double kStream = 0.005;    // [s]
  static constexpr double kLook = 0.005;      // [s]
  static constexpr double kTick = 0.002;      // [s]
  static constexpr double kMaxBacklog = 0.1;  // [s]
  static constexpr std::size_t kQueue = 10;   // messages

  explicit ToolBench(const NodeSettings& wanted = {}, double step_rate = 120.0)
      : settings(wanted), world(twoBoxes(step_rate)), dt_(1.0 / step_rate) {}

  /// What a stream says at a time; nothing: it is silent.
  using Hand = std::function<std::optional<Pose>(double)>;
  PerTool<Hand> hands;
  /// The stamp of what is said at a time.
  std::function<double(double)> stamp = [](double time) { return 100.0 + time; };
  /// The whole node stands still: what streams say meanwhile waits in their queues.
  std::function<bool(double)> stands_still = [](double) { return false; };
  /// Those alone who say the forces.
  std::function<bool(double)> forces_stand_still = [](double) { return false; };

  const NodeSettings settings;
  HandClock hand_clock;
  std::unique_ptr<World> world;
  StreamedTools tools{settings, hand_clock.clock,
                      [this](const std::function<void(World&)>& job) {
                        job(*world);
                        forces_.stepped(forceSteps(*world, settings), 0.0, now());
                      },
                      [this](const Error& error) { refused.push_back(error.detail); }};

  // What was seen.
  std::vector<ForceStream::Tick> ticks;
  std::vector<Event> events;
  std::vector<std::string> refused, warned;                // of the streams' messages
  std::function<void(double)> after_each = [](double) {};  // quantum

  double now() const { return hand_clock.clock.now(); }

  void run(double seconds) {
    const double begin = now();
    for (int i = 1; i <= static_cast<int>(std::round(seconds / kQuantum)); ++i) turn(begin + i * kQuantum);
  }

  std::vector<Event> said(EventType type) const {
    std::vector<Event> some;
    for (const Event& event : events)
      if (event.type == type) some.push_back(event);
    return some;
  }
  PickReply pick() {
    PickCommand command;
    command.point = Vec3(-0.05, 0, 0);
    command.max_distance = 0.1;
    const auto reply = world->apply(command);
    if (!reply.ok()) {
      ADD_FAILURE() << reply.error().detail;
      return {};
    }
    return std::get<PickReply>(*reply);
  }

 private:
  struct Message {
    Pose pose;
    double stamp;
  };

  void turn(double time) {
    hand_clock.time = 100.0 + time;
    if (isDue(said_, kStream, time)) {
      for (std::size_t t = 0; t < hands.size(); ++t) {
        const auto pose = hands[t] ? hands[t](time) : std::nullopt;
        if (pose) queues_[t].push_back({*pose, stamp(time)});
        if (queues_[t].size() > kQueue) queues_[t].pop_front();
      }
    }
    if (stands_still(time)) return;
    for (std::size_t t = 0; t < hands.size(); ++t) {
      for (; !queues_[t].empty(); queues_[t].pop_front()) {
        const Message& message = queues_[t].front();
        const auto heard = tools.hear(static_cast<ToolKind>(t), message.pose, message.stamp);
        if (!heard.ok()) refused.push_back(heard.error().detail);
        if (heard.ok() && !heard->empty()) warned.push_back(*heard);
      }
    }
    if (isDue(looked_, kLook, time)) tools.look();
    for (; stepped_ + dt_ <= time + 0.5 * kQuantum; stepped_ = std::max(stepped_ + dt_, time - kMaxBacklog)) {
      world->step();
      forces_.stepped(forceSteps(*world, settings), dt_, now());
    }
    for (Event& event : world->takeEvents()) events.push_back(std::move(event));
    const auto place = [this](ToolKind tool) -> std::optional<Vec3> {
      const auto hand = tools.hand(tool);
      return hand ? std::optional<Vec3>(hand->translation) : std::nullopt;
    };
    while (!forces_stand_still(time)) {
      auto tick = forces_.next(now(), {place(ToolKind::kPick), place(ToolKind::kPush), std::nullopt});
      if (!tick) break;
      ticks.push_back(std::move(*tick));
    }
    after_each(time);
  }
  static bool isDue(double& last, double period, double time) {
    if (last + period > time + 0.5 * kQuantum) return false;
    last = time;
    return true;
  }

  const double dt_;  // [s]
  PerTool<std::deque<Message>> queues_;
  double said_ = 0.0, looked_ = 0.0, stepped_ = 0.0;
  ForceStream forces_{kTick};
};

}  // namespace meshless
