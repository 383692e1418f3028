#include "meshless_surgery/contact/broad_phase.h"

#include <algorithm>

namespace meshless {
namespace {

// Beyond it lies infinity in float, where what is in the tree is no longer told from its empty places.
constexpr double kFarthest = 1e38;  // [m]

}  // namespace

const std::vector<std::array<Index, 2>>& BroadPhase::find(const std::vector<Box>& boxes,
                                                          const std::vector<char>& active) {
  tested_ = 0;
  pairs_.clear();
  if (std::find(active.begin(), active.end(), 1) == active.end()) return pairs_;
  centres_.assign(boxes.size(), Vec3::Zero());
  tree_boxes_.items.assign(boxes.size(), FloatBox());
  for (Index i = 0; i < boxes.size(); ++i) {
    const Box& box = boxes[i];
    if (box.empty() || !box.min.allFinite() || !box.max.allFinite()) continue;
    centres_[i] = 0.5 * (box.min + box.max);
    for (const Vec3& corner : {box.min, box.max})
      tree_boxes_.items[i].extend(corner.cwiseMax(-kFarthest).cwiseMin(kFarthest));
  }
  tree_.build(centres_);
  tree_.refit(tree_boxes_);
  for (Index i = 0; i < boxes.size(); ++i) {
    if (!active[i]) continue;
    tree_.query(tree_boxes_, tree_boxes_.items[i], [&](Index j) {
      if (j == i || (active[j] && j < i)) return;
      ++tested_;
      if (boxes[i].overlaps(boxes[j])) pairs_.push_back({std::min(i, j), std::max(i, j)});
    });
  }
  std::sort(pairs_.begin(), pairs_.end());
  return pairs_;
}

}  // namespace meshless
