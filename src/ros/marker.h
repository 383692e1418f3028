// What every marker begins with.
#pragma once

#include <string>

#include <visualization_msgs/Marker.h>

namespace meshless {

inline visualization_msgs::Marker newMarker(const std_msgs::Header& header, const std::string& ns, int id, int type) {
  visualization_msgs::Marker marker;
  marker.header = header;
  marker.ns = ns;
  marker.id = id;
  marker.type = type;
  marker.action = visualization_msgs::Marker::ADD;
  marker.pose.orientation.w = 1.0;
  return marker;
}

/// Takes away whatever its topic has shown before.
inline visualization_msgs::Marker deleteAllMarkers(const std_msgs::Header& header) {
  visualization_msgs::Marker marker = newMarker(header, "", 0, visualization_msgs::Marker::CUBE);
  marker.action = visualization_msgs::Marker::DELETEALL;
  return marker;
}

}  // namespace meshless
