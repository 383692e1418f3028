#include "ros/border_check.h"

#include <limits>

#include <gtest/gtest.h>

namespace meshless {
namespace border_check_test {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

geometry_msgs::Quaternion quaternion(double x, double y, double z, double w) {
  geometry_msgs::Quaternion q;
  q.x = x;
  q.y = y;
  q.z = z;
  q.w = w;
  return q;
}

TEST(BorderCheck, AcceptsTheEndsOfARangeAndRefusesWhatIsBeyondOrNoNumber) {
  for (const double good : {0.0, 0.5, 2.0}) {
    BorderCheck check;
    EXPECT_EQ(good, check.number("radius", good, 0.0, 2.0, "m"));
    EXPECT_TRUE(check.ok()) << good;
  }
  for (const double bad : {-1e-300, 2.0000001, kNan, kInf, -kInf}) {
    BorderCheck check;
    check.number("radius", bad, 0.0, 2.0, "m");
    ASSERT_FALSE(check.ok()) << bad;
    EXPECT_EQ(ErrorCode::kInvalidArgument, check.error().code);
  }
}

TEST(BorderCheck, SaysFieldValueAndRange) {
  BorderCheck check;
  check.number("radius", -0.25, 0.0, 2.0, "m");
  ASSERT_FALSE(check.ok());
  EXPECT_EQ("radius is -0.25; accepted: 0..2 m", check.error().detail);
}

TEST(BorderCheck, KeepsTheFirstFault) {
  BorderCheck check;
  check.number("first", kNan, 0.0, 1.0, "");
  check.number("second", kNan, 0.0, 1.0, "");
  ASSERT_FALSE(check.ok());
  EXPECT_EQ("first is nan; accepted: 0..1", check.error().detail);
}

TEST(BorderCheck, EachCoordinateOfAPointIsLookedAt) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double bad : {kNan, kInf, -kInf, 2.0 * kMaxSaid}) {
      geometry_msgs::Point point;
      (axis == 0 ? point.x : axis == 1 ? point.y : point.z) = bad;
      BorderCheck check;
      check.point("target", point);
      ASSERT_FALSE(check.ok());
      EXPECT_EQ(0u, check.error().detail.find(std::string("target.") + "xyz"[axis])) << check.error().detail;
    }
  }
}

// What counts is where it is in the world: a map's frame begins far away.
TEST(BorderCheck, APlaceIsLookedAtInTheWorld) {
  Pose map;
  map.translation = Vec3(-5e5, -5.2e6, 0.0);
  BorderCheck check;
  EXPECT_EQ(Vec3(1.0, 2.0, 3.0), check.place("target", map, Vec3(500001.0, 5200002.0, 3.0)));
  EXPECT_TRUE(check.ok());
  check.place("target", map, Vec3::Zero());
  ASSERT_FALSE(check.ok());
  EXPECT_EQ("in the world frame, target.y is -5.2e+06; accepted: -1e+06..1e+06 m", check.error().detail);
}

TEST(BorderCheck, WhatIsJustOutsideIsSaidInAllItsDigits) {
  BorderCheck check;
  check.number("scale", 1000001.0, 0.0, 1e6, "");
  EXPECT_EQ("scale is 1000001; accepted: 0..1e+06", check.error().detail);
}

TEST(BorderCheck, NormalisesQuaternionsAndRefusesThoseWithoutADirection) {
  for (const double scale : {1e-5, 1.0, 1e5}) {
    BorderCheck check;
    const Quat q = check.rotation("q", quaternion(0.0, scale, 0.0, scale));
    ASSERT_TRUE(check.ok()) << scale;
    EXPECT_NEAR(1.0, q.norm(), 1e-12);
    EXPECT_LT((q * Vec3::UnitX() + Vec3::UnitZ()).norm(), 1e-12);
  }
  for (const auto& bad : {quaternion(0, 0, 0, 1e-7), quaternion(kNan, 0, 0, 1), quaternion(0, kInf, 0, 1),
                          quaternion(0, 0, -kInf, 1), quaternion(0, 0, 0, kNan)}) {
    BorderCheck check;
    const Quat q = check.rotation("q", bad);
    EXPECT_FALSE(check.ok());
    EXPECT_NEAR(1.0, q.norm(), 1e-12) << "what is refused must still be no poison";
  }
}

