// How what holds a body is moved from where the body was put.
#pragma once

#include "meshless_surgery/base/types.h"

namespace meshless {

/// Of one entry of `fixed`: turned about its middle, and shifted, evenly until it is there.
struct HeldMotion {
  Vec3 middle = Vec3::Zero();  // [m] of what it holds, where the body was put
  Pose now, target;            // the shift of the middle [m], and the turn about it
  double left = 0.0;           // [s] until it is there

  /// Where it has what was put there.
  Vec3 operator()(const Vec3& place) const { return middle + now.translation + now.rotation * (place - middle); }
  void advance(double h);
};

}  // namespace meshless
