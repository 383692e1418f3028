// Boxes in float, one by one and four side by side, for searches that compare many of them.
#pragma once

#include <array>
#include <limits>

#include "meshless_surgery/base/types.h"

namespace meshless {

/// In float, rounded outwards. Empty while min > max; overlaps nothing then.
struct FloatBox {
  using Four = float __attribute__((vector_size(16)));  // the last is 0
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Four min{kInfinity, kInfinity, kInfinity, 0.0f}, max{-kInfinity, -kInfinity, -kInfinity, 0.0f};

  static Four lesser(const Four& x, const Four& y) { return x < y ? x : y; }
  static Four greater(const Four& x, const Four& y) { return x > y ? x : y; }
  void extend(const Vec3& p) {
    const Four near{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2]), 0.0f};
    const Four rounding = std::numeric_limits<float>::epsilon() * greater(near, -near);
    min = lesser(near - rounding, min);
    max = greater(near + rounding, max);
  }
  void extend(const FloatBox& o) {
    min = lesser(o.min, min);
    max = greater(o.max, max);
  }
};

/// Four boxes side by side: one comparison for all of them, without branches, since which axis parts two boxes cannot
/// be foretold.
struct FourBoxes {
  using Four = FloatBox::Four;
  using Mask = int __attribute__((vector_size(16)));
  std::array<Four, 3> min, max;  // [axis], one a box

  void put(int k, const FloatBox& box) {
    for (int axis = 0; axis < 3; ++axis) {
      min[axis][k] = box.min[axis];
      max[axis][k] = box.max[axis];
    }
  }
  FloatBox box(int k) const {
    FloatBox box;
    box.min = Four{min[0][k], min[1][k], min[2][k], 0.0f};
    box.max = Four{max[0][k], max[1][k], max[2][k], 0.0f};
    return box;
  }
  /// Bit k: the box k overlaps another or is nearer than `by` [m] along each axis.
  unsigned overlapping(const FloatBox& o, float by = 0.0f) const {
    Mask all{-1, -1, -1, -1};
    for (int axis = 0; axis < 3; ++axis) all &= (min[axis] - by <= o.max[axis]) & (o.min[axis] - by <= max[axis]);
    return bitsOf(all);
  }
  /// Bit k: a point in the box k and one in the other have a dot product below `limit`.
  unsigned dotBelow(const FloatBox& o, float limit) const {
    Four sum{};
    for (int axis = 0; axis < 3; ++axis)
      sum += FloatBox::lesser(FloatBox::lesser(min[axis] * o.min[axis], min[axis] * o.max[axis]),
                              FloatBox::lesser(max[axis] * o.min[axis], max[axis] * o.max[axis]));
    return bitsOf(sum < limit);
  }

 private:
  static unsigned bitsOf(const Mask& mask) {
    const Mask bits = mask & Mask{1, 2, 4, 8};
    return static_cast<unsigned>((bits[0] | bits[1]) | (bits[2] | bits[3]));
  }
};

}  // namespace meshless
