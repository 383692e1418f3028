#include "meshless_surgery/base/ids.h"

#include <gtest/gtest.h>

namespace meshless {
namespace {

TEST(BodyId, OfASlotUsedAgainIsAnother) {
  const BodyId first{3, 0}, again{3, 1}, other{4, 0};
  EXPECT_EQ(first, (BodyId{3, 0}));
  EXPECT_NE(first, again);
  EXPECT_NE(first, BodyId());
  EXPECT_TRUE(first < again);
  EXPECT_TRUE(again < other);
  EXPECT_FALSE(first < first);
}

}  // namespace
}  // namespace meshless
