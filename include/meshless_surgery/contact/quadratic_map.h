// The quadratic map of a cluster between rest shape and present, for bodies that bend within a cluster.
#pragma once

#include "meshless_surgery/base/types.h"

namespace meshless {

/// present = fit (b(q) - mean) + centre, with q = (r - rest) / scale and b = (x y z xx yy zz xy yz zx).
struct QuadraticMap {
  using Basis = Eigen::Matrix<double, 9, 1>;

  Eigen::Matrix<double, 3, 9> fit = Eigen::Matrix<double, 3, 9>::Zero();  // [m]
  Basis mean = Basis::Zero();
  Vec3 rest = Vec3::Zero();    // [m]
  Vec3 centre = Vec3::Zero();  // [m]
  double scale = 1.0;          // [m]

  static Basis basis(const Vec3& q);
  Vec3 at(const Vec3& r) const;
  /// How the present place changes with the one at rest.
  Mat3 slope(const Vec3& r) const;
  /// Where `present` is in the rest shape: Newton's method from `r`, which the place found replaces; to_rest is the
  /// inverse of the slope there. False, with r as it was, where it does not come to a place in a few steps, or only
  /// beyond `most` [m] from r.
  bool invert(const Vec3& present, double most, Vec3& r, Mat3& to_rest) const;
};

}  // namespace meshless
