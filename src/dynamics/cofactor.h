// The gradient of a determinant. Private to dynamics.
#pragma once

#include "meshless_surgery/base/types.h"

namespace meshless {

inline Mat3 cofactor(const Mat3& f) {
  Mat3 c;
  c.col(0) = f.col(1).cross(f.col(2));
  c.col(1) = f.col(2).cross(f.col(0));
  c.col(2) = f.col(0).cross(f.col(1));
  return c;
}

}  // namespace meshless
