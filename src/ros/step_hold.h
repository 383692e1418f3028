// A value that steps measure, between the steps. Times are of a clock that the caller reads [s].
#pragma once

namespace meshless {

/// Goes from the value of one step to that of the next in a straight line while the next step's time passes:
/// continuous, with the same integral, and exactly the last value from then on.
template <class Value>
class StepHold {
 public:
  explicit StepHold(const Value& value) : from_(value), to_(value) {}

  /// `dt` [s] is what the step simulates, and the time that the way takes; `now` when it was done.
  void stepped(const Value& value, double dt, double now) {
    from_ = at(now);
    to_ = value;
    begun_ = now;
    dt_ = dt;
  }
  /// At once, for what has nothing to do with the value before.
  void set(const Value& value) {
    from_ = to_ = value;
    dt_ = 0.0;
  }
  Value at(double now) const {
    if (!(now - begun_ < kWhole * dt_)) return to_;
    const double share = now > begun_ ? (now - begun_) / dt_ : 0.0;
    return from_ + share * (to_ - from_);
  }
  const Value& last() const { return to_; }

 private:
  static constexpr double kWhole = 1.0 - 1e-9;  // times are rounded

  Value from_, to_;
  double begun_ = 0.0, dt_ = 0.0;
};

}  // namespace meshless
