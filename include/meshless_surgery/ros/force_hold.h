// The force on a tool between the steps that measure it. Times are of a clock that the caller reads [s].
#pragma once

#include <algorithm>

#include "meshless_surgery/base/types.h"

namespace meshless {

/// Goes from the force of one step to that of the next in a straight line while the next step's time passes:
/// continuous, with the same integral over a touch, and exactly zero once a step has measured none.
class ForceHold {
 public:
  /// `dt` [s] is what the step simulates; `now` when it was done.
  void stepped(const Vec3& force, double dt, double now) {
    from_ = at(now);
    to_ = force;
    begun_ = now;
    dt_ = dt;
  }
  Vec3 at(double now) const {
    if (!(now - begun_ < dt_)) return to_;
    return from_ + std::max(0.0, (now - begun_) / dt_) * (to_ - from_);
  }
  bool isZero(double now) const { return at(now).isZero(0.0) && to_.isZero(0.0); }

 private:
  Vec3 from_ = Vec3::Zero(), to_ = Vec3::Zero();  // [N]
  double begun_ = 0.0, dt_ = 0.0;
};

}  // namespace meshless
