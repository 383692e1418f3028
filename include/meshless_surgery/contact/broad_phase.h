// Which boxes overlap.
#pragma once

#include "meshless_surgery/contact/box_tree.h"

namespace meshless {

/// Kept between steps: finding allocates nothing once it has grown. What is found does not depend on it.
class BroadPhase {
 public:
  /// {lower, higher} index of each pair of overlapping boxes, ascending. Empty boxes (and such with NaN) overlap
  /// nothing; `active`: pairs of two inactive ones are left out. The result is valid until the next call.
  const std::vector<std::array<Index, 2>>& find(const std::vector<Box>& boxes, const std::vector<char>& active);
  /// Pairs of boxes compared in the last call.
  std::size_t tested() const { return tested_; }
  /// That it holds.
  std::size_t bytes() const { return bytesOf(centres_, pairs_) + tree_.bytes() + tree_boxes_.bytes(); }

 private:
  BoxTree tree_;
  TreeBoxes tree_boxes_;
  Points centres_;
  std::vector<std::array<Index, 2>> pairs_;
  std::size_t tested_ = 0;
};

}  // namespace meshless
