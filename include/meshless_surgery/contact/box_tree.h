// A tree of boxes over faces, bodies or others: its topology is made once, its boxes anew whenever they have moved.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "meshless_surgery/base/bytes.h"
#include "meshless_surgery/base/types.h"

namespace meshless {

/// In float, rounded outwards. Empty while min > max; overlaps nothing then.
struct FloatBox {
  using Four = float __attribute__((vector_size(16)));  // the last is 0
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Four min{kInfinity, kInfinity, kInfinity, 0.0f}, max{-kInfinity, -kInfinity, -kInfinity, 0.0f};

  static Four lesser(const Four& x, const Four& y) { return x < y ? x : y; }
  static Four greater(const Four& x, const Four& y) { return x > y ? x : y; }
  void extend(const Vec3& p) {
    const Four near{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2]), 0.0f};
    const Four rounding = std::numeric_limits<float>::epsilon() * greater(near, -near);
    min = lesser(near - rounding, min);
    max = greater(near + rounding, max);
  }
  void extend(const FloatBox& o) {
    min = lesser(o.min, min);
    max = greater(o.max, max);
  }
  /// Or is nearer than `by` [m] along each axis. Without branches: which axis parts two boxes cannot be foretold.
  bool overlaps(const FloatBox& o, float by = 0.0f) const {
    const auto does = (min - by <= o.max) & (o.min - by <= max);
    return (does[0] & does[1] & does[2]) != 0;
  }
  /// The least dot product of a point in this box and one in the other.
  float leastDot(const FloatBox& o) const {
    const Four least = lesser(lesser(min * o.min, min * o.max), lesser(max * o.min, max * o.max));
    return least[0] + least[1] + least[2];
  }
  /// The sum of its three edges.
  float edgeSum() const { return (max[0] - min[0]) + (max[1] - min[1]) + (max[2] - min[2]); }
};

/// Boxes of a frame.
struct TreeBoxes {
  std::vector<FloatBox> items, nodes;
  std::size_t bytes() const { return bytesOf(items, nodes); }
};

class BoxTree {
 public:
  BoxTree() = default;
  explicit BoxTree(const Points& centres) { build(centres); }
  void build(const Points& centres);  // one an item [m]

  /// Fills boxes.nodes from boxes.items.
  void refit(TreeBoxes& boxes) const;

  /// visit(item) for each whose box overlaps, in an order that depends on the topology alone.
  template <class Visit>
  void query(const TreeBoxes& boxes, const FloatBox& box, const Visit& visit) const {
    if (nodes_.empty()) return;
    std::array<Index, 64> stack;
    std::size_t depth = 0;
    stack[depth++] = 0;
    while (depth > 0) {
      const Index at = stack[--depth];
      if (!boxes.nodes[at].overlaps(box)) continue;
      const Node& node = nodes_[at];
      if (node.count == 0) {
        stack[depth++] = node.first;
        stack[depth++] = node.first + 1;
        continue;
      }
      for (Index k = node.first; k < node.first + node.count; ++k)
        if (boxes.items[items_[k]].overlaps(box)) visit(items_[k]);
    }
  }

  /// visit(item, other's item) for each two whose boxes are nearer than `by` [m], in an order that depends on the
  /// topologies alone. may_meet(node, other's node) leaves out what is below both.
  template <class MayMeet, class Visit>
  void queryTree(const TreeBoxes& boxes, const BoxTree& other, const TreeBoxes& other_boxes, float by,
                 std::vector<std::array<Index, 2>>& stack, const MayMeet& may_meet, const Visit& visit) const {
    stack.clear();
    if (!nodes_.empty() && !other.nodes_.empty()) stack.push_back({0, 0});
    while (!stack.empty()) {
      const auto [mine, theirs] = stack.back();
      stack.pop_back();
      if (!boxes.nodes[mine].overlaps(other_boxes.nodes[theirs], by) || !may_meet(mine, theirs)) continue;
      const Node &a = nodes_[mine], &b = other.nodes_[theirs];
      if (a.count > 0 && b.count > 0) {
        for (Index i = a.first; i < a.first + a.count; ++i) {
          if (!boxes.items[items_[i]].overlaps(other_boxes.nodes[theirs], by)) continue;
          for (Index j = b.first; j < b.first + b.count; ++j)
            if (boxes.items[items_[i]].overlaps(other_boxes.items[other.items_[j]], by))
              visit(items_[i], other.items_[j]);
        }
      } else if (b.count == 0 && (a.count > 0 || boxes.nodes[mine].edgeSum() < other_boxes.nodes[theirs].edgeSum())) {
        stack.push_back({mine, b.first});
        stack.push_back({mine, b.first + 1});
      } else {
        stack.push_back({a.first, theirs});
        stack.push_back({a.first + 1, theirs});
      }
    }
  }

  std::size_t bytes() const { return bytesOf(nodes_, items_); }

 private:
  struct Node {
    Index first = 0, count = 0;  // of items; count 0: of two children
  };
  void split(Index node, Index begin, Index end, const Points& centres);

  std::vector<Node> nodes_;  // children after their parents
  std::vector<Index> items_;
};

}  // namespace meshless
