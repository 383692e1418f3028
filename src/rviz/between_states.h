// Between the last two states that came: what is shown moves on with each picture, not with each message.
#pragma once

#include <meshless_surgery/Surfaces.h>

namespace meshless {

/// Where the tools of `to` are on their way from those of `from`, 0..1 of it; what is in `to` alone is there at once.
/// `between` is a copy of `to`; its bodies are left as they are.
void moveTools(const meshless_surgery::Surfaces& from, const meshless_surgery::Surfaces& to, float share,
               meshless_surgery::Surfaces& between);

/// Of two states that follow each other: what is shown of one when the other comes, and how far it has gone from there.
class Pace {
 public:
  /// A new state; `interval` [s] after the one before, by their stamps. False: it is to be shown at once, as it is too
  /// long after it, or not after it.
  bool next(double interval);
  /// 0..1: how far a picture is that is shown `seconds` after the last one.
  float go(double seconds);
  bool moving() const { return passed_ < interval_; }

 private:
  double interval_ = 0.0, passed_ = 0.0;  // [s]
};

}  // namespace meshless
