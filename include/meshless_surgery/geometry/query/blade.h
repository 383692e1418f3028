// What cuts: a plane, bounded or not.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "meshless_surgery/geometry/query/plane.h"

namespace meshless {

/// The part of a plane origin + s * x_axis + t * y_axis with -behind <= s <= length, -depth <= t <= rise. A scalpel has
/// a length and a depth; a pair of scissors also a rise, and a plane has no bounds.
struct Blade {
  Vec3 origin = Vec3::Zero();   // [m]
  Vec3 x_axis = Vec3::UnitX();  // unit; of a scalpel: along the edge that stays outside
  Vec3 y_axis = Vec3::UnitY();  // unit, normal to x_axis; of a scalpel: out of the tissue
  double length = 0.0;          // [m] > 0
  double depth = 0.0;           // [m] > 0
  double rise = 0.0;            // [m] >= 0
  double behind = 0.0;          // [m] >= 0

  static constexpr double kUnbounded = std::numeric_limits<double>::infinity();

  /// The whole plane.
  static Blade through(const Plane& plane) {
    const Vec3 x_axis = plane.normal.unitOrthogonal();
    return {plane.point, x_axis, plane.normal.cross(x_axis), kUnbounded, kUnbounded, kUnbounded, kUnbounded};
  }

  Plane plane() const { return {x_axis.cross(y_axis), origin}; }
  bool bounded() const { return !(std::min({length, depth, rise, behind}) == kUnbounded); }
  double height(const Vec3& p) const { return x_axis.cross(y_axis).dot(p - origin); }

  /// Beside p, on the plane, there is the blade. It may reach out of the tissue there.
  bool isBeside(const Vec3& p) const {
    const double along = x_axis.dot(p - origin), up = y_axis.dot(p - origin);
    return along >= -behind && along <= length && up >= -depth && up <= rise;
  }

  /// The way from a to b goes through the blade. The sides (+1, -1) stand in for points that lie on its plane; 0 is
  /// both.
  bool passes(const Vec3& a, int a_side, const Vec3& b, int b_side) const {
    if (a_side == b_side || a_side == 0 || b_side == 0) return false;
    if (!bounded()) return true;
    const double of_a = std::abs(height(a)), of_b = std::abs(height(b));
    return isBeside(a + (of_a + of_b > 0.0 ? of_a / (of_a + of_b) : 0.5) * (b - a));
  }
  /// The same where what lies on the plane is above it.
  bool passes(const Vec3& a, const Vec3& b) const {
    return passes(a, height(a) >= 0.0 ? 1 : -1, b, height(b) >= 0.0 ? 1 : -1);
  }
};

}  // namespace meshless
