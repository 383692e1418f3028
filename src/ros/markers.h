// What rviz shows: bodies and tools as a marker array.
#pragma once

#include <map>

#include <meshless_surgery/InstrumentPart.h>
#include <visualization_msgs/MarkerArray.h>

#include "meshless_surgery/world/baked_colors.h"
#include "meshless_surgery/world/world.h"

namespace meshless {

/// DELETEALL, and a TRIANGLE_LIST an obstacle: ns "obstacles", numbered.
visualization_msgs::MarkerArray obstacleMarkers(const WorldSnapshot& snapshot, const std_msgs::Header& header);

/// Remembers what was shown, so that what is gone gets its DELETE.
class MarkerBuilder {
 public:
  explicit MarkerBuilder(std::string world_frame) : world_frame_(std::move(world_frame)) {}

  /// Needs a snapshot with surfaces. One TRIANGLE_LIST a body: ns "bodies", id the body's number, a colour for each
  /// point: the outer colour (which is also the marker's) or for faces of cuts the inside colour, each with the
  /// pattern of its look, times the light there. No triangle without an area. Obstacles in ns "obstacles", numbered.
  /// Tools in ns "tools": springs 0, their ends 1, push sphere 2, fibres of attachments 4. Instruments in ns
  /// "instruments", a MESH_RESOURCE a part. `fresh` (someone new listens) and a reset begin with DELETEALL. A DELETE is
  /// said in 30 arrays on end: a slow listener may lose one.
  visualization_msgs::MarkerArray build(const WorldSnapshot& snapshot, const ros::Time& stamp, bool fresh,
                                        const std::vector<meshless_surgery::InstrumentPart>& instruments = {});
  /// A DELETE is still to be said again.
  bool deleting() const;

 private:
  using Key = std::pair<std::string, int>;  // ns, id

  static void addTools(const WorldSnapshot& snapshot, const std_msgs::Header& header,
                       visualization_msgs::MarkerArray& array);

  std::string world_frame_;
  std::optional<std::uint32_t> run_;
  BakedColors baked_;
  std::map<Key, int> shown_;  // how often a DELETE is still to be said
};

}  // namespace meshless
