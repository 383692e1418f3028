#include "ros/tool_motion.h"

#include <gtest/gtest.h>

namespace meshless {
namespace tool_motion_test {

Pose at(double x, double angle = 0.0) {
  Pose pose;
  pose.translation = Vec3(x, 0, 0);
  pose.rotation = Quat(Eigen::AngleAxisd(angle, Vec3::UnitZ()));
  return pose;
}

TEST(ToolMotion, AppearsWhereTheStreamIs) {
  ToolMotion motion({1.0, 10.0, 0.5});
  EXPECT_FALSE(motion.alive());
  EXPECT_TRUE(motion.hear(at(3.0), 0.0, 100.0).ok());
  EXPECT_TRUE(motion.alive());
  EXPECT_TRUE(motion.arrived());
  EXPECT_EQ(motion.pose().translation.x(), 3.0);
}

TEST(ToolMotion, AJumpIsTakenAtTheBoundedSpeed) {
  ToolMotion motion({2.0, 100.0, 0.5});
  ASSERT_TRUE(motion.hear(at(0.0), 0.0, 0.0).ok());
  ASSERT_TRUE(motion.hear(at(0.1, 1.0), 0.0, 0.005).ok());
  double time = 0.005;
  double before = 0.0;
  motion.advance(time);
  EXPECT_NEAR(motion.pose().translation.x(), 0.01, 1e-12);
  while (!motion.arrived()) {
    before = motion.pose().translation.x();
    time += 0.005;
    motion.advance(time);
    EXPECT_LE(motion.pose().translation.x() - before, 0.01 + 1e-12);
    ASSERT_LT(time, 1.0);
  }
  EXPECT_NEAR(time, 0.05, 0.006);
  EXPECT_EQ(motion.pose().translation.x(), 0.1);
  EXPECT_EQ(motion.pose().rotation.coeffs(), at(0.1, 1.0).rotation.coeffs());
}

TEST(ToolMotion, TurnsAreBoundedToo) {
  ToolMotion motion({100.0, 10.0, 0.5});
  ASSERT_TRUE(motion.hear(at(0.0), 0.0, 0.0).ok());
  ASSERT_TRUE(motion.hear(at(0.0, 1.0), 0.0, 0.0).ok());
  motion.advance(0.02);
  EXPECT_NEAR(motion.pose().rotation.angularDistance(at(0.0).rotation), 0.2, 1e-9);
}

TEST(ToolMotion, WhoComesLateDoesNotJump) {
  ToolMotion motion({1.0, 10.0, 0.0});
  ASSERT_TRUE(motion.hear(at(0.0), 0.0, 0.0).ok());
  ASSERT_TRUE(motion.hear(at(9.0), 0.0, 3.0).ok());
  motion.advance(3.0);
  EXPECT_NEAR(motion.pose().translation.x(), 0.05, 1e-12);
}

TEST(ToolMotion, OldMessagesAreRefusedWhileNewerOnesCome) {
  ToolMotion motion({1.0, 10.0, 0.5});
  ASSERT_TRUE(motion.hear(at(0.0), 50.00, 0.0).ok());
  ASSERT_TRUE(motion.hear(at(0.1), 50.01, 0.01).ok());
  const Status late = motion.hear(at(0.0), 50.00, 0.02);
  ASSERT_FALSE(late.ok());
  EXPECT_EQ(late.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(late.error().detail.find("older"), std::string::npos);
  EXPECT_EQ(motion.wanted().translation.x(), 0.1);
  EXPECT_TRUE(motion.hear(at(0.2), 50.01, 0.03).ok());  // a coarse clock
  EXPECT_TRUE(motion.hear(at(0.3), 0.0, 0.04).ok());    // no stamp
  EXPECT_FALSE(motion.hear(at(0.4), 20.0, 0.05).ok());
  EXPECT_TRUE(motion.hear(at(0.4), 20.0, 0.14).ok());  // played again
}

// Beside newer ones, however many: of a second sender whose clock is behind.
TEST(ToolMotion, ASenderThatIsAlwaysLateIsNeverHeard) {
  for (const double behind : {0.001, 0.3, 5.0}) {
    ToolMotion motion({1.0, 10.0, 0.5});
    for (int k = 0; k < 500; ++k) {
      const double now = 0.02 * k;
      ASSERT_TRUE(motion.hear(at(1.0), 100.0 + now, now).ok());
      ASSERT_FALSE(motion.hear(at(2.0), 100.0 + now - behind, now + 0.01).ok());
    }
  }
}

// Whatever is wrong with stamps, once or for good.
TEST(ToolMotion, NoJumpOfAStampEndsAStreamThatGoesOn) {
  for (const double silence : {0.5, 0.1})
    for (const double period : {0.002, 0.01, 0.05})
      for (const double jump : {-90.0, -2.0, -0.95, -0.6, -0.3, -0.01, 0.01, 0.3, 0.6, 0.95, 2.0, 90.0, 1e9})
        for (const bool once : {true, false}) {
          SCOPED_TRACE(::testing::Message() << silence << " s, every " << period << " s, by " << jump << " s"
                                            << (once ? ", once" : ", for good"));
          ToolMotion motion({1.0, 10.0, silence});
          double heard = 0.0, unheard = 0.0;  // [s] when it was last; without it, at most
          for (int tick = 0; tick < 4000; ++tick) {
            const double now = 0.001 * tick;
            if (tick % static_cast<int>(1000 * period + 0.5) == 0) {
              const bool jumps = once ? tick == 1000 : tick >= 1000;
              if (motion.hear(at(now), 100.0 + now + (jumps ? jump : 0.0), now).ok()) heard = now;
            }
            unheard = std::max(unheard, now - heard);
            ASSERT_FALSE(motion.fellSilent(now)) << "at " << now;
          }
          EXPECT_LE(unheard, StampOrder::kLongestLate + 2.0 * period);
        }
}

/// Looked at every 10 ms; when it fell silent, or `until`.
double silentAt(ToolMotion& motion, double now, double until) {
  for (; now < until; now += 0.01)
    if (motion.fellSilent(now)) return now;
  return until;
}

TEST(ToolMotion, SilenceIsSaidOnceAndThenItBeginsAnew) {
  ToolMotion motion({1.0, 10.0, 0.5});
  EXPECT_EQ(silentAt(motion, 0.0, 10.0), 10.0);
  ASSERT_TRUE(motion.hear(at(0.0), 7.0, 10.0).ok());
  EXPECT_EQ(silentAt(motion, 10.0, 10.4), 10.4);
  motion.keepAlive(10.4);
  EXPECT_NEAR(silentAt(motion, 10.4, 12.0), 10.905, 0.0075);
  EXPECT_FALSE(motion.alive());
  EXPECT_EQ(silentAt(motion, 11.0, 13.0), 13.0);
  ASSERT_TRUE(motion.hear(at(5.0), 6.9, 13.0).ok());
  EXPECT_EQ(motion.pose().translation.x(), 5.0);
}

TEST(ToolMotion, WhoLooksLateHeardNoSilence) {
  ToolMotion motion({1.0, 10.0, 0.5});
  ASSERT_TRUE(motion.hear(at(0.0), 0.0, 0.0).ok());
  EXPECT_FALSE(motion.fellSilent(1000.0));
  EXPECT_NEAR(silentAt(motion, 1000.0, 1002.0), 1000.455, 0.0075);
}

TEST(ToolMotion, WithoutALimitItMayBeSilent) {
  ToolMotion motion({1.0, 10.0, 0.0});
  ASSERT_TRUE(motion.hear(at(0.0), 0.0, 0.0).ok());
  EXPECT_EQ(silentAt(motion, 0.0, 1000.0), 1000.0);
}

}  // namespace tool_motion_test
}  // namespace meshless
