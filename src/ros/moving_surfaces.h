// Surfaces for bags and slow networks: triangles where they change, vertices in six bytes each, of what has moved.
#pragma once

#include <map>
#include <optional>

#include <meshless_surgery/TissueImages.h>
#include <meshless_surgery/Topology.h>
#include <meshless_surgery/Vertices.h>

#include "meshless_surgery/world/baked_colors.h"
#include "meshless_surgery/world/world.h"

namespace meshless {

class MovingSurfaces {
 public:
  /// The topology, where it is another one than at the last call. Needs no more than a snapshot's models.
  std::optional<meshless_surgery::Topology> change(const WorldSnapshot& snapshot, const std_msgs::Header& header);
  /// The images that the looks name, where they are others than at the last call.
  std::optional<meshless_surgery::TissueImages> newImages(const WorldSnapshot& snapshot,
                                                          const std_msgs::Header& header);
  /// All bodies where that is wished or the topology has changed since the last call; else those that have moved since.
  /// Needs a snapshot with surfaces, the one of the last change().
  meshless_surgery::Vertices vertices(const WorldSnapshot& snapshot, const std_msgs::Header& header, bool complete);

  /// The number of the last change(); 0: none yet.
  std::uint32_t topology() const { return topology_; }

 private:
  bool isKnown(const WorldSnapshot& snapshot) const;

  std::vector<BakedBody> known_;
  BakedColors baked_;
  std::map<std::uint64_t, ImagePtr> images_;  // by their ids
  std::uint32_t run_ = 0;
  std::uint32_t topology_ = 0;                                    // 0: none yet
  std::uint32_t said_topology_ = 0;                               // of the last vertices
  std::map<std::uint32_t, meshless_surgery::BodyVertices> said_;  // by the body's number
};

}  // namespace meshless
