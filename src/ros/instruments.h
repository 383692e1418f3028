// The instruments that are drawn at the tools: a grasper at each pick, a probe at the push sphere, scissors.
#pragma once

#include <map>
#include <optional>
#include <vector>

#include <meshless_surgery/InstrumentPart.h>

#include "meshless_surgery/world/world.h"

namespace meshless {

/// The newest pick that is not locked; null where there is none.
const Pick* pickInHand(const WorldSnapshot& snapshot);

class Instruments {
 public:
  /// An instrument reaches along +x of its pose. A pick is held between the tips of a grasper's jaws, where its spring
  /// ends in the tissue. `pick_hand` and `push_hand` are what streams say of the hands; a hand whose rotation is the
  /// identity says none, and its instrument comes from the front, from the left.
  std::vector<meshless_surgery::InstrumentPart> parts(const WorldSnapshot& snapshot,
                                                      const std::optional<Pose>& pick_hand,
                                                      const std::optional<Pose>& push_hand);

 private:
  // As hands left them: of graspers, and of the probe.
  std::map<PickId, Quat> turns_;
  std::optional<Quat> probe_turn_;
};

}  // namespace meshless
