// A tree of boxes over faces, bodies or others: its topology is made once, its boxes anew whenever they have moved.
#pragma once

#include <algorithm>
#include <functional>
#include <utility>

#include "meshless_surgery/base/bytes.h"
#include "meshless_surgery/base/float_box.h"

namespace meshless {

/// Boxes of a frame.
struct TreeBoxes {
  std::vector<FloatBox> items;
  std::vector<FourBoxes> nodes;  // of their children
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
      const Node& node = nodes_[at];
      eachBit(boxes.nodes[at].overlapping(box), [&](Index k) {
        if (node.leaf)
          visit(items_[node.first + k]);
        else
          stack[depth++] = node.first + k;
      });
    }
  }

  /// The item for which squared(item) is least, or kNoIndex where none is below `least` [m^2], which it then becomes;
  /// squared: the squared distance of p from what the item's box holds.
  template <class Squared>
  Index nearest(const TreeBoxes& boxes, const Vec3& p, double& least, const Squared& squared) const {
    Index found = kNoIndex;
    std::vector<std::pair<double, Index>> heap;  // nodes, the nearest on top
    if (!nodes_.empty()) heap.push_back({0.0, 0});
    while (!heap.empty() && heap.front().first < least) {
      std::pop_heap(heap.begin(), heap.end(), std::greater<>());
      const Index at = heap.back().second;
      heap.pop_back();
      const Node& node = nodes_[at];
      for (Index k = 0; k < node.count; ++k) {
        double away = 0.0;
        for (int axis = 0; axis < 3; ++axis) {
          const double by = std::max(boxes.nodes[at].min[axis][k] - p[axis], p[axis] - boxes.nodes[at].max[axis][k]);
          if (by > 0.0) away += by * by;
        }
        if (!(away < least)) continue;
        if (!node.leaf) {
          heap.push_back({away, node.first + k});
          std::push_heap(heap.begin(), heap.end(), std::greater<>());
        } else if (const double now = squared(items_[node.first + k]); now < least) {
          least = now;
          found = items_[node.first + k];
        }
      }
    }
    return found;
  }

  /// visit(item, other's item) for each two whose boxes are nearer than `by` [m], in an order that depends on the
  /// topologies alone. may_meet(node, child, other's node): bits of the other's children that the child may meet.
  template <class MayMeet, class Visit>
  void queryTree(const TreeBoxes& boxes, const BoxTree& other, const TreeBoxes& other_boxes, float by,
                 std::vector<std::array<Index, 2>>& stack, const MayMeet& may_meet, const Visit& visit) const {
    stack.clear();
    if (!nodes_.empty() && !other.nodes_.empty()) stack.push_back({0, 0});
    while (!stack.empty()) {
      const auto [mine, theirs] = stack.back();
      stack.pop_back();
      const Node &a = nodes_[mine], &b = other.nodes_[theirs];
      unsigned any = 0;  // of theirs
      for (Index i = 0; i < a.count; ++i) {
        unsigned bits = other_boxes.nodes[theirs].overlapping(boxes.nodes[mine].box(i), by);
        if (bits != 0) bits &= may_meet(mine, i, theirs);
        any |= bits;
        if (a.leaf && b.leaf)
          eachBit(bits, [&](Index j) { visit(items_[a.first + i], other.items_[b.first + j]); });
        else if (!a.leaf && b.leaf && bits != 0)
          stack.push_back({a.first + i, theirs});
        else if (!a.leaf && !b.leaf)
          eachBit(bits, [&](Index j) { stack.push_back({a.first + i, b.first + j}); });
      }
      if (a.leaf && !b.leaf) eachBit(any, [&](Index j) { stack.push_back({mine, b.first + j}); });
    }
  }

  std::size_t bytes() const { return bytesOf(nodes_, items_); }

 private:
  struct Node {
    Index first = 0, count = 0;  // of its children, up to four, one after the other: items or nodes
    bool leaf = true;
  };
  void split(Index node, Index begin, Index end, const Points& centres);
  Index halve(Index begin, Index end, const Points& centres);

  template <class Visit>
  static void eachBit(unsigned bits, const Visit& visit) {
    for (; bits != 0; bits &= bits - 1) visit(static_cast<Index>(__builtin_ctz(bits)));
  }

  std::vector<Node> nodes_;  // children after their parents
  std::vector<Index> items_;
};

}  // namespace meshless
