#include "hand_stream.h"

#include <atomic>
#include <chrono>

#include <gtest/gtest.h>

namespace meshless {
namespace hand_stream_test {

void sleepFor(int milliseconds) { std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds)); }

/// Whether a number is reached, however long it takes.
bool reaches(const std::atomic<int>& number, int wanted) {
  for (int i = 0; number < wanted && i < 6000; ++i) sleepFor(10);
  return number >= wanted;
}

TEST(HandStream, SaysTheLastAgainWhoeverElseIsBusy) {
  std::atomic<int> first{0}, second{0};
  HandStream stream;
  stream.say([&] { ++first; });
  EXPECT_GE(first, 1) << "at once";
  ASSERT_TRUE(reaches(first, 4));  // nobody but its own thread says so
  stream.say([&] { ++second; });
  const int before = first;
  ASSERT_TRUE(reaches(second, 4));
  EXPECT_EQ(before, first) << "the former one";
}

TEST(HandStream, SaysNothingOnceItIsHushedOrGone) {
  std::atomic<int> said{0};
  {
    HandStream stream;
    stream.say([&] { ++said; });
    stream.hush();
    const int before = said;
    sleepFor(300);
    EXPECT_EQ(before, said);
    stream.say([&] { ++said; });
    ASSERT_TRUE(reaches(said, before + 2));
  }
  const int before = said;
  sleepFor(300);
  EXPECT_EQ(before, said);
}

}  // namespace hand_stream_test
}  // namespace meshless
