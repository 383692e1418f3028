#include "meshless_surgery/contact/box_tree.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace meshless {
namespace {

constexpr Index kChildren = 4;  // of a node, at most

// Of a child that is not there: it overlaps nothing, whatever is asked, and extends nothing.
FloatBox nowhere() {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  FloatBox box;
  box.min = box.max = FloatBox::Four{kNone, kNone, kNone, 0.0f};
  return box;
}

}  // namespace

void BoxTree::build(const Points& centres) {
  nodes_.clear();
  items_.clear();
  const Index count = static_cast<Index>(centres.size());
  if (count == 0) return;
  for (Index i = 0; i < count; ++i) items_.push_back(i);
  nodes_.emplace_back();
  split(0, 0, count, centres);
}

// Of items along the longest axis, the first half: as many as fill whole leaves.
Index BoxTree::halve(Index begin, Index end, const Points& centres) {
  Box bounds;
  for (Index k = begin; k < end; ++k) bounds.extend(centres[items_[k]]);
  int axis = 0;
  (bounds.max - bounds.min).maxCoeff(&axis);
  const Index leaves = (end - begin + kChildren - 1) / kChildren, middle = begin + (leaves + 1) / 2 * kChildren;
  std::nth_element(items_.begin() + begin, items_.begin() + middle, items_.begin() + end, [&](Index a, Index b) {
    return centres[a][axis] != centres[b][axis] ? centres[a][axis] < centres[b][axis] : a < b;
  });
  return middle;
}

// Halves of halves: no deeper than the logarithm, whatever the input.
void BoxTree::split(Index node, Index begin, Index end, const Points& centres) {
  if (end - begin <= kChildren) {
    nodes_[node] = {begin, end - begin, true};
    return;
  }
  const Index middle = halve(begin, end, centres);
  std::array<Index, kChildren + 1> ends{begin};
  Index count = 0;
  for (const auto& [from, to] : {std::pair(begin, middle), std::pair(middle, end)}) {
    if (to - from > kChildren) ends[++count] = halve(from, to, centres);
    ends[++count] = to;
  }
  const Index children = static_cast<Index>(nodes_.size());
  nodes_.resize(children + count);
  nodes_[node] = {children, count, false};
  for (Index k = 0; k < count; ++k) split(children + k, ends[k], ends[k + 1], centres);
}

void BoxTree::refit(TreeBoxes& boxes) const {
  boxes.nodes.resize(nodes_.size());
  for (std::size_t n = nodes_.size(); n-- > 0;) {
    const Node& node = nodes_[n];
    for (Index k = 0; k < kChildren; ++k) {
      FloatBox box = k < node.count ? FloatBox() : nowhere();
      if (k < node.count && node.leaf) box = boxes.items[items_[node.first + k]];
      if (k < node.count && !node.leaf)
        for (Index child = 0; child < kChildren; ++child) box.extend(boxes.nodes[node.first + k].box(child));
      boxes.nodes[n].put(k, box);
    }
  }
}

}  // namespace meshless
