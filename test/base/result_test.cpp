#include "meshless_surgery/base/result.h"

#include <gtest/gtest.h>

#include "meshless_surgery/base/types.h"

namespace meshless {
namespace {

Result<int> half(int n) {
  if (n % 2 != 0) return Error{ErrorCode::kInvalidArgument, std::to_string(n) + " is odd"};
  return n / 2;
}

TEST(Result, HoldsAValueOrAnErrorThatSaysWhy) {
  const Result<int> good = half(8);
  ASSERT_TRUE(good.ok());
  EXPECT_EQ(*good, 4);
  const Result<int> bad = half(7);
  ASSERT_FALSE(bad);
  EXPECT_EQ(bad.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(bad.error().detail, "7 is odd");
}

TEST(Box, OfNothingIsEmptyAndContainsNothing) {
  Box box;
  EXPECT_TRUE(box.empty());
  EXPECT_EQ(box.diagonal(), 0.0);
  EXPECT_FALSE(box.contains(Vec3::Zero()));
  box.extend(Vec3(1, 2, 3));
  box.extend(Vec3(-1, 2, 3));
  EXPECT_FALSE(box.empty());
  EXPECT_DOUBLE_EQ(box.diagonal(), 2.0);
  EXPECT_TRUE(box.contains(Vec3(0, 2, 3)));
  EXPECT_FALSE(box.contains(Vec3(0, 2.1, 3)));
}

TEST(Pose, TurnsThenMoves) {
  const Pose pose{Quat(Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ())), Vec3(1, 0, 0)};
  EXPECT_LT((pose * Vec3(1, 0, 0) - Vec3(1, 1, 0)).norm(), 1e-15);
}

}  // namespace
}  // namespace meshless
