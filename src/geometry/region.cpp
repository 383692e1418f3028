#include "meshless_surgery/geometry/region.h"

namespace meshless {

Region Region::below(const Plane& plane) {
  Region region;
  region.kind = Kind::kPlane;
  region.plane = plane;
  return region;
}

Region Region::sphere(const Vec3& centre, double radius) {
  Region region;
  region.kind = Kind::kSphere;
  region.centre = centre;
  region.radius = radius;
  return region;
}

double Region::height(const Vec3& p) const {
  switch (kind) {
    case Kind::kPlane:
      return plane.height(p);
    case Kind::kSphere:
      return (p - centre).norm() - radius;
    case Kind::kBox:
      break;
  }
  return (box.min - p).cwiseMax(p - box.max).maxCoeff();
}

}  // namespace meshless
