#include "meshless_surgery/world/contact_pressure.h"

#include <algorithm>
#include <limits>

namespace meshless {
namespace {

std::vector<double> areasAround(const Points& vertices, const std::vector<Triangle>& triangles) {
  std::vector<double> areas(vertices.size(), 0.0);
  for (const Triangle& t : triangles) {
    const double third = (vertices[t[1]] - vertices[t[0]]).cross(vertices[t[2]] - vertices[t[0]]).norm() / 6.0;
    for (const Index v : t) areas[v] += third;
  }
  return areas;
}

/// Of those with an area around them.
Index nearestTo(const Vec3& at, const Points& vertices, const std::vector<double>& areas) {
  Index nearest = 0;
  double least = std::numeric_limits<double>::infinity();
  for (Index v = 0; v < vertices.size(); ++v) {
    const double far = (vertices[v] - at).squaredNorm();
    if (!(areas[v] > 0.0) || !(far < least)) continue;
    least = far;
    nearest = v;
  }
  return nearest;
}

}  // namespace

std::vector<float> contactPressure(const WorldSnapshot& snapshot, const BodySnapshot& body) {
  const auto byHand = [&](const ContactPoint& point) {
    return point.body == body.name && point.pressed() > 0.0 &&
           (point.other == kPushName ||
            std::any_of(snapshot.instruments.begin(), snapshot.instruments.end(),
                        [&](const Instrument& instrument) { return instrument.def.name == point.other; }));
  };
  std::vector<const ContactPoint*> points;
  Box box;
  for (const ContactPoint& point : snapshot.contacts) {
    if (!byHand(point)) continue;
    points.push_back(&point);
    box.extend(point.position);
  }
  if (points.empty() || body.surface.empty()) return {};
  const double reach = body.model->spacing;
  box.min -= Vec3::Constant(reach);
  box.max += Vec3::Constant(reach);
  const std::vector<double> areas = areasAround(body.surface, body.model->surface.triangles);
  std::vector<Index> near;
  for (Index v = 0; v < body.surface.size(); ++v)
    if (areas[v] > 0.0 && box.contains(body.surface[v])) near.push_back(v);
  std::vector<float> pressure(body.surface.size(), 0.0f);
  std::vector<double> shares(near.size());
  for (const ContactPoint* point : points) {
    double sum = 0.0;  // [m^2]
    for (std::size_t n = 0; n < near.size(); ++n) {
      shares[n] = std::max(0.0, 1.0 - (body.surface[near[n]] - point->position).norm() / reach);
      sum += shares[n] * areas[near[n]];
    }
    if (!(sum > 0.0)) {  // the surface is coarser than the tissue
      const Index nearest = nearestTo(point->position, body.surface, areas);
      pressure[nearest] += static_cast<float>(point->pressed() / areas[nearest]);
      continue;
    }
    for (std::size_t n = 0; n < near.size(); ++n)
      pressure[near[n]] += static_cast<float>(point->pressed() * shares[n] / sum);
  }
  return pressure;
}

}  // namespace meshless
