// The forces on the tools at an even rate of their own, whatever the step rate. No ROS in here: times are of a clock
// that the caller reads [s], and never go back.
#pragma once

#include <array>
#include <optional>

#include "force_model.h"
#include "hole_bridge.h"
#include "settings.h"
#include "meshless_surgery/world/world.h"

namespace meshless {

/// One of each tool: pick, push, scissors, as in ToolKind.
template <class Value>
using PerTool = std::array<Value, 3>;

/// What a world says of the forces after a step.
PerTool<ForceModel::Step> forceSteps(const World& world, const NodeSettings& settings);

class ForceStream {
 public:
  static constexpr double kMostLate = 0.05;  // [s] of ticks that are made up for

  explicit ForceStream(double period) : period_(period) {}

  /// `dt` [s] is what the step simulated; 0 where the world changed without one.
  void stepped(const PerTool<ForceModel::Step>& steps, double dt, double now);

  /// Ticks begin now.
  void begin(double now) { next_ = now; }
  /// When the next tick is due.
  double due() const { return next_; }
  struct Tick {
    double time = 0.0;
    PerTool<std::optional<Vec3>> forces;  // [N] on each tool; nothing where it is not there
  };
  /// Nothing before it is due. Who comes late gets one tick after the other, each with its own time, of the last
  /// kMostLate. `hands`: where their streams want the tools [m].
  std::optional<Tick> next(double now, const PerTool<std::optional<Vec3>>& hands);

 private:
  struct Tool {
    bool there = false;
    ForceModel force;
    HoleBridge<Vec3> bridge{Vec3::Zero()};
  };
  void bridge(double from, double length);

  const double period_;  // [s]
  PerTool<Tool> tools_;
  double next_ = 0.0, stepped_at_ = 0.0;
};

}  // namespace meshless
