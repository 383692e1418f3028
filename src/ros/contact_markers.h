// Where bodies press on each other, on obstacles and on the ground, for display and as numbers.
#pragma once

#include <meshless_surgery/ContactForces.h>
#include <visualization_msgs/MarkerArray.h>

#include "meshless_surgery/world/world.h"

namespace meshless {

/// DELETEALL, then in ns "points" a SPHERE_LIST of the points that carry load and in ns "forces" a LINE_LIST of their
/// forces along the normals: a line is a particle spacing long where it carries the largest force, the others in
/// proportion. Needs a snapshot with contacts.
visualization_msgs::MarkerArray contactMarkers(const WorldSnapshot& snapshot, const std_msgs::Header& header);
/// Likewise.
meshless_surgery::ContactForces toContactForces(const WorldSnapshot& snapshot, const std_msgs::Header& header);

}  // namespace meshless
