// Bodies in every state that a user, a bug or a network can bring about, let go: they stay finite and bounded, their
// energy does not grow, and they return to their rest shape.
#include <gtest/gtest.h>

#include "support/stress_cases.h"

namespace meshless::stress {
namespace states_test {

constexpr double kRestored = 1e-3;  // of the size
constexpr double kLongest = 30.0;   // [s] that a body may take to be back

struct State {
  std::string name;
  std::function<void(Points& x, Points& v, test::Random& random)> set;
};

void PrintTo(const State& state, std::ostream* out) { *out << state.name; }

Vec3 meanOf(const Points& x) {
  Vec3 sum = Vec3::Zero();
  for (const Vec3& p : x) sum += p;
  return sum / static_cast<double>(x.size());
}

/// Applies a map about the middle.
std::function<void(Points&, Points&, test::Random&)> mapped(const Mat3& map) {
  return [map](Points& x, Points&, test::Random&) {
    const Vec3 centre = meanOf(x);
    for (Vec3& p : x) p = centre + map * (p - centre);
  };
}
std::function<void(Points&, Points&, test::Random&)> stretched(double sx, double sy, double sz) {
  return mapped(Vec3(sx, sy, sz).asDiagonal());
}

std::vector<State> allStates() {
  std::vector<State> all;
  all.push_back({"squashed to a plane", stretched(1, 1, 0)});
  all.push_back({"squashed to a plane askew",
                 mapped(Mat3::Identity() - Vec3(1, 2, 3).normalized() * Vec3(1, 2, 3).normalized().transpose())});
  all.push_back({"squashed to a line", stretched(1, 0, 0)});
  all.push_back({"squashed to a line across", stretched(0, 0, 1)});
  all.push_back({"squashed to a point", stretched(0, 0, 0)});
  all.push_back({"turned inside out", stretched(-1, -1, -1)});
  all.push_back({"mirrored", stretched(1, 1, -1)});
  all.push_back({"scaled by a millionth", stretched(1e-6, 1e-6, 1e-6)});
  all.push_back({"scaled by a million", stretched(1e6, 1e6, 1e6)});
  all.push_back({"drawn out a thousandfold", stretched(1e3, 1, 1)});
  all.push_back({"every particle somewhere", [](Points& x, Points&, test::Random& random) {
                   const Vec3 centre = meanOf(x);
                   for (Vec3& p : x) p = centre + random.vector(0.1);
                 }});
  all.push_back({"every particle somewhere far", [](Points& x, Points&, test::Random& random) {
                   const Vec3 centre = meanOf(x);
                   for (Vec3& p : x) p = centre + random.vector(100.0);
                 }});
  all.push_back({"coincident pairs", [](Points& x, Points&, test::Random&) {
                   for (std::size_t i = 1; i < x.size(); i += 2) x[i] = x[i - 1];
                 }});
  all.push_back({"one particle a kilometre away", [](Points& x, Points&, test::Random&) { x[0].y() += 1000.0; }});
  all.push_back({"two halves apart", [](Points& x, Points&, test::Random&) {
                   const Vec3 centre = meanOf(x);
                   for (Vec3& p : x) p.x() += p.x() > centre.x() ? 1.0 : -1.0;
                 }});
  all.push_back({"half a turn of twist", [](Points& x, Points&, test::Random&) {
                   const Vec3 centre = meanOf(x);
                   for (Vec3& p : x)
                     p = centre + Eigen::AngleAxisd((p.x() - centre.x()) / 0.2 * M_PI, Vec3::UnitX()) * (p - centre);
                 }});
  all.push_back({"particles thrown apart", [](Points&, Points& v, test::Random& random) {
                   for (Vec3& u : v) u = random.vector(10.0);
                 }});
  all.push_back({"particles thrown apart at 1e6 m/s", [](Points&, Points& v, test::Random& random) {
                   for (Vec3& u : v) u = random.vector(1e6);
                 }});
  return all;
}

using Case = std::tuple<Kind, State>;

class States : public testing::TestWithParam<Case> {};

TEST_P(States, LetGoGoesBack) {
  const auto& [kind, state] = GetParam();
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kNone;
  Twins twins(settings);
  test::Random random(7);
  const PreparedBody whole = test::prepared(blockOf(kind, "block"));
  double span = 0.0, fastest = 0.0;
  for (int b = 0; b < kind.bodies; ++b) {
    PreparedBody body = placedCopy(whole, "block" + std::to_string(b), {Quat::Identity(), Vec3(0.3 * b, 0, 0)});
    Points& x = body.state.positions;
    Points& v = body.state.velocities;
    state.set(x, v, random);
    // At rest as a whole: what flies or spins away has nothing to go back to.
    const RigidMotion together = rigidMotionOf(*body.model, x, v);
    for (std::size_t i = 0; i < v.size(); ++i) v[i] -= together.velocity + together.spin.cross(x[i] - together.centre);
    for (const Vec3& u : v) fastest = std::max(fastest, u.norm());
    span = std::max(span, reachOf(x, together.centre));
    updateSurface(*body.model, body.state);
    twins.spawn(std::make_shared<const PreparedBody>(std::move(body)));
  }

  // What is thrown apart flies on for a while: what holds it swings more slowly than once in two seconds nowhere.
  const double reach = 0.3 * kind.bodies + 2.0 * (span + 0.3) + 2.0 * fastest;
  const double h = 1.0 / settings.step_rate;
  EnergyLaw law;
  double farthest = 1.0;
  const int most = static_cast<int>(kLongest * settings.step_rate), least = static_cast<int>(settings.step_rate);
  for (int step = 0; step < most && (step < least || !(farthest < kRestored)); ++step) {
    ASSERT_TRUE(twins.step(Vec3::Zero(), reach));
    double energy = 0.0;
    farthest = 0.0;
    for (const BodySnapshot& body : twins.seen().bodies) {
      energy += deformationEnergy(*body.model, body.material, h, body.particles) + body.measures.kinetic_energy;
      farthest = std::max(farthest, distanceFromRest(*body.model, body.particles));
    }
    // What leads a body back that is wound up in itself takes it over a rise; below what it was it has to end.
    ASSERT_TRUE(law.holds(energy)) << "step " << step;
  }
  EXPECT_LT(farthest, kRestored);
}

INSTANTIATE_TEST_SUITE_P(Stress, States, testing::ValuesIn(crossed(allKinds(), allStates())), crossedName<State>);

}  // namespace states_test
}  // namespace meshless::stress
