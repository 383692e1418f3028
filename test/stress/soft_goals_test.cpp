// Materials of which most of the goal is the fitted map: what holds their volume has to be a gradient, or it feeds
// energy in, the faster the smaller the substeps are.
#include <gtest/gtest.h>

#include "support/stress_cases.h"

namespace meshless::stress {
namespace soft_goals_test {

constexpr int kSteps = 360;
constexpr double kBeta = 0.95;  // the most that acts

struct Soft {
  std::string name;
  double alpha;
  int substeps;
};

void PrintTo(const Soft& soft, std::ostream* out) { *out << soft.name; }

std::vector<Soft> allSofts() {
  std::vector<Soft> softs;
  for (const int tenths : {1, 5, 9})
    for (const int substeps : {1, 8, 64})
      softs.push_back(
          {"alpha 0" + std::to_string(tenths) + " substeps " + std::to_string(substeps), 0.1 * tenths, substeps});
  return softs;
}

std::vector<Kind> linearKinds() {
  std::vector<Kind> kinds;
  for (const Kind& kind : allKinds())
    if (kind.mode == MatchMode::kLinear && !kind.elastic) kinds.push_back(kind);
  return kinds;
}

class SoftGoals : public testing::TestWithParam<std::tuple<Kind, Soft>> {
 protected:
  std::vector<std::shared_ptr<const PreparedBody>> bodies(bool shaken) const {
    const auto& [kind, soft] = GetParam();
    Kind coarse = kind;
    coarse.bodies = 36;
    test::Random random(5);
    std::vector<std::shared_ptr<const PreparedBody>> made;
    for (int b = 0; b < kind.bodies; ++b) {
      BodyDef def = blockOf(coarse, "block" + std::to_string(b), Vec3(0.3 * (b % 6), 0.3 * (b / 6), 0.05));
      def.material.alpha = soft.alpha;
      def.material.beta = kBeta;
      def.material.damping = 2.0;
      Result<PreparedBody> body = prepareBody(std::move(def));
      if (!body) return {};
      made.push_back(inState(std::move(*body), [&](Points& x, Points&) {
        if (!shaken) return;
        const Vec3 centre = x.front();
        for (Vec3& p : x) p = centre + random.vector(0.1);
      }));
    }
    return made;
  }
  Twins scene(WorldSettings settings, bool shaken) const {
    settings.substeps = std::get<1>(GetParam()).substeps;
    settings.contact = ContactMethod::kNone;
    settings.sleep = false;
    Twins twins(settings);
    for (const auto& body : bodies(shaken)) twins.spawn(body);
    return twins;
  }
  static double kinetic(const Twins& twins) {
    double sum = 0.0;
    for (const BodySnapshot& body : twins.seen().bodies) sum += body.measures.kinetic_energy;
    return sum;
  }
};

TEST_P(SoftGoals, LoseTheEnergyTheyWereGiven) {
  Twins twins = scene(test::weightless(), true);
  double first = 0.0, last = 0.0;  // [J] most in a half second
  for (int step = 0; step < kSteps; ++step) {
    ASSERT_TRUE(twins.step(Vec3::Zero(), 20.0));
    if (step < 30) first = std::max(first, kinetic(twins));
    if (step >= kSteps - 30) last = std::max(last, kinetic(twins));
  }
  EXPECT_LT(last, 1e-2 * first);
}

TEST_P(SoftGoals, LieOnTheGroundAndDoNotSpread) {
  WorldSettings settings;
  settings.ground = 0.0;
  Twins twins = scene(settings, false);
  for (int step = 0; step < kSteps; ++step) {
    ASSERT_TRUE(twins.step(Vec3::Zero(), 20.0));
    for (const BodySnapshot& body : twins.seen().bodies)
      ASSERT_LT(reachOf(body.particles, body.measures.centre_of_mass), 0.3) << "step " << step;
  }
}

INSTANTIATE_TEST_SUITE_P(Stress, SoftGoals, testing::ValuesIn(crossed(linearKinds(), allSofts())), crossedName<Soft>);

}  // namespace soft_goals_test
}  // namespace meshless::stress
