#include "meshless_surgery/contact/sphere_and_ground.h"

#include <algorithm>

namespace meshless {

Projection projectOutOfGround(const Vec3& p, double height) {
  Projection projection;
  projection.inside = p.z() < height;  // false for NaN
  if (projection.inside) projection.depth = height - p.z();
  return projection;
}

Projection projectOutOfSphere(const Vec3& p, const Vec3& centre, double radius, const Vec3& fallback) {
  Projection projection;
  const Vec3 outwards = p - centre;
  const double distance = outwards.stableNorm();
  projection.inside = distance < radius;  // false for NaN
  if (!projection.inside) return projection;
  projection.depth = radius - distance;
  // So near to the centre that the difference is rounding, no direction is meant.
  projection.normal = distance > 1e-12 * radius ? Vec3(outwards / distance) : fallback;
  return projection;
}

Vec3 frictionCorrection(const Vec3& motion, const Vec3& normal, double depth, double friction) {
  const Vec3 tangential = motion - normal.dot(motion) * normal;
  const double length = tangential.norm();
  const double cone = friction * depth;
  if (!(length > 0.0) || !(cone > 0.0)) return Vec3::Zero();
  return -std::min(1.0, cone / length) * tangential;
}

}  // namespace meshless
