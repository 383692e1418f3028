// A value that is said at every tick of a clock, where ticks were missed. Times are of a clock that the caller reads
// [s].
#pragma once

#include <algorithm>

namespace meshless {

/// Whoever stood still for many ticks has a value from before and one from after, and the force would jump within one
/// tick. Across the hole, and as long as that lasted, the value goes over in a straight line from what was said last;
/// from then on, and without holes, it is exactly what it is. Between two values of one sign it keeps that sign.
template <class Value>
class HoleBridge {
 public:
  explicit HoleBridge(const Value& value) : held_(value), said_(value) {}

  /// From the tick at `from` on, for `length` [s], or as long as the one before lasts. One that is to begin later
  /// stays: until then nothing new is said.
  void open(double from, double length) {
    if (length_ > 0.0 && from < from_) return;
    held_ = said_;
    length_ = std::max(length, from_ + length_ - from);
    from_ = from;
  }
  /// What is said at `now`, where the value is `value`.
  Value across(double now, const Value& value) {
    if (isOpen(now)) {
      const double share = now > from_ ? (now - from_) / length_ : 0.0;
      said_ = held_ + share * (value - held_);
    } else {
      said_ = value;
    }
    return said_;
  }
  bool isOpen(double now) const { return now - from_ < length_; }

 private:
  Value held_, said_;
  double from_ = 0.0, length_ = 0.0;
};

}  // namespace meshless
