// The one time of the node: steps, tools and forces go by it.
#pragma once

#include <functional>
#include <mutex>

#include <ros/time.h>

namespace meshless {

/// Seconds since the source first told a time. Never goes back: where the source was set back, time goes on from where
/// it was. One source may stand still (/clock), another one only runs (the system's clock).
class Clock {
 public:
  using Source = std::function<ros::Time()>;

  /// ros::Time: /clock with /use_sim_time, else the system's.
  Clock();
  /// `may_stand` says that waiting on the wall does not bring the source on.
  Clock(Source source, bool may_stand);
  /// The wall's, which nobody sets: for a node that makes /clock itself, and would wait for itself by it.
  static Clock steady();

  double now() const;
  /// What the source calls that time [s].
  ros::Time stampOf(double time) const;
  /// How long to wait on the wall until one should look whether `due` [s] has come; 0 where it has. [s]
  double wallUntil(double due) const;

 private:
  const Source source_;
  const bool may_stand_;
  mutable std::mutex mutex_;
  mutable ros::Time said_;        // by the source, when it was asked last
  mutable double elapsed_ = 0.0;  // [s]
};

}  // namespace meshless
