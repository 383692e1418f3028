#include "meshless_surgery/dynamics/extent.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace meshless {
namespace extent_test {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN(), kInfinite = std::numeric_limits<double>::infinity();

TEST(Extent, BoundsAreThoseOfPointAfterPoint) {
  std::mt19937 engine(3);
  std::normal_distribution<double> value(-2.0, 5.0);
  for (std::size_t count = 0; count < 40; ++count) {
    Points points;
    Box expected;
    for (std::size_t i = 0; i < count; ++i) {
      points.push_back(Vec3(value(engine), value(engine), value(engine)));
      expected.extend(points.back());
    }
    for (const InstructionSet set : {InstructionSet::kBaseline, widestInstructionSet()}) {
      const Box box = extentOf(points, set);
      EXPECT_EQ(box.min, expected.min) << count;
      EXPECT_EQ(box.max, expected.max) << count;
      EXPECT_EQ(box.empty(), count == 0);
      EXPECT_TRUE(allWithin(points, 100.0, set));
    }
  }
}

TEST(Extent, OneCoordinateBeyondIsSeenWhereverItIs) {
  for (std::size_t count : {0, 1, 2, 7, 32})
    EXPECT_TRUE(allWithin(Points(count, Vec3(-1e12, 1e12, -0.0)), 1e12)) << count;
  for (std::size_t count : {1, 2, 7, 32})
    for (std::size_t i = 0; i < count; ++i)
      for (int d = 0; d < 3; ++d)
        for (const double bad : {kNan, -kNan, kInfinite, -kInfinite, std::nextafter(1e12, kInfinite), -1.1e12}) {
          Points points(count, Vec3(0.5, -3e11, 1e-310));
          points[i][d] = bad;
          EXPECT_FALSE(allWithin(points, 1e12, InstructionSet::kBaseline)) << bad << " at " << i << ", " << d;
          EXPECT_FALSE(allWithin(points, 1e12)) << bad << " at " << i << ", " << d;
        }
}

}  // namespace extent_test
}  // namespace meshless
