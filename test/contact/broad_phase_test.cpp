#include "meshless_surgery/contact/broad_phase.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "support/random.h"

namespace meshless {
namespace broad_phase_test {

using Pairs = std::vector<std::array<Index, 2>>;

const double kNan = std::numeric_limits<double>::quiet_NaN();

Pairs everyPair(const std::vector<Box>& boxes, const std::vector<char>& active) {
  Pairs pairs;
  for (Index i = 0; i < boxes.size(); ++i)
    for (Index j = i + 1; j < boxes.size(); ++j)
      if ((active[i] || active[j]) && !boxes[i].empty() && !boxes[j].empty() && boxes[i].overlaps(boxes[j]))
        pairs.push_back({i, j});
  return pairs;
}

Box boxAt(const Vec3& centre, const Vec3& half) {
  Box box;
  box.min = centre - half;
  box.max = centre + half;
  return box;
}

/// Sizes over `decades` powers of ten, flat and long ones among them.
std::vector<Box> randomBoxes(test::Random& random, int count, double decades, double region) {
  std::vector<Box> boxes;
  for (int k = 0; k < count; ++k) {
    const double size = std::pow(10.0, -random.uniform(0.0, decades));
    const Vec3 half = size * (random.vector(0.5).array() + 0.5).matrix();
    boxes.push_back(boxAt(random.vector(region), half));
  }
  return boxes;
}

TEST(BroadPhase, FindsThePairsThatComparingAllFinds) {
  test::Random random(3);
  BroadPhase broad;  // kept, as between steps
  std::size_t met = 0;
  for (const int count : {2, 3, 20, 150, 600})
    for (const double decades : {0.0, 1.0, 4.0, 9.0})
      for (const double region : {0.5, 3.0, 30.0}) {
        const std::vector<Box> boxes = randomBoxes(random, count, decades, region);
        const std::vector<char> active(boxes.size(), 1);
        const Pairs expected = everyPair(boxes, active);
        EXPECT_EQ(broad.find(boxes, active), expected) << count << " boxes, " << decades << " decades, " << region;
        met += expected.size();
      }
  EXPECT_GT(met, 10000u);
}

TEST(BroadPhase, FindsThemWhileTheyMoveABitOrFarOrAtOnce) {
  for (const double stride : {0.0, 1e-4, 1e-2, 0.3}) {
    test::Random random(11);
    BroadPhase broad;
    std::vector<Box> boxes = randomBoxes(random, 200, 1.0, 1.5);
    std::vector<char> active(boxes.size(), 1);
    std::size_t met = 0;
    for (int step = 0; step < 120; ++step) {
      for (Box& box : boxes) {
        const Vec3 shift = random.vector(stride);
        box.min += shift;
        box.max += shift;
        box.max.array() += random.uniform(0.0, 1e-3 * stride);
      }
      if (step % 30 == 29) active[static_cast<std::size_t>(random.integer(0, 199))] ^= 1;
      if (step == 50) boxes[7].min.x() = kNan;
      if (step == 60) boxes[7] = boxes[8];
      if (step == 70) boxes[9] = Box();
      if (step == 80) boxes.push_back(boxes[10]), active.push_back(1);
      const Pairs expected = everyPair(boxes, active);
      ASSERT_EQ(broad.find(boxes, active), expected) << "stride " << stride << ", step " << step;
      met += expected.size();
    }
    EXPECT_GT(met, 1000u);
  }
}

TEST(BroadPhase, TwoThatAreInactiveAreNoPair) {
  test::Random random(5);
  BroadPhase broad;
  const std::vector<Box> boxes = randomBoxes(random, 300, 2.0, 1.0);
  std::vector<char> active(boxes.size());
  for (char& a : active) a = random.integer(0, 3) == 0;
  const Pairs expected = everyPair(boxes, active);
  EXPECT_GT(expected.size(), 10u);
  EXPECT_LT(expected.size(), everyPair(boxes, std::vector<char>(boxes.size(), 1)).size());
  EXPECT_EQ(broad.find(boxes, active), expected);
  EXPECT_TRUE(broad.find(boxes, std::vector<char>(boxes.size(), 0)).empty());
}

TEST(BroadPhase, EmptyBoxesAndSuchWithoutNumbersOverlapNothing) {
  test::Random random(8);
  BroadPhase broad;
  std::vector<Box> boxes = randomBoxes(random, 60, 1.0, 0.7);
  const Pairs before = everyPair(boxes, std::vector<char>(boxes.size(), 1));
  ASSERT_GT(before.size(), 10u);
  const std::vector<Box> bad = {Box(), boxAt(Vec3(kNan, 0, 0), Vec3::Ones()), boxAt(Vec3::Zero(), Vec3(1, kNan, 1)),
                                boxAt(Vec3::Zero(), Vec3(1, 1, -1)),
                                boxAt(Vec3::Zero(), Vec3::Constant(std::numeric_limits<double>::infinity()))};
  boxes.insert(boxes.end(), bad.begin(), bad.end());
  EXPECT_EQ(broad.find(boxes, std::vector<char>(boxes.size(), 1)), before);
  EXPECT_TRUE(broad.find(bad, std::vector<char>(bad.size(), 1)).empty());
  EXPECT_TRUE(broad.find({}, {}).empty());
  EXPECT_EQ(broad.tested(), 0u);
}

TEST(BroadPhase, PointsAndTouchingBoxesOverlap) {
  BroadPhase broad;
  const std::vector<Box> boxes = {boxAt(Vec3::Zero(), Vec3::Ones()), boxAt(Vec3(2, 0, 0), Vec3::Ones()),
                                  boxAt(Vec3(1, 1, 1), Vec3::Zero()), boxAt(Vec3(1, 1, 1), Vec3::Zero()),
                                  boxAt(Vec3(4.001, 0, 0), Vec3::Ones())};
  const Pairs expected = {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}};
  EXPECT_EQ(broad.find(boxes, std::vector<char>(boxes.size(), 1)), expected);
}

TEST(BroadPhase, OneFarAwayChangesNothingForTheOthers) {
  test::Random random(13);
  BroadPhase broad;
  for (const double far : {1e3, 1e6, 1e9}) {
    std::vector<Box> boxes = randomBoxes(random, 200, 1.0, 2.0);
    boxes.push_back(boxAt(Vec3(far, -far, far), Vec3::Ones()));
    const std::vector<char> active(boxes.size(), 1);
    EXPECT_EQ(broad.find(boxes, active), everyPair(boxes, active)) << far;
  }
}

TEST(BroadPhase, BoxesBeyondAllBoundsMeetWhatTheyHold) {
  for (const double far : {1e30, 1e38, 1e39, 1e300}) {
    std::vector<Box> boxes = {boxAt(Vec3::Zero(), Vec3::Constant(far)), boxAt(Vec3::Zero(), Vec3::Ones())};
    BroadPhase broad;
    EXPECT_EQ(broad.find(boxes, {1, 1}), (Pairs{{0, 1}})) << far;
  }
}

TEST(BroadPhase, ComparesFewWhereFewAreNear) {
  std::vector<Box> boxes;
  for (int k = 0; k < 1000; ++k)
    boxes.push_back(boxAt(Vec3(3.0 * (k % 10), 3.0 * (k / 10 % 10), 3.0 * (k / 100)), Vec3::Constant(0.5)));
  BroadPhase broad;
  EXPECT_TRUE(broad.find(boxes, std::vector<char>(boxes.size(), 1)).empty());
  EXPECT_LT(broad.tested(), 1000u);
}

}  // namespace broad_phase_test
}  // namespace meshless
