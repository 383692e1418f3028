// What contact takes for the surfaces of bodies, for display.
#pragma once

#include <visualization_msgs/MarkerArray.h>

#include "meshless_surgery/world/world.h"

namespace meshless {

/// DELETEALL, then a LINE_LIST of edges for each body whose surface for contact is not the visual one: ns "collision",
/// id the body's number. Needs a snapshot with particles.
visualization_msgs::MarkerArray collisionMarkers(const WorldSnapshot& snapshot, const std_msgs::Header& header);

}  // namespace meshless
