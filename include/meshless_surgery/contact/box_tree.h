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
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  std::array<float, 3> min{{kInfinity, kInfinity, kInfinity}}, max{{-kInfinity, -kInfinity, -kInfinity}};

  void extend(const Vec3& p) {
    for (int k = 0; k < 3; ++k) {
      const float near = static_cast<float>(p[k]);
      min[k] = std::min(min[k], near > p[k] ? std::nextafter(near, -kInfinity) : near);
      max[k] = std::max(max[k], near < p[k] ? std::nextafter(near, kInfinity) : near);
    }
  }
  void extend(const FloatBox& o) {
    for (int k = 0; k < 3; ++k) {
      min[k] = std::min(min[k], o.min[k]);
      max[k] = std::max(max[k], o.max[k]);
    }
  }
  bool isNear(const FloatBox& o, double by) const {
    for (int k = 0; k < 3; ++k)
      if (static_cast<double>(min[k]) - by > o.max[k] || static_cast<double>(o.min[k]) - by > max[k]) return false;
    return true;
  }
  /// The least dot product of a point in this box and one in the other.
  float leastDot(const FloatBox& o) const {
    float sum = 0.0f;
    for (int k = 0; k < 3; ++k)
      sum += std::min({min[k] * o.min[k], min[k] * o.max[k], max[k] * o.min[k], max[k] * o.max[k]});
    return sum;
  }
  /// The sum of its three edges.
  float edgeSum() const { return (max[0] - min[0]) + (max[1] - min[1]) + (max[2] - min[2]); }
  bool overlaps(const FloatBox& o) const {
    return min[0] <= o.max[0] && o.min[0] <= max[0] && min[1] <= o.max[1] && o.min[1] <= max[1] && min[2] <= o.max[2] &&
           o.min[2] <= max[2];
  }
};

/// Boxes of a frame.
struct TreeBoxes {
  std::vector<FloatBox> items, nodes;
  std::size_t bytes() const { return bytesOf(items, nodes); }
};

/// Scratch of BoxTree::queryTree().
struct TreeQuery {
  std::vector<std::array<Index, 2>> stack;
  std::vector<char> seen;
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

  /// visit(item) for each in a leaf that is nearer than `by` [m] to a leaf of another tree; an item may come again.
  /// may_meet(node, other's node) leaves out what is below both.
  template <class MayMeet, class Visit>
  void queryTree(const TreeBoxes& boxes, const BoxTree& other, const TreeBoxes& other_boxes, double by,
                 TreeQuery& query, const MayMeet& may_meet, const Visit& visit) const {
    if (nodes_.empty() || other.nodes_.empty()) return;
    auto& [stack, seen] = query;
    stack.assign(1, {0, 0});
    seen.assign(nodes_.size(), 0);
    while (!stack.empty()) {
      const auto [mine, theirs] = stack.back();
      stack.pop_back();
      const Node &a = nodes_[mine], &b = other.nodes_[theirs];
      if (seen[mine] || !boxes.nodes[mine].isNear(other_boxes.nodes[theirs], by) || !may_meet(mine, theirs)) continue;
      if (a.count > 0 && b.count > 0) {
        seen[mine] = 1;
        for (Index k = a.first; k < a.first + a.count; ++k) visit(items_[k]);
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
