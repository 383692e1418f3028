#include "meshless_surgery/training/tool_crossings.h"

#include <gtest/gtest.h>

#include "support/random.h"
#include "training/played.h"

namespace meshless {
namespace tool_crossings_test {

using test::Played;

TEST(SegmentDistance, IsTheLeastOfManyPairsOfPoints) {
  test::Random random(1);
  const auto place = [&] { return random.vector(1.0); };
  for (int k = 0; k < 300; ++k) {
    const Vec3 a = place(), c = place();
    const Vec3 b = k % 5 == 0 ? a : place();                        // a point
    const Vec3 d = k % 7 == 0 ? Vec3(c + 0.7 * (b - a)) : place();  // parallel
    double least = 1e300;
    constexpr int kSteps = 200;
    for (int i = 0; i <= kSteps; ++i)
      for (int j = 0; j <= kSteps; ++j)
        least = std::min(least, (a + (b - a) * i / kSteps - c - (d - c) * j / kSteps).norm());
    const double distance = segmentDistance(a, b, c, d);
    EXPECT_LE(distance, least + 1e-12);
    EXPECT_GE(distance, least - 0.02);
    EXPECT_NEAR(distance, segmentDistance(d, c, b, a), 1e-12);
  }
}

// A second hand goes through the line of the first, or beside it.
TEST(InstrumentCrossings, ArePlantedSlowlyAtOnceAndBeside) {
  struct Case {
    std::string name;
    double height;  // [m] above the first hand at which the second one's end passes
    int steps;      // that a way across takes
    double met;
  };
  for (const Case& c : {Case{"slowly", -0.02, 120, 3.0}, Case{"in one step", -0.02, 1, 3.0},
                        Case{"beside, by 1 mm more", 0.006, 120, 0.0}, Case{"touching", 0.004, 120, 3.0}}) {
    SCOPED_TRACE(c.name);
    Played played(test::weightless(), test::openTask());
    ASSERT_TRUE(played.world.addSceneBody(test::shared(test::block("tissue"))).ok());
    ASSERT_TRUE(played.world.addSceneBody(test::shared(test::block("other", Vec3(0, 1, 0.2)))).ok());
    played.begin();
    PickCommand pick;
    pick.stiffness = 1e-3;
    pick.point = Vec3(0, 0, 0.4);
    pick.direction = -Vec3::UnitZ();
    const auto first = played.apply<PickReply>(pick);
    pick.point = Vec3(0, 1, 0.4);
    const auto second = played.apply<PickReply>(pick);
    // The first hand is above its tissue; the second one draws its line along y.
    const Vec3 top(0, 0, 0.45);
    played.apply<Done>(MovePickCommand{first.pick, top});
    played.step(2);
    EXPECT_EQ(0.0, played.value("instrument_crossings"));
    double from = 0.3;
    played.apply<Done>(MovePickCommand{second.pick, Vec3(from, 0, top.z() + c.height)});
    played.step(2);
    for (int way = 0; way < 3; ++way, from = -from)
      for (int k = 1; k <= c.steps; ++k) {
        const double x = from - 2.0 * from * k / c.steps;
        played.apply<Done>(MovePickCommand{second.pick, Vec3(x, 0, top.z() + c.height)});
        played.step();
      }
    EXPECT_EQ(c.met, played.value("instrument_crossings"));
    test::expectSame(played.training, *played.replayed());
  }
}

TEST(InstrumentCrossings, OfThePushSphereCountItsRadius) {
  for (const double beside : {0.021, 0.024}) {
    Played played(test::weightless(), test::openTask());
    ASSERT_TRUE(played.world.addSceneBody(test::shared(test::block("tissue"))).ok());
    played.begin();
    PickCommand pick;
    pick.point = Vec3(0, 0, 0.4);
    pick.direction = -Vec3::UnitZ();
    pick.stiffness = 1e-3;
    const auto picked = played.apply<PickReply>(pick);
    played.apply<Done>(MovePickCommand{picked.pick, Vec3(0, 0, 0.6)});
    PushCommand push;
    push.radius = 0.02;
    for (const double x : {0.3, beside, 0.3}) {
      push.position = Vec3(x, 0, 0.5);
      played.apply<Done>(push);
      played.step(3);
    }
    EXPECT_EQ(beside < 0.0225 ? 1.0 : 0.0, played.value("instrument_crossings"));
  }
}

}  // namespace tool_crossings_test
}  // namespace meshless
