#include "meshless_surgery/geometry/query/nearest_on_triangle.h"

#include <gtest/gtest.h>

#include "support/random.h"

namespace meshless {
namespace nearest_on_triangle_test {

TEST(NearestOnTriangle, NoSampleOfTheTriangleIsNearer) {
  test::Random random(7);
  for (int trial = 0; trial < 2000; ++trial) {
    const Vec3 a = random.vector(1), b = random.vector(1);
    const Vec3 c = trial % 10 == 0 ? Vec3(a + 0.3 * (b - a)) : random.vector(1);  // some without area
    const Vec3 p = random.vector(2);
    const Vec3 w = nearestWeights(p, a, b, c);
    EXPECT_GE(w.minCoeff(), -1e-15);
    EXPECT_NEAR(w.sum(), 1.0, 1e-14);
    const Vec3 nearest = nearestOnTriangle(p, a, b, c);
    EXPECT_LT((nearest - (w.x() * a + w.y() * b + w.z() * c)).norm(), 1e-14);
    const double distance = (nearest - p).norm();
    for (int k = 0; k < 50; ++k) {
      double u = random.uniform(0, 1), v = random.uniform(0, 1);
      if (u + v > 1) u = 1 - u, v = 1 - v;
      EXPECT_GE((a + u * (b - a) + v * (c - a) - p).norm(), distance - 1e-9);
    }
    for (const Vec3& corner : {a, b, c}) EXPECT_GE((corner - p).norm(), distance - 1e-9);
  }
}

TEST(NearestOnTriangle, APointOnItIsItself) {
  const Vec3 a(0, 0, 0), b(1, 0, 0), c(0, 1, 0);
  EXPECT_EQ(nearestWeights(Vec3(0.25, 0.25, 5), a, b, c), Vec3(0.5, 0.25, 0.25));
  EXPECT_EQ(nearestWeights(a, a, b, c), Vec3(1, 0, 0));
  EXPECT_EQ(nearestWeights(a, a, a, a), Vec3(1, 0, 0));
}

}  // namespace nearest_on_triangle_test
}  // namespace meshless
