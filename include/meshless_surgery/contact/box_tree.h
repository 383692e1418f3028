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
};

/// Four boxes side by side: one comparison for all of them, without branches, since which axis parts two boxes cannot
/// be foretold.
struct FourBoxes {
  using Four = FloatBox::Four;
  using Mask = int __attribute__((vector_size(16)));
  std::array<Four, 3> min, max;  // [axis], one a box

  void put(int k, const FloatBox& box) {
    for (int axis = 0; axis < 3; ++axis) {
      min[axis][k] = box.min[axis];
      max[axis][k] = box.max[axis];
    }
  }
  FloatBox box(int k) const {
    FloatBox box;
    box.min = Four{min[0][k], min[1][k], min[2][k], 0.0f};
    box.max = Four{max[0][k], max[1][k], max[2][k], 0.0f};
    return box;
  }
  /// Bit k: the box k overlaps another or is nearer than `by` [m] along each axis.
  unsigned overlapping(const FloatBox& o, float by = 0.0f) const {
    Mask all{-1, -1, -1, -1};
    for (int axis = 0; axis < 3; ++axis) all &= (min[axis] - by <= o.max[axis]) & (o.min[axis] - by <= max[axis]);
    return bitsOf(all);
  }
  /// Bit k: a point in the box k and one in the other have a dot product below `limit`.
  unsigned dotBelow(const FloatBox& o, float limit) const {
    Four sum{};
    for (int axis = 0; axis < 3; ++axis)
      sum += FloatBox::lesser(FloatBox::lesser(min[axis] * o.min[axis], min[axis] * o.max[axis]),
                              FloatBox::lesser(max[axis] * o.min[axis], max[axis] * o.max[axis]));
    return bitsOf(sum < limit);
  }

 private:
  static unsigned bitsOf(const Mask& mask) {
    const Mask bits = mask & Mask{1, 2, 4, 8};
    return static_cast<unsigned>((bits[0] | bits[1]) | (bits[2] | bits[3]));
  }
};

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
