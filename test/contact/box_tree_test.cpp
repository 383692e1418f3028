#include "meshless_surgery/contact/box_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "meshless_surgery/base/random.h"

namespace meshless {
namespace {

struct Boxes {
  BoxTree tree;
  TreeBoxes boxes;
};

/// So many in a unit cube; some of no size, some empty.
Boxes randomBoxes(std::size_t count, double size, Random& random) {
  Points centres;
  Boxes made;
  for (std::size_t n = 0; n < count; ++n) {
    const Vec3 at = random.inCube(0.5);
    const Vec3 half = n % 5 == 0 ? Vec3(Vec3::Zero()) : Vec3(random.inCube(size).cwiseAbs());
    centres.push_back(at);
    FloatBox box;
    if (n % 17 != 16) {
      box.extend(at - half);
      box.extend(at + half);
    }
    made.boxes.items.push_back(box);
  }
  made.tree = BoxTree(centres);
  made.tree.refit(made.boxes);
  return made;
}

bool meet(const FloatBox& a, const FloatBox& b, float by) {
  for (int axis = 0; axis < 3; ++axis)
    if (!(a.min[axis] - by <= b.max[axis] && b.min[axis] - by <= a.max[axis])) return false;
  return true;
}

constexpr std::size_t kCounts[] = {0, 1, 3, 4, 5, 8, 9, 17, 64, 65, 1000};

TEST(FloatBox, HoldsThePointsThatItWasExtendedBy) {
  Random random(4);
  for (const double size : {1e-6, 1.0, 1e6})
    for (int n = 0; n < 1000; ++n) {
      const Vec3 p = random.inCube(size);
      FloatBox box;
      box.extend(p);
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_LE(static_cast<double>(box.min[axis]), p[axis]);
        EXPECT_GE(static_cast<double>(box.max[axis]), p[axis]);
        EXPECT_LE(static_cast<double>(box.max[axis] - box.min[axis]), 1e-6 * std::abs(p[axis]));
      }
    }
}

TEST(FourBoxes, SayWhichHoldAPointWhoseDotProductWithOneOfAnotherIsBelowALimit) {
  Random random(5);
  for (int n = 0; n < 2000; ++n) {
    FloatBox one, other;
    for (FloatBox* const box : {&one, &other}) {
      const Vec3 at = random.inCube(1.0);
      box->extend(at);
      box->extend(at + random.inCube(0.3));
    }
    double least = 0.0;  // at corners
    for (int axis = 0; axis < 3; ++axis)
      least += std::min(
          {static_cast<double>(one.min[axis]) * other.min[axis], static_cast<double>(one.min[axis]) * other.max[axis],
           static_cast<double>(one.max[axis]) * other.min[axis], static_cast<double>(one.max[axis]) * other.max[axis]});
    FourBoxes four;
    for (int k = 0; k < 4; ++k) four.put(k, k == n % 4 ? one : FloatBox());
    EXPECT_EQ(four.dotBelow(other, static_cast<float>(least + 1e-5)) >> n % 4 & 1u, 1u);
    EXPECT_EQ(four.dotBelow(other, static_cast<float>(least - 1e-5)) >> n % 4 & 1u, 0u);
  }
}

TEST(BoxTree, FindsWhatOverlapsABoxOnceAndNothingElse) {
  Random random(1);
  for (const std::size_t count : kCounts) {
    const Boxes some = randomBoxes(count, 0.05, random);
    for (const FloatBox& box : randomBoxes(40, 0.2, random).boxes.items) {
      std::multiset<Index> found, expected;
      some.tree.query(some.boxes, box, [&](Index item) { found.insert(item); });
      for (Index n = 0; n < count; ++n)
        if (meet(some.boxes.items[n], box, 0.0f)) expected.insert(n);
      EXPECT_EQ(found, expected) << count << " boxes";
    }
  }
}

// What goes beyond the range of float: children that are not there are no place to look into.
TEST(BoxTree, ABoxWithoutEndFindsEachOnce) {
  constexpr float kInfinity = FloatBox::kInfinity;
  FloatBox all;
  all.min = FloatBox::Four{-kInfinity, -kInfinity, -kInfinity, 0.0f};
  all.max = FloatBox::Four{kInfinity, kInfinity, kInfinity, 0.0f};
  Random random(6);
  for (const std::size_t count : kCounts) {
    const Boxes of = randomBoxes(count, 0.1, random);
    std::multiset<Index> found;
    of.tree.query(of.boxes, all, [&](Index item) {
      ASSERT_LT(item, count);
      found.insert(item);
    });
    for (Index item = 0; item < count; ++item) EXPECT_EQ(found.count(item), 1u) << item << " of " << count;
  }
}

TEST(BoxTree, FindsTheNearest) {
  Random random(3);
  for (const std::size_t count : kCounts) {
    const Boxes some = randomBoxes(count, 0.05, random);
    for (int n = 0; n < 40; ++n) {
      const Vec3 p = random.inCube(1.0);
      const auto squared = [&](Index item) {
        const FloatBox& box = some.boxes.items[item];
        double sum = 0.0;
        for (int axis = 0; axis < 3; ++axis) {
          const double by = std::max({box.min[axis] - p[axis], p[axis] - box.max[axis], 0.0});
          sum += by * by;
        }
        return sum;
      };
      double expected = std::numeric_limits<double>::infinity();
      for (Index item = 0; item < count; ++item) expected = std::min(expected, squared(item));
      double least = std::numeric_limits<double>::infinity();
      std::size_t asked = 0;
      const Index found = some.tree.nearest(some.boxes, p, least, [&](Index item) {
        ++asked;
        return squared(item);
      });
      EXPECT_EQ(least, expected);
      EXPECT_EQ(found == kNoIndex, std::isinf(expected));
      if (found != kNoIndex) EXPECT_EQ(squared(found), expected);
      EXPECT_LE(asked, std::max<std::size_t>(64, count / 4));
      EXPECT_EQ(some.tree.nearest(some.boxes, p, least, squared), kNoIndex) << "none is nearer than itself";
    }
  }
}

TEST(BoxTree, FindsPairsOfTwoTreesOnceAndNothingElse) {
  Random random(2);
  std::vector<std::array<Index, 2>> stack;
  for (const std::size_t count : kCounts)
    for (const std::size_t others : kCounts) {
      const Boxes a = randomBoxes(count, 0.02, random), b = randomBoxes(others, 0.03, random);
      std::multiset<std::array<Index, 2>> found, expected;
      const auto all = [](Index, Index, Index) { return ~0u; };
      a.tree.queryTree(a.boxes, b.tree, b.boxes, 0.01f, stack, all, [&](Index i, Index j) { found.insert({i, j}); });
      for (Index i = 0; i < count; ++i)
        for (Index j = 0; j < others; ++j)
          if (meet(a.boxes.items[i], b.boxes.items[j], 0.01f)) expected.insert({i, j});
      EXPECT_EQ(found, expected) << count << " and " << others << " boxes";
    }
}

// Boxes of normals leave out who looks the same way, and nobody else.
TEST(BoxTree, LeavesOutWhatTheCallerSaysAndNothingElse) {
  Random random(3);
  std::vector<std::array<Index, 2>> stack;
  const std::size_t count = 300;
  const Boxes a = randomBoxes(count, 0.05, random), b = randomBoxes(count, 0.05, random);
  TreeBoxes turns_a, turns_b;
  for (TreeBoxes* const turns : {&turns_a, &turns_b})
    for (std::size_t n = 0; n < count; ++n) turns->items.emplace_back().extend(random.inCube(1.0).normalized());
  a.tree.refit(turns_a);
  b.tree.refit(turns_b);
  std::multiset<std::array<Index, 2>> found, expected;
  a.tree.queryTree(
      a.boxes, b.tree, b.boxes, 0.0f, stack,
      [&](Index mine, Index child, Index theirs) {
        return turns_b.nodes[theirs].dotBelow(turns_a.nodes[mine].box(static_cast<int>(child)), -0.3f);
      },
      [&](Index i, Index j) {
        found.insert({i, j});
      });
  for (Index i = 0; i < count; ++i)
    for (Index j = 0; j < count; ++j) {
      const FloatBox::Four product = turns_a.items[i].min * turns_b.items[j].min;
      if (meet(a.boxes.items[i], b.boxes.items[j], 0.0f) && product[0] + product[1] + product[2] < -0.3f)
        expected.insert({i, j});
    }
  EXPECT_FALSE(expected.empty());
  EXPECT_EQ(found, expected);
}

}  // namespace
}  // namespace meshless
