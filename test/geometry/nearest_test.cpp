#include "meshless_surgery/geometry/query/nearest.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/random.h"

namespace meshless {
namespace nearest_test {

TEST(NearestPoints, AgreeWithLookingAtEveryPoint) {
  test::Random random(1);
  Points points;
  for (int i = 0; i < 2000; ++i) points.push_back(random.vector(1.0));
  const NearestPoints nearest(points);
  for (int query = 0; query < 300; ++query) {
    const Vec3 p = random.vector(1.5);
    std::vector<std::pair<double, Index>> order;
    for (Index i = 0; i < points.size(); ++i) order.emplace_back((points[i] - p).squaredNorm(), i);
    std::sort(order.begin(), order.end());
    EXPECT_EQ(nearest.nearest(p), order[0].second);
    const std::vector<Index> five = nearest.nearest(p, 5);
    ASSERT_EQ(five.size(), 5u);
    for (int k = 0; k < 5; ++k) EXPECT_EQ(five[static_cast<std::size_t>(k)], order[static_cast<std::size_t>(k)].second);
    const double radius = random.uniform(0.0, 0.5);
    std::vector<Index> within;
    for (Index i = 0; i < points.size(); ++i)
      if ((points[i] - p).norm() < radius) within.push_back(i);
    EXPECT_EQ(nearest.within(p, radius), within);
  }
}

TEST(NearestPoints, TiesGoToTheLowerIndex) {
  const NearestPoints nearest({Vec3(1, 0, 0), Vec3(-1, 0, 0), Vec3(0, 1, 0), Vec3(-1, 0, 0)});
  EXPECT_EQ(nearest.nearest(Vec3(-2, 0, 0)), 1u);
  EXPECT_EQ(nearest.nearest(Vec3(-2, 0, 0), 2), (std::vector<Index>{1, 3}));
}

TEST(NearestPoints, OfNothingAreNone) {
  const NearestPoints nearest(Points{});
  EXPECT_EQ(nearest.nearest(Vec3::Zero()), kNoIndex);
  EXPECT_TRUE(nearest.nearest(Vec3::Zero(), 3).empty());
  EXPECT_TRUE(nearest.within(Vec3::Zero(), 1.0).empty());
}

}  // namespace nearest_test
}  // namespace meshless
