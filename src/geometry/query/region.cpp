#include "meshless_surgery/geometry/query/region.h"

#include <sstream>

namespace meshless {

namespace {

// Without the blanks that align columns.
std::string plain(const Vec3& v) {
  std::ostringstream text;
  text << v.x() << ' ' << v.y() << ' ' << v.z();
  return text.str();
}

}  // namespace

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

Region Region::within(const TriangleMesh& mesh, std::string file) {
  Region region;
  region.kind = Kind::kMesh;
  region.solid = std::make_shared<SolidQuery>(mesh);
  region.file = std::move(file);
  return region;
}

std::string Region::text() const {
  std::ostringstream text;
  switch (kind) {
    case Kind::kBox:
      text << "the box from " << plain(box.min) << " to " << plain(box.max);
      break;
    case Kind::kPlane:
      text << "what is below the plane through " << plain(plane.point) << " with the normal " << plain(plane.normal);
      break;
    case Kind::kSphere:
      text << "the sphere of radius " << radius << " about " << plain(centre);
      break;
    case Kind::kMesh:
      text << "the inside of " << file;
      break;
  }
  return text.str();
}

double Region::height(const Vec3& p) const {
  switch (kind) {
    case Kind::kPlane:
      return plane.height(p);
    case Kind::kSphere:
      return (p - centre).norm() - radius;
    case Kind::kMesh: {
      const double distance = solid->distance(p);
      return solid->contains(p) ? -distance : distance;
    }
    case Kind::kBox:
      break;
  }
  return (box.min - p).cwiseMax(p - box.max).maxCoeff();
}

}  // namespace meshless
