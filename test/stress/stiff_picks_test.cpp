// Stiff picks drag a body at random, at 30 m/s, against others and through the ground. Contacts, depenetration and
// lifting off the ground move the tissue against the pick. It must not answer with energy: it drags, and does not
// throw.
#include <gtest/gtest.h>

#include "support/stress_cases.h"

namespace meshless::stress {
namespace stiff_picks_test {

constexpr int kDragged = 60, kHeld = 60, kFree = 180;  // steps
// [J] kinetic. All three blocks (6 kg) as fast as the target's longest jump (1.73 m) within a step have 1.3e5 J: what a
// stiff pick drags has no more. 6e4 J was seen at the most.
constexpr double kMostDragged = 1.5e5;
// Elastic bodies, in contact of surfaces, are torn to threads, and overlaps that open then give them energy: 2.7e7 J
// was seen, and 2.4 times of what they had when they are let go.
constexpr double kMostDraggedElastic = 6e7, kMostGainedElastic = 5.0;
// [J] kinetic, of 2 kg that are pulled by 0.57 m within a step: 4.7e3 J. Contact adds to it, up to 1.1e4 J.
constexpr double kMostPulled = 2.2e4;

struct StiffPick {
  std::string name;
  double stiffness;  // [N/m]
  bool on_ground;
};

void PrintTo(const StiffPick& stiff_pick, std::ostream* out) { *out << stiff_pick.name; }

std::vector<StiffPick> allStiffPicks() {
  std::vector<StiffPick> stiff_picks;
  for (const double exponent : {6.0, 9.0, 11.0, 12.0})
    for (const bool ground : {true, false})
      stiff_picks.push_back(
          {"1e" + std::to_string(static_cast<int>(exponent)) + " N per m " + (ground ? "on the ground" : "in space"),
           std::pow(10.0, exponent), ground});
  return stiff_picks;
}

class StiffPicks : public testing::TestWithParam<std::tuple<Kind, StiffPick>> {};

TEST_P(StiffPicks, DoNotThrow) {
  const auto& [kind, stiff_pick] = GetParam();
  WorldSettings settings = test::weightless();
  if (stiff_pick.on_ground) {
    settings = WorldSettings();
    settings.ground = -0.1;
  }
  Kind coarse = kind;
  coarse.bodies = 36;
  Twins twins(settings);
  for (int b = 0; b < 3; ++b)
    twins.spawn(test::shared(blockOf(coarse, "block" + std::to_string(b), Vec3(0.25 * b, 0, 0))));
  PickCommand pick;
  pick.point = Vec3(0.1, 0.05, 0.05);
  pick.max_distance = 1.0;
  pick.stiffness = stiff_pick.stiffness;
  const PickId held = test::replyOf<PickReply>(twins.apply(pick)).pick;
  test::Random random(0);
  double dragged = 0.0, most = 0.0;  // [J] when the drag ended, and after
  for (int step = 0; step < kDragged + kHeld + kFree; ++step) {
    if (step < kDragged) EXPECT_TRUE(twins.apply(MovePickCommand{held, random.vector(0.5)}).ok());
    if (step == kDragged + kHeld) twins.attempt(ClearPicksCommand{});
    ASSERT_TRUE(twins.step(Vec3::Zero(), kind.elastic ? 2e4 : 2e3));  // [m] a thread that snaps flies far
    double kinetic = 0.0, energy = 0.0;
    for (const BodySnapshot& body : twins.seen().bodies) {
      kinetic += body.measures.kinetic_energy;
      energy += deformationEnergy(*body.model, body.material, 1.0 / settings.step_rate, body.particles);
    }
    energy += kinetic;
    ASSERT_LT(kinetic, kind.elastic ? kMostDraggedElastic : kMostDragged) << "step " << step;
    if (step == kDragged + kHeld) dragged = energy;
    if (step > kDragged + kHeld) most = std::max(most, energy);
  }
  // What flies apart then falls, and meets others; more than it had it does not get.
  RecordProperty("dragged", std::to_string(dragged));
  RecordProperty("most", std::to_string(most));
  if (stiff_pick.on_ground) return;
  // What is let go almost at rest may gain more of its own, as what is pulled through others does.
  const double allowed = kind.elastic ? std::max(kMostGainedElastic * dragged, kMostPulled) : 1.1 * dragged;
  EXPECT_LE(most, allowed + 1e-6);
}

struct Held {
  std::string name;
  int substeps;
  bool contact;
};

void PrintTo(const Held& held, std::ostream* out) { *out << held.name; }

std::vector<Held> allHeld() {
  std::vector<Held> all;
  for (const int substeps : {1, 8, 33, 50})
    for (const bool contact : {false, true})
      all.push_back({std::to_string(substeps) + " substeps" + (contact ? " with contact" : ""), substeps, contact});
  return all;
}

class HeldInTheGround : public testing::TestWithParam<std::tuple<Kind, Held>> {};

// A body that lies there is pulled to a place half a metre below. The ground and the stiff pick contradict each other.
TEST_P(HeldInTheGround, AreNotThrown) {
  const auto& [kind, held] = GetParam();
  WorldSettings settings;
  settings.ground = -0.1;
  settings.substeps = held.substeps;
  if (!held.contact) settings.contact = ContactMethod::kNone;
  Kind coarse = kind;
  coarse.bodies = 36;
  Twins twins(settings);
  twins.spawn(test::shared(blockOf(coarse, "block", Vec3(0.15, 0, -0.049))));
  for (int step = 0; step < 60; ++step) ASSERT_TRUE(twins.step(Vec3::Zero(), 10.0));
  PickCommand pick;
  pick.point = Vec3(0.0, 0.1, -0.1);
  pick.max_distance = 1.0;
  pick.stiffness = 1e8;
  const PickId stiff_pick = test::replyOf<PickReply>(twins.apply(pick)).pick;
  twins.attempt(LockCommand{stiff_pick, Vec3(0.3, 0.3, -0.55)});
  for (int step = 0; step < 60; ++step) {
    ASSERT_TRUE(twins.step(Vec3::Zero(), 1e3));
    ASSERT_LT(twins.seen().bodies[0].measures.kinetic_energy, kMostPulled) << "step " << step;
  }
}

INSTANTIATE_TEST_SUITE_P(Stress, HeldInTheGround, testing::ValuesIn(crossed(kindsAlone(), allHeld())),
                         crossedName<Held>);

INSTANTIATE_TEST_SUITE_P(Stress, StiffPicks, testing::ValuesIn(crossed(kindsAlone(), allStiffPicks())),
                         crossedName<StiffPick>);

}  // namespace stiff_picks_test
}  // namespace meshless::stress
