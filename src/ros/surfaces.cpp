#include "surfaces.h"

#include <cmath>

#include "convert.h"
#include "meshless_surgery/world/contact_pressure.h"

namespace meshless {
namespace {

meshless_surgery::Surface toSurface(const WorldSnapshot& snapshot, const BodySnapshot& body, bool strain) {
  auto message = toSurfaceOf<meshless_surgery::Surface>(body);
  message.vertices.reserve(3 * body.surface.size());
  for (const Vec3& v : body.surface)
    for (int axis = 0; axis < 3; ++axis) message.vertices.push_back(static_cast<float>(v[axis]));
  const TriangleMesh& rest = body.model->surface;
  if (strain) message.strain = surfaceStrain(rest.vertices, body.surface, rest.triangles);
  message.pressure = contactPressure(snapshot, body);
  return message;
}

}  // namespace

std::vector<float> surfaceStrain(const Points& rest, const Points& present, const std::vector<Triangle>& triangles) {
  std::vector<double> squares(rest.size(), 0.0);
  std::vector<int> counts(rest.size(), 0);
  for (const Triangle& corners : triangles)
    for (int k = 0; k < 3; ++k) {
      const Index a = corners[k];
      const Index b = corners[(k + 1) % 3];
      const double length = (rest[a] - rest[b]).norm();
      if (!(length > 0.0)) continue;
      const double stretch = (present[a] - present[b]).norm() / length - 1.0;
      for (const Index v : {a, b}) {
        squares[v] += stretch * stretch;
        ++counts[v];
      }
    }
  std::vector<float> strain(rest.size(), 0.0f);
  for (std::size_t v = 0; v < rest.size(); ++v)
    if (counts[v] > 0) strain[v] = static_cast<float>(std::sqrt(squares[v] / counts[v]));
  return strain;
}

meshless_surgery::Surfaces toSurfaces(const WorldSnapshot& snapshot, const std_msgs::Header& header, bool strain) {
  meshless_surgery::Surfaces message = toolsIn(snapshot);
  message.header = header;
  message.bodies.reserve(snapshot.bodies.size());
  for (const BodySnapshot& body : snapshot.bodies) message.bodies.push_back(toSurface(snapshot, body, strain));
  return message;
}

meshless_surgery::Surfaces toolsIn(const WorldSnapshot& snapshot) {
  meshless_surgery::Surfaces message;
  message.run = snapshot.run;
  message.picks = toPicks(snapshot);
  for (const AttachmentSnapshot& attachment : snapshot.attachments)
    for (const auto& line : attachment.lines)
      for (const Vec3& end : line) (attachment.jaws ? message.clips : message.fibres).push_back(toPoint(end));
  message.push_shown = snapshot.push.enabled;
  message.push_position = toPoint(snapshot.push.position);
  message.push_radius = snapshot.push.radius;
  message.push_touching = snapshot.push.touching;
  message.scissors_shown = snapshot.scissors.shown;
  message.scissors = toPose(poseOf(snapshot.scissors.blades));
  message.scissors_length = snapshot.scissors.blades.length;
  message.scissors_angle = snapshot.scissors.angle;
  message.scissors_width = snapshot.scissors.blades.width;
  return message;
}

}  // namespace meshless
