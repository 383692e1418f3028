#include "between_states.h"

#include <gtest/gtest.h>

#include <cmath>

namespace meshless {
namespace between_states_test {

TEST(Pace, ArrivesWhenTheNextMessageIsDueAndStaysThere) {
  for (const double interval : {1.0 / 60.0, 1.0 / 30.0, 0.1})
    for (const double picture : {1.0 / 144.0, 1.0 / 60.0, 1.0 / 7.0}) {
      Pace pace;
      EXPECT_FALSE(pace.moving());
      ASSERT_TRUE(pace.next(interval));
      float before = 0.0f;
      double passed = 0.0;
      while (pace.moving()) {
        passed += picture;
        const float share = pace.go(picture);
        EXPECT_GT(share, before);
        EXPECT_LE(share, 1.0f);  // nothing is guessed that no message has said
        if (share < 1.0f) {
          EXPECT_NEAR(passed / interval, share, 1e-5);
        }
        before = share;
      }
      EXPECT_EQ(1.0f, before);
      EXPECT_LT(passed, interval + picture + 1e-9);
      EXPECT_EQ(1.0f, pace.go(picture));
    }
}

TEST(Pace, AfterAPauseOrWithoutOrderItIsShownAtOnce) {
  for (const double interval : {0.0, -0.02, 1.0, std::nan("")}) {
    Pace pace;
    ASSERT_TRUE(pace.next(0.03));
    EXPECT_FALSE(pace.next(interval)) << interval;
    EXPECT_FALSE(pace.moving());
  }
}

meshless_surgery::PickState pick(std::uint32_t id, double x) {
  meshless_surgery::PickState state;
  state.pick_id = id;
  state.position.x = x;
  state.target.y = 2.0 * x;
  return state;
}

TEST(MoveTools, AreOnTheirWayWhereTheyWereThereBefore) {
  meshless_surgery::Surfaces from, to;
  from.picks = {pick(1, 0.1), pick(2, 0.2)};
  to.picks = {pick(2, 0.4), pick(3, 0.5)};
  from.push_shown = to.push_shown = to.scissors_shown = 1;
  from.push_position.z = 1.0;
  to.push_position.z = 2.0;
  from.scissors.position.x = -1.0;
  to.scissors.position.x = 1.0;
  to.scissors.orientation.w = 1.0;
  to.fibres.resize(2);
  to.fibres[1].x = 1.0;
  auto between = to;
  moveTools(from, to, 0.25f, between);
  EXPECT_NEAR(0.25, between.picks[0].position.x, 1e-9);  // by their numbers
  EXPECT_NEAR(0.5, between.picks[0].target.y, 1e-9);
  EXPECT_EQ(0.5, between.picks[1].position.x);
  EXPECT_NEAR(1.25, between.push_position.z, 1e-9);
  EXPECT_EQ(1.0, between.scissors.position.x);  // they were not there
  EXPECT_EQ(1.0, between.fibres[1].x);          // others
  moveTools(from, to, 1.0f, between);
  EXPECT_NEAR(0.4, between.picks[0].position.x, 1e-9);
  EXPECT_NEAR(2.0, between.push_position.z, 1e-9);
}

TEST(MoveTools, ScissorsTurnTheShortWay) {
  meshless_surgery::Surfaces from, to;
  from.scissors_shown = to.scissors_shown = 1;
  from.scissors.orientation.w = 1.0;
  to.scissors.orientation.w = -std::cos(0.2);  // the same as turned by 0.4 rad
  to.scissors.orientation.z = -std::sin(0.2);
  from.scissors_angle = 0.2;
  to.scissors_angle = 0.6;
  auto between = to;
  moveTools(from, to, 0.5f, between);
  EXPECT_NEAR(std::cos(0.1), std::abs(between.scissors.orientation.w), 1e-3);
  EXPECT_NEAR(0.4, between.scissors_angle, 1e-6);
}

TEST(MoveTools, PartsOfInstrumentsMoveWithTheirTools) {
  const auto part = [](const char* mesh, double x, double turn) {
    meshless_surgery::InstrumentPart made;
    made.mesh = mesh;
    made.pose.position.x = x;
    made.pose.orientation.w = std::cos(0.5 * turn);
    made.pose.orientation.z = std::sin(0.5 * turn);
    return made;
  };
  meshless_surgery::Surfaces from, to;
  from.instruments = {part("shaft", 0.0, 0.0), part("jaw", 0.0, 0.2)};
  to.instruments = {part("shaft", 0.4, 0.0), part("jaw", 0.4, 0.6)};
  auto between = to;
  moveTools(from, to, 0.5f, between);
  EXPECT_NEAR(0.2, between.instruments[0].pose.position.x, 1e-9);
  EXPECT_NEAR(std::sin(0.2), between.instruments[1].pose.orientation.z, 1e-3);
  from.instruments.push_back(part("shaft", 1.0, 0.0));  // another tool, which has gone
  between = to;
  moveTools(from, to, 0.5f, between);
  EXPECT_EQ(0.4, between.instruments[0].pose.position.x);
}

}  // namespace between_states_test
}  // namespace meshless
