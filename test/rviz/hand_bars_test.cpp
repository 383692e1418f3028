#include "hand_bars.h"

#include <gtest/gtest.h>

namespace meshless {
namespace {

TEST(HandBars, AreOfInstrumentsAndOfPicksThatAHandHolds) {
  meshless_surgery::State state;
  state.instruments.resize(2);
  state.instruments[0].name = "left";
  state.instruments[0].force.x = 3.0;
  state.instruments[0].force.z = -4.0;
  state.instruments[0].holds = "liver";
  state.instruments[0].grip = 2.34;
  state.instruments[1].name = "right";
  state.picks.resize(2);
  state.picks[0].pick_id = 7;
  state.picks[0].locked = true;
  state.picks[1].pick_id = 8;
  state.picks[1].body = "fat";
  state.picks[1].force.y = 0.25;
  const std::vector<HandForce> hands = handForces(state);
  ASSERT_EQ(3u, hands.size());
  EXPECT_EQ("left", hands[0].name.toStdString());
  EXPECT_DOUBLE_EQ(5.0, hands[0].force);
  EXPECT_EQ("5.00 N, grips liver with 2.3 N", forceText(hands[0]).toStdString());
  EXPECT_EQ("right", hands[1].name.toStdString());
  EXPECT_EQ("0.00 N", forceText(hands[1]).toStdString());
  EXPECT_EQ("pick 8", hands[2].name.toStdString());
  EXPECT_EQ("0.25 N, holds fat", forceText(hands[2]).toStdString());
  EXPECT_TRUE(handForces(meshless_surgery::State()).empty());
}

}  // namespace
}  // namespace meshless
