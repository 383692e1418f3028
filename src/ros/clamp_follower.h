// Tissue that is fixed to frames of tf: entries of `fixed` with `follows`.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <ros/node_handle.h>
#include <ros/steady_timer.h>

#include "frames.h"
#include "runner.h"

namespace meshless {

class ClampFollower {
 public:
  struct Followed {
    std::string body;
    std::uint32_t clamp = 0;  // the entry of its `fixed`
    std::string frame;
  };

  /// Nothing happens where nothing follows. What it is given outlives it.
  ClampFollower(const ros::NodeHandle& handle, std::vector<Followed> followed, WorldRunner& runner, Frames& frames);
  void stop();

 private:
  struct Clamp {
    Pose frame, motion;     // of the frame, and of what it holds, when the run began
    Pose said;              // of the frame when the world was told last
    double said_at = -1e9;  // [s]
  };

  void look();
  void follow(World& world, const std::map<std::string, Pose>& now);

  const std::vector<Followed> followed_;
  WorldRunner& runner_;
  Frames& frames_;
  ros::SteadyTimer timer_;
  double missing_since_ = 0.0;  // [s]
  std::uint32_t run_ = 0;       // of what is below, which jobs between two steps alone read and write
  std::vector<std::optional<Clamp>> clamps_;
};

}  // namespace meshless
