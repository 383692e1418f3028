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
  for (const ContactPoint& point : snapshot.contacts)
    if (point.other != kPushName) most = std::max(most, point.pressed());
  if (!(most > 0.0)) return array;
  Marker points = markerOf(header, "points", Marker::SPHERE_LIST, kPoint * spacing);
  Marker forces = markerOf(header, "forces", Marker::LINE_LIST, kForceLine * spacing);
  for (const ContactPoint& point : snapshot.contacts) {
    if (point.other == kPushName) continue;
    points.points.push_back(toPoint(point.position));
    forces.points.push_back(toPoint(point.position));
    forces.points.push_back(toPoint(point.position + (spacing * point.pressed() / most) * point.normal));
  }
  array.markers.push_back(std::move(points));
  array.markers.push_back(std::move(forces));
  return array;
}

meshless_surgery::ContactForces toContactForces(const WorldSnapshot& snapshot, const std_msgs::Header& header) {
  meshless_surgery::ContactForces message;
  message.header = header;
  message.step = snapshot.step;
  message.sim_time = snapshot.sim_time;
  for (const ContactPoint& point : snapshot.contacts) {
    meshless_surgery::ContactForce contact;
    contact.body = point.body;
    contact.other = point.other;
    contact.position = toPoint(point.position);
    contact.normal = toVector(point.normal);
    contact.force = toVector(point.force);
    message.contacts.push_back(std::move(contact));
  }
  return message;
}

}  // namespace meshless
