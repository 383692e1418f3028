// What hands, scripts and networks do to a body, at its worst: everything stays finite, bounded and the same on any
// number of threads; once all let go, energy does not grow and the rest shape comes back.
#include <gtest/gtest.h>

#include "support/stress_cases.h"

namespace meshless::stress {
namespace inputs_test {

constexpr double kRestored = 1e-3;  // of the size
constexpr double kBodyStep = 0.3;   // [m] between bodies of a batch
// [m] A target that jumps by a metre takes the tissue along within a step: 120 m/s, and more against other springs.
constexpr double kThrown = 2e3;

/// Does something before each step of a world of blocks "block0", "block1" ... around the origin.
using Act = std::function<void(Twins& twins, int step, test::Random& random)>;

/// In space, where bodies pass through each other: what a hand does to them is to be seen by itself.
WorldSettings alone() {
  WorldSettings world = test::weightless();
  world.contact = ContactMethod::kNone;
  return world;
}

struct Input {
  std::string name;
  std::function<Act()> begin;  // a fresh one for each case
  int steps = 120;
  double reach = 100.0;  // [m] that nothing may go beyond
  bool returns = true;   // to the rest shape, and in the meantime without more energy
  WorldSettings world = alone();
};

void PrintTo(const Input& input, std::ostream* out) { *out << input.name; }

PickId pickAt(Twins& twins, const Vec3& point, double stiffness) {
  PickCommand pick;
  pick.point = point;
  pick.max_distance = 1e9;
  pick.stiffness = stiffness;
  const Result<Reply> reply = twins.apply(pick);
  EXPECT_TRUE(reply.ok()) << (reply.ok() ? "" : reply.error().detail);
  return reply.ok() ? std::get<PickReply>(*reply).pick : 0;
}

CutCommand cutThrough(const Vec3& point, const Vec3& normal) {
  CutCommand cut;
  cut.blades.x_axis = normal.unitOrthogonal();
  cut.blades.y_axis = normal.cross(cut.blades.x_axis);
  cut.blades.origin = point - 1e3 * cut.blades.x_axis;
  return cut;
}

PushCommand pushAt(const Vec3& at, double radius, double speed = 0.0) {
  PushCommand push;
  push.position = at;
  push.radius = radius;
  push.speed = speed;
  return push;
}

/// A pick that is dragged to target(random) before each step.
std::function<Act()> dragged(double stiffness, std::function<Vec3(test::Random&)> target) {
  return [=] {
    return [=, pick = PickId{0}](Twins& twins, int, test::Random& random) mutable {
      if (!pick) pick = pickAt(twins, Vec3(0.1, 0.05, 0.05), stiffness);
      EXPECT_TRUE(twins.apply(MovePickCommand{pick, target(random)}).ok());
    };
  };
}

std::function<Act()> eachStep(Act act) {
  return [act] { return act; };
}

WorldSettings onGround(double gravity = 9.81) {
  WorldSettings world;
  world.ground = -0.06;
  world.gravity = Vec3(0, 0, -gravity);
  return world;
}

std::vector<Input> allInputs() {
  std::vector<Input> all;
  all.push_back({"a pick of 1e9 N per m dragged at random", dragged(1e9, [](test::Random& r) { return r.vector(0.5); }),
                 60, kThrown});
  all.push_back({"a pick of 1e12 N per m dragged at random",
                 dragged(1e12, [](test::Random& r) { return r.vector(0.5); }), 60, kThrown});
  all.push_back({"a pick teleported by kilometres", dragged(1e9, [](test::Random& r) { return r.vector(1e3); }), 60,
                 2e3 * kThrown});
  all.push_back({"fifty picks against each other", eachStep([](Twins& twins, int step, test::Random& random) {
                   if (step == 0)
                     for (int k = 0; k < 50; ++k) pickAt(twins, random.vector(0.1), 1e9);
                   for (PickId pick = 1; pick <= 50; ++pick)
                     EXPECT_TRUE(twins.apply(MovePickCommand{pick, random.vector(0.3)}).ok());
                 }),
                 60, kThrown});
  all.push_back({"picks set locked and let go at random", eachStep([](Twins& twins, int step, test::Random& random) {
                   const PickId pick = pickAt(twins, random.vector(0.1), std::pow(10.0, random.uniform(0, 12)));
                   twins.attempt(LockCommand{pick, Vec3(random.vector(0.5))});
                   if (step % 3) twins.attempt(ReleaseCommand{pick});
                   if (step % 20 == 19) twins.attempt(ClearPicksCommand{});
                 }),
                 60, kThrown});
  all.push_back(
      {"a push sphere larger than the body appears inside", eachStep([](Twins& twins, int step, test::Random&) {
         twins.attempt(pushAt(Vec3(0.01, 0.02, 0.03), 0.5));
         if (step % 40 == 39) twins.attempt(PushCommand{false});
       })});
  all.push_back({"a push sphere teleported at random", eachStep([](Twins& twins, int, test::Random& random) {
                   twins.attempt(pushAt(random.vector(0.1), random.uniform(0.001, 0.1)));
                 })});
  all.push_back({"a push sphere at 1e6 m per s", eachStep([](Twins& twins, int step, test::Random& random) {
                   Vec3 at = random.vector(0.1);
                   at.x() = step % 2 ? 100.0 : -100.0;
                   twins.attempt(pushAt(at, 0.05, 1e6));
                 }),
                 60, 1e5});
  all.push_back({"a push sphere of a kilometre", eachStep([](Twins& twins, int, test::Random& random) {
                   twins.attempt(pushAt(random.vector(0.1) - Vec3(0, 0, 1e3), 1e3));
                 }),
                 60, 1e4});
  all.push_back({"bodies teleported every step", eachStep([](Twins& twins, int step, test::Random& random) {
                   PreparedBody body = test::prepared(blockOf(Kind{}, "stranger" + std::to_string(step)));
                   for (Vec3& p : body.state.positions) p += random.unit();
                   updateSurface(*body.model, body.state);
                   twins.attempt(SpawnCommand{std::make_shared<const PreparedBody>(std::move(body))});
                   if (step > 0) twins.attempt(RemoveCommand{"stranger" + std::to_string(step - 1)});
                 }),
                 40, 100.0, false, test::weightless()});
  all.push_back(
      {"another material every step", eachStep([](Twins& twins, int, test::Random& random) {
         Material other;
         other.mode = static_cast<MatchMode>(random.integer(0, 2));
         other.alpha = random.uniform(0, 1);
         other.beta = random.uniform(0, 1);
         other.density = std::pow(10.0, random.uniform(-3, 6));
         other.damping = random.uniform(0, 10);
         other.youngs_modulus = random.integer(0, 1) ? std::pow(10.0, random.uniform(-2, 6)) : 0.0;
         other.poissons_ratio = random.uniform(0, 0.49);
         twins.attempt(pushAt(random.vector(0.1), 0.03));
         EXPECT_TRUE(
             twins.apply(SetMaterialCommand{"", [other](const Material&) -> Result<Material> { return other; }}).ok());
       }),
       40, 100.0, false});
  all.push_back({"reset every third step", eachStep([](Twins& twins, int step, test::Random& random) {
                   pickAt(twins, random.vector(0.1), 1e9);
                   if (step % 3 == 2) twins.reset();
                 }),
                 60, kThrown});
  all.push_back({"cut to crumbs while picked",
                 [] {
                   return [pick = PickId{0}](Twins& twins, int, test::Random& random) mutable {
                     if (!pick) pick = pickAt(twins, Vec3(0.1, 0.05, 0.05), 1e5);
                     twins.attempt(MovePickCommand{pick, Vec3(0.1, 0.05, 0.05) + random.vector(0.02)});
                     twins.attempt(cutThrough(random.vector(0.05), random.unit()));
                   };
                 },
                 6, kThrown, false});
  all.push_back({"incisions at random", eachStep([](Twins& twins, int, test::Random& random) {
                   InciseCommand incise;
                   incise.blade.x_axis = random.unit();
                   incise.blade.y_axis = incise.blade.x_axis.unitOrthogonal();
                   incise.blade.origin = random.vector(0.1);
                   incise.blade.length = random.uniform(0.01, 0.3);
                   incise.blade.depth = random.uniform(0.01, 0.1);
                   twins.attempt(incise);
                 }),
                 20, 100.0, false});
  all.push_back({"cut and undone", eachStep([](Twins& twins, int step, test::Random& random) {
                   twins.attempt(cutThrough(random.vector(0.05), random.unit()));
                   if (step % 2) twins.attempt(UndoCutCommand{});
                   if (step % 2) twins.attempt(UndoCutCommand{});
                 }),
                 10});
  all.push_back(
      {"gravity of 1e4 on the ground", eachStep([](Twins&, int, test::Random&) {}), 120, 100.0, false, onGround(1e4)});
  all.push_back({"dropped from a kilometre",
                 [] {
                   return [](Twins& twins, int step, test::Random&) {
                     if (step) return;
                     PreparedBody body = test::prepared(blockOf(Kind{}, "dropped", Vec3(0, 0, 0.06)));
                     for (Vec3& v : body.state.velocities) v.z() = -std::sqrt(2.0 * 9.81 * 1000.0);
                     twins.attempt(SpawnCommand{std::make_shared<const PreparedBody>(std::move(body))});
                   };
                 },
                 120, 300.0, false, onGround()});
  all.push_back({"two at the same place",
                 [] {
                   return [](Twins& twins, int step, test::Random&) {
                     if (step) return;
                     twins.attempt(SpawnCommand{test::shared(blockOf(Kind{}, "same"))});
                   };
                 },
                 120, 30.0, false, test::weightless()});
  all.push_back({"a million times the mass on top",
                 [] {
                   return [](Twins& twins, int step, test::Random&) {
                     if (step) return;
                     BodyDef heavy = blockOf(Kind{}, "heavy", Vec3(0, 0, 0.11));
                     heavy.material.density = 1e6;
                     twins.attempt(SetMaterialCommand{"block0", [](const Material& m) -> Result<Material> {
                                                        Material light = m;
                                                        light.density = 1.0;
                                                        return light;
                                                      }});
                     twins.attempt(SpawnCommand{test::shared(heavy)});
                   };
                 },
                 120, 30.0, false, onGround()});
  return all;
}

using Case = std::tuple<Kind, Input>;

class Inputs : public testing::TestWithParam<Case> {};

TEST_P(Inputs, AreSurvived) {
  const auto& [kind, input] = GetParam();
  Twins twins(input.world);
  test::Random random(13);
  const PreparedBody whole = test::prepared(blockOf(kind, "block"));
  for (int b = 0; b < kind.bodies; ++b)
    twins.spawn(std::make_shared<const PreparedBody>(
        placedCopy(whole, "block" + std::to_string(b), {Quat::Identity(), Vec3(kBodyStep * b, 0, 0)})));
  const double reach = input.reach + kBodyStep * kind.bodies;
  const Act act = input.begin();
  for (int step = 0; step < input.steps; ++step) {
    act(twins, step, random);
    ASSERT_FALSE(HasFailure());
    ASSERT_TRUE(twins.step(Vec3::Zero(), reach));
  }

  twins.attempt(ClearPicksCommand{});
  twins.attempt(PushCommand{false});
  if (!input.returns) {
    for (int step = 0; step < 60; ++step) ASSERT_TRUE(twins.step(Vec3::Zero(), 2.0 * reach));
    return;
  }
  Twins calm = stoppedAsAWhole(twins, input.world, 2.0 * reach);
  const double h = 1.0 / input.world.step_rate;
  double farthest = 1.0;
  EnergyLaw law;
  for (int step = 0; step < 3600 && (step < 60 || !(farthest < kRestored)); ++step) {
    ASSERT_TRUE(calm.step(Vec3::Zero(), 3.0 * reach)) << "let go";
    double energy = 0.0;
    farthest = 0.0;
    for (const BodySnapshot& body : calm.seen().bodies) {
      energy += deformationEnergy(*body.model, body.material, h, body.particles) + body.measures.kinetic_energy;
      farthest = std::max(farthest, distanceFromRest(*body.model, body.particles));
    }
    if (kind.bodies == 1)
      ASSERT_TRUE(law.holds(energy)) << "step " << step << " after letting go";
  }
  EXPECT_LT(farthest, kRestored);
}

INSTANTIATE_TEST_SUITE_P(Stress, Inputs, testing::ValuesIn(crossed(allKinds(), allInputs())), crossedName<Input>);

}  // namespace inputs_test
}  // namespace meshless::stress
