// Tools that pass through each other.
#pragma once

#include <map>
#include <set>
#include <utility>

#include "meshless_surgery/training/frame.h"

namespace meshless {

/// Tools are solid about the line from their hand to where they work (TrainingFrame::Tool::radius). Two of them meet
/// where they come nearer than their radii together; what they pass on the even way from one step to the next counts.
class ToolCrossings {
 public:
  void feed(const std::vector<TrainingFrame::Tool>& tools);
  /// How often two tools have met that were apart.
  std::size_t count() const { return count_; }

 private:
  using Key = std::pair<ToolKind, PickId>;
  struct Axis {
    Vec3 from, to;  // [m]
  };
  std::map<Key, Axis> last_;
  std::set<std::pair<Key, Key>> near_;
  std::size_t count_ = 0;
};

/// [m] between two straight lines that have ends, or are points.
double segmentDistance(const Vec3& from_a, const Vec3& to_a, const Vec3& from_b, const Vec3& to_b);

}  // namespace meshless
