// What a blade separates: all across its plane, or what lies on either side of its rectangle.
#pragma once

#include <cmath>
#include <optional>

#include "meshless_surgery/geometry/surgery/incise.h"
#include "meshless_surgery/geometry/query/plane.h"

namespace meshless {

class BladeGate {
 public:
  explicit BladeGate(const Plane& plane) : plane_(plane) {}
  explicit BladeGate(const Blade& blade) : plane_(blade.plane()), blade_(blade) {}

  /// The whole plane separates.
  bool unbounded() const { return !blade_; }
  double height(const Vec3& p) const { return plane_.height(p); }
  int side(const Vec3& p) const { return height(p) >= 0.0 ? 1 : -1; }

  /// On its plane beside p there is the blade, which may reach out of the tissue there.
  bool isBehind(const Vec3& p) const {
    if (!blade_) return true;
    const Vec3 r = p - blade_->origin;
    const double along = r.dot(blade_->x_axis), up = r.dot(blade_->y_axis);
    return along >= 0.0 && along <= blade_->length && up <= 0.0 && up >= -blade_->depth;
  }

  /// The way from a to b passes through the blade. The sides stand in for points that lie on its plane; 0 is both.
  bool between(const Vec3& a, int a_side, const Vec3& b, int b_side) const {
    if (a_side == b_side || a_side == 0 || b_side == 0) return false;
    if (!blade_) return true;
    const double ha = std::abs(plane_.height(a)), hb = std::abs(plane_.height(b));
    const double t = ha + hb > 0.0 ? ha / (ha + hb) : 0.5;
    return isBehind(a + t * (b - a));
  }

 private:
  Plane plane_;
  std::optional<Blade> blade_;
};

}  // namespace meshless
