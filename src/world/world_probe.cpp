// What a ray meets, for cursors. It changes nothing.
#include <limits>

#include "meshless_surgery/tools/grasp.h"
#include "world_impl.h"

namespace meshless {

Result<ProbeReply> World::probe(const Vec3& origin, const Vec3& direction) {
  if (!origin.allFinite()) return notFinite("point");
  if (!direction.allFinite()) return notFinite("direction");
  if (!(direction.norm() > 0.0)) return outOfRange("the length of direction", direction.norm(), "above 0");
  ProbeReply met;
  double nearest = std::numeric_limits<double>::infinity();
  for (auto& body : impl_->bodies) {
    impl_->refreshSurface(*body);
    const std::vector<Triangle>& triangles = body->model->surface.triangles;
    const Points& surface = body->state.surface;
    const RayHit hit = castRay(surface, triangles, origin, direction);
    if (!hit.hit || !(hit.distance < nearest)) continue;
    nearest = hit.distance;
    met.body = body->name;
    met.position = hit.point;
    const Triangle& t = triangles[hit.triangle];
    met.normal = (surface[t[1]] - surface[t[0]]).cross(surface[t[2]] - surface[t[0]]).normalized();
  }
  if (met.body.empty()) return Error{ErrorCode::kMissed, "the ray meets no tissue; " + impl_->knownBodies()};
  return met;
}

}  // namespace meshless
