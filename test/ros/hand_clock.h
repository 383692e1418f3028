// Clocks for tests.
#pragma once

#include <atomic>

#include "ros/clock.h"

namespace meshless {

/// Stands still until it is set. [s]
struct HandClock {
  std::atomic<double> time{100.0};
  const Clock clock{[this] { return ros::Time(time); }, true};
};

inline const Clock& wallClock() {
  static const Clock clock{[] {
                             const ros::WallTime now = ros::WallTime::now();
                             return ros::Time(now.sec, now.nsec);
                           },
                           false};
  return clock;
}

}  // namespace meshless
