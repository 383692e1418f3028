// The clusters that a body is matched in, for display.
#pragma once

#include <visualization_msgs/MarkerArray.h>

#include "meshless_surgery/world/world.h"

namespace meshless {

/// DELETEALL, then two markers a body, id the body's number: in ns "centres" a SPHERE_LIST of the clusters' centres of
/// mass, in ns "members" a LINE_LIST from each to its members, each cluster in a colour of its own. Needs a snapshot
/// with particles.
visualization_msgs::MarkerArray clusterMarkers(const WorldSnapshot& snapshot, const std_msgs::Header& header);

}  // namespace meshless
