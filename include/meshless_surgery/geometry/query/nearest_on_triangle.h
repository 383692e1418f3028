// The point of a triangle that is nearest to another point.
#pragma once

#include "meshless_surgery/base/types.h"

namespace meshless {

/// Barycentric weights (each 0..1, sum 1) of the point of triangle a b c nearest to p. A triangle without area is
/// treated as its longest part or its first corner. Ericson 2005, Real-Time Collision Detection, sec. 5.1.5.
Vec3 nearestWeights(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c);

inline Vec3 nearestOnTriangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 w = nearestWeights(p, a, b, c);
  return a + w.y() * (b - a) + w.z() * (c - a);
}

}  // namespace meshless
