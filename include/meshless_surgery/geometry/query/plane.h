// An oriented plane.
#pragma once

#include "meshless_surgery/base/types.h"

namespace meshless {

struct Plane {
  Vec3 normal = Vec3::UnitZ();  // unit length
  Vec3 point = Vec3::Zero();    // [m] any point of the plane

  /// Signed distance [m], positive on the side of the normal.
  double height(const Vec3& p) const { return normal.dot(p - point); }
};

}  // namespace meshless
