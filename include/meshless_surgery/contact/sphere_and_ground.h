// Projections onto the outside of a plane and of a sphere.
#pragma once

#include "meshless_surgery/base/types.h"

namespace meshless {

/// Where a point must go to be outside, and along which direction.
struct Projection {
  bool inside = false;
  double depth = 0.0;             // [m]
  Vec3 normal = Vec3::UnitZ();    // unit, outwards
};

Projection projectOutOfGround(const Vec3& p, double height);
/// The centre of the sphere itself is pushed along `fallback` (unit).
Projection projectOutOfSphere(const Vec3& p, const Vec3& centre, double radius, const Vec3& fallback);

/// Shortens the tangential part of `motion` [m] by at most friction * depth: Coulomb's cone for positions.
Vec3 frictionCorrection(const Vec3& motion, const Vec3& normal, double depth, double friction);

}  // namespace meshless
