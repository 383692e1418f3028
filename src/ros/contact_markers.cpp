#include "contact_markers.h"

#include <algorithm>

#include "convert.h"
#include "marker.h"

namespace meshless {
namespace {

using visualization_msgs::Marker;

constexpr double kPoint = 0.25;      // diameter in particle spacings
constexpr double kForceLine = 0.06;  // width in particle spacings

Marker markerOf(const std_msgs::Header& header, const std::string& ns, int type, double size) {
  Marker marker = newMarker(header, ns, 0, type);
  marker.scale.x = marker.scale.y = marker.scale.z = size;
  marker.color = toColor({1.0f, 0.75f, 0.1f, 1.0f});
  return marker;
}

}  // namespace

visualization_msgs::MarkerArray contactMarkers(const WorldSnapshot& snapshot, const std_msgs::Header& header) {
  visualization_msgs::MarkerArray array;
  array.markers.push_back(deleteAllMarkers(header));
  double spacing = 0.0, most = 0.0;
  for (const BodySnapshot& body : snapshot.bodies)
    spacing = spacing > 0.0 ? std::min(spacing, body.model->spacing) : body.model->spacing;
  for (const ContactPoint& point : snapshot.contacts) most = std::max(most, point.force);
  if (snapshot.contacts.empty() || !(most > 0.0)) return array;
  Marker points = markerOf(header, "points", Marker::SPHERE_LIST, kPoint * spacing);
  Marker forces = markerOf(header, "forces", Marker::LINE_LIST, kForceLine * spacing);
  for (const ContactPoint& point : snapshot.contacts) {
    points.points.push_back(toPoint(point.position));
    forces.points.push_back(toPoint(point.position));
    forces.points.push_back(toPoint(point.position + (spacing * point.force / most) * point.normal));
  }
  array.markers.push_back(std::move(points));
  array.markers.push_back(std::move(forces));
  return array;
}

}  // namespace meshless
