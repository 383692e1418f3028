#include "meshless_surgery/contact/box_tree.h"

#include <algorithm>

namespace meshless {
namespace {

constexpr Index kLeaf = 4;  // items at most

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

// Halves along the longest axis: no deeper than the logarithm, whatever the input.
void BoxTree::split(Index node, Index begin, Index end, const Points& centres) {
  if (end - begin <= kLeaf) {
    nodes_[node] = {begin, end - begin};
    return;
  }
  Box bounds;
  for (Index k = begin; k < end; ++k) bounds.extend(centres[items_[k]]);
  int axis = 0;
  (bounds.max - bounds.min).maxCoeff(&axis);
  const Index middle = (begin + end) / 2;
  std::nth_element(items_.begin() + begin, items_.begin() + middle, items_.begin() + end, [&](Index a, Index b) {
    return centres[a][axis] != centres[b][axis] ? centres[a][axis] < centres[b][axis] : a < b;
  });
  const Index children = static_cast<Index>(nodes_.size());
  nodes_.resize(children + 2);
  nodes_[node] = {children, 0};
  split(children, begin, middle, centres);
  split(children + 1, middle, end, centres);
}

void BoxTree::refit(TreeBoxes& boxes) const {
  boxes.nodes.resize(nodes_.size());
  for (std::size_t n = nodes_.size(); n-- > 0;) {
    const Node& node = nodes_[n];
    FloatBox box;
    if (node.count == 0) {
      box = boxes.nodes[node.first];
      box.extend(boxes.nodes[node.first + 1]);
    } else {
      for (Index k = node.first; k < node.first + node.count; ++k) box.extend(boxes.items[items_[k]]);
    }
    boxes.nodes[n] = box;
  }
}

}  // namespace meshless
