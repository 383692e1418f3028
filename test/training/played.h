// A world whose session is recorded and watched: what a running node does.
#pragma once

#include <cstring>
#include <sstream>

#include "meshless_surgery/training/training.h"
#include "meshless_surgery/world/command_log.h"
#include "support/bodies.h"

namespace meshless::test {

class Played {
 public:
  Played(WorldSettings settings, TaskDef task) : world(std::move(settings)), training(std::move(task)) {}

  void begin() {
    world.record([this](std::string bytes) { log += bytes; });
    (void)world.takeEvents();
  }
  void step(int count = 1) {
    for (int k = 0; k < count; ++k) {
      world.step();
      const Status fed = training.feed(frameOf(world, world.takeEvents(), training.wants()));
      EXPECT_TRUE(fed.ok()) << (fed.ok() ? "" : fed.error().detail);
      const WorldSnapshot shot = world.snapshot({});
      for (const Pick& pick : shot.picks) most_force = std::max(most_force, pick.force.norm());
    }
  }
  template <class T>
  T apply(const Command& command) {
    return replyOf<T>(world.apply(command));
  }
  double value(const std::string& name) const {
    for (const MetricValue& metric : training.values())
      if (metric.name == name) return metric.value;
    ADD_FAILURE() << "no metric " << name;
    return 0.0;
  }
  /// The same task, watched in a replay of the log.
  std::unique_ptr<Training> replayed() {
    world.record({});
    auto again = std::make_unique<Training>(training.task());
    std::istringstream stream(log);
    const auto report = replay(stream, 1, [&](World& other) {
      EXPECT_TRUE(again->feed(frameOf(other, other.takeEvents(), again->wants())).ok());
    });
    EXPECT_TRUE(report.ok()) << (report.ok() ? "" : report.error().detail);
    EXPECT_TRUE(report.ok() && !report->difference);
    if (training.over()) again->stop();
    return again;
  }

  World world;
  Training training;
  std::string log;
  double most_force = 0.0;  // [N] that the world said
};

inline bool sameBits(double a, double b) { return std::memcmp(&a, &b, sizeof a) == 0; }

inline void expectSame(const Training& live, const Training& replayed) {
  const std::vector<MetricValue> a = live.values(), b = replayed.values();
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t k = 0; k < a.size(); ++k)
    EXPECT_TRUE(sameBits(a[k].value, b[k].value)) << a[k].name << ": " << a[k].value << " live, " << b[k].value;
  EXPECT_EQ(live.progress().times(), replayed.progress().times());
  EXPECT_EQ(live.progress().failed(), replayed.progress().failed());
  EXPECT_EQ(live.events().size(), replayed.events().size());
  EXPECT_TRUE(sameBits(live.score(), replayed.score()));
}

/// Met by nothing that these tests do: all goes on.
inline TaskDef openTask() {
  TaskDef task;
  task.name = "open";
  task.stages.push_back({"far away", "", Reach{ToolKind::kPick, Region::sphere(Vec3(99, 99, 99), 0.1)}, 0.0});
  return task;
}

}  // namespace meshless::test