TEST(BorderCheck, AnOrientationThatWasLeftOutIsTheIdentity) {
  geometry_msgs::Pose pose;
  pose.position.x = 0.5;
  BorderCheck check;
  const Pose read = check.pose("pose", pose);
  EXPECT_TRUE(check.ok());
  EXPECT_EQ(Vec3(0.5, 0.0, 0.0), read.translation);
  EXPECT_EQ(Quat::Identity().coeffs(), read.rotation.coeffs());
}

TEST(BorderCheck, NewNamesArePlain) {
  for (const char* good : {"", "liver", "liver.1", "A_b-3"}) {
    BorderCheck check;
    check.newName("name", good);
    EXPECT_TRUE(check.ok()) << good;
  }
  for (const std::string& bad : {std::string("a b"), std::string("a/b"), std::string("a\nb"), std::string("\xc3\xa4"),
                                 std::string(101, 'a'), std::string("a\0b", 3)}) {
    BorderCheck check;
    check.newName("name", bad);
    EXPECT_FALSE(check.ok()) << bad;
  }
}

TEST(BorderCheck, NamesOfBodiesAreNotEmptyAndNotEndless) {
  BorderCheck good;
  good.names("bodies", {"liver", "any thing"});
  EXPECT_TRUE(good.ok());
  BorderCheck empty;
  empty.names("bodies", {"liver", ""});
  ASSERT_FALSE(empty.ok());
  EXPECT_EQ(0u, empty.error().detail.find("bodies[1] is ''"));
  BorderCheck endless;
  endless.names("bodies", {std::string(100000, 'a')});
  ASSERT_FALSE(endless.ok());
  EXPECT_LT(endless.error().detail.size(), 300u);
}

TEST(Printable, HidesControlCharactersAndIsBounded) {
  EXPECT_EQ("a?b?", printable("a\nb\x1b"));
  EXPECT_EQ(std::string(100, 'x') + "...", printable(std::string(5000, 'x')));
  EXPECT_EQ(std::string(100, 'x'), printable(std::string(100, 'x')));
}

TEST(Printable, IsUtf8WhateverComes) {
  const std::string characters = "a\xc3\xa4\xe2\x82\xac\xf0\x9f\x90\x9f\xef\xbf\xbf\xf4\x8f\xbf\xbf";
  EXPECT_EQ(characters, printable(characters));
  EXPECT_EQ("?", printable("\xc3"));                 // cut off
  EXPECT_EQ("???'", printable("\xe2\x82\xff'"));     // broken off
  EXPECT_EQ("?'", printable("\xc3'"));               // whoever quotes it keeps the quote
  EXPECT_EQ("??", printable("\xc0\xaf"));            // a slash, longer than need be
  EXPECT_EQ("???", printable("\xe0\x9f\xbf"));       // so is this one
  EXPECT_EQ("????", printable("\xf0\x8f\xbf\xbf"));  // and this
  EXPECT_EQ("???", printable("\xed\xa0\x80"));       // half of a pair
  EXPECT_EQ("????", printable("\xf4\x90\x80\x80"));  // beyond the last
  EXPECT_EQ("??", printable("\x80\xf5"));
  // Not cut in the middle of a character.
  EXPECT_EQ("aa...", printable("aa\xe2\x82\xac", 4));
  EXPECT_EQ("aa\xe2\x82\xac", printable("aa\xe2\x82\xac", 5));
}

}  // namespace border_check_test
}  // namespace meshless
