// Sizes, places, steps and materials at the ends of their ranges: a body that was squashed, turned and thrown about in
// them is let go, stays finite and bounded, gains no energy, and returns to its rest shape.
#include <gtest/gtest.h>

#include "support/stress_cases.h"

namespace meshless::stress {
namespace conditions_test {

constexpr double kRestored = 1e-3;  // of the size

struct Condition {
  std::string name;
  std::function<void(WorldSettings& world, BodyDef& body)> set;
  bool returns = true;
  double seconds = 30.0;  // at the most
  double swing = 1.001;   // EnergyLaw
  bool potential = true;  // false: what is held has no potential here, and the measure may grow to 10 times the first
  double scale = 1.0;     // of the body
};

void PrintTo(const Condition& condition, std::ostream* out) { *out << condition.name; }

Condition changed(const std::string& name, std::function<void(Material&)> change, bool returns = true,
                  double seconds = 30.0) {
  return {name, [change](WorldSettings&, BodyDef& body) { change(body.material); }, returns, seconds};
}

std::vector<Condition> allConditions() {
  std::vector<Condition> all;
  for (const double scale : {1e-6, 1e3})
    all.push_back({scale < 1.0 ? "a fifth of a micrometre large" : "two hundred metres large",
                   [scale](WorldSettings&, BodyDef& body) { body.material.youngs_modulus *= scale * scale; }, true,
                   30.0, 1.001, true, scale});
  for (const double far : {1e3, 1e6})
    all.push_back({far < 1e4 ? "1 km from the origin" : "1000 km from the origin",
                   [far](WorldSettings&, BodyDef& body) { body.pose.translation = Vec3(far, -far, 0.5 * far); }});
  all.push_back({"steps of 1 s", [](WorldSettings& world, BodyDef&) { world.step_rate = 1.0; }, true, 600.0});
  all.push_back({"steps of 0.1 s", [](WorldSettings& world, BodyDef&) { world.step_rate = 10.0; }, true, 200.0});
  all.push_back(
      {"steps of a millisecond", [](WorldSettings& world, BodyDef&) { world.step_rate = 1000.0; }, true, 4.0});
  all.push_back({"substeps of ten microseconds",
                 [](WorldSettings& world, BodyDef&) {
                   world.step_rate = 10000.0;
                   world.substeps = 10;
                 },
                 false, 0.02});
  for (const double alpha : {0.0, 1.0})
    for (const double beta : {0.0, 1.0})
      all.push_back(changed(
          "alpha " + std::to_string(int(alpha)) + " beta " + std::to_string(int(beta)),
          [=](Material& m) {
            m.alpha = alpha;
            m.beta = beta;
          },
          alpha > 0.0, alpha > 0.0 ? 30.0 : 1.0));
  all.back().swing = 1.1;  // hardly any of the goals is rigid
  all.push_back(changed(
      "damping of a million", [](Material& m) { m.damping = 1e6; }, false, 1.0));
  all.push_back(changed("no damping", [](Material& m) { m.damping = 0.0; }));
  all.push_back(changed(
      "density of a milligram", [](Material& m) { m.density = 1e-6; }, false, 1.0));
  all.push_back(changed(
      "density of a thousand tons", [](Material& m) { m.density = 1e6; }, false, 1.0));
  all.push_back(changed(
      "volume and area held",
      [](Material& m) {
        m.volume.points = m.area.points = {{0.0, 1.0}, {1.0, 1.0}};
      },
      false, 2.0));
  all.back().potential = false;
  all.push_back(changed(
      "flowing",
      [](Material& m) {
        m.plasticity = {0.0, 1e6, 3.0};
      },
      false, 2.0));
  all.back().potential = false;
  all.push_back(changed(
      "as stiff as diamond",
      [](Material& m) {
        if (m.elastic()) m.youngs_modulus = 1e12;
      },
      false, 2.0));
  all.push_back(changed(
      "as soft as a cloud",
      [](Material& m) {
        if (m.elastic()) m.youngs_modulus = 1e-3;
      },
      false, 2.0));
  all.push_back(changed("hardly compressible", [](Material& m) {
    if (m.elastic()) m.poissons_ratio = 0.49;
  }));
  return all;
}

using Case = std::tuple<Kind, Condition>;

class Conditions : public testing::TestWithParam<Case> {};

TEST_P(Conditions, LetGoGoesBack) {
  const auto& [kind, condition] = GetParam();
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kNone;
  BodyDef def = blockOf(kind, "block", Vec3::Zero(), condition.scale);
  condition.set(settings, def);
  ASSERT_TRUE(settings.validate().ok());
  Twins twins(settings);
  test::Random random(11);
  const PreparedBody whole = test::prepared(def);
  const Vec3 origin = def.pose.translation;
  const double size = 0.25 * condition.scale;
  for (int b = 0; b < kind.bodies; ++b) {
    PreparedBody body = placedCopy(whole, "block" + std::to_string(b),
                                   {def.pose.rotation, origin + Vec3(0.3 * condition.scale * b, 0, 0)});
    Points& x = body.state.positions;
    const Vec3 centre = rigidMotionOf(*body.model, x, body.state.velocities).centre;
    for (Vec3& p : x) {
      const Vec3 q = p - centre;
      p = centre + Eigen::AngleAxisd(q.x() / size * 3.0, Vec3::UnitX()) * Vec3(0.6 * q.x(), q.y(), 1.4 * q.z()) +
          random.vector(0.02 * size);
    }
    updateSurface(*body.model, body.state);
    twins.spawn(std::make_shared<const PreparedBody>(std::move(body)));
  }
  const double h = 1.0 / settings.step_rate / settings.substeps;
  EnergyLaw law(condition.swing, settings.step_rate);
  double farthest = 1.0;
  const int most = static_cast<int>(condition.seconds * settings.step_rate), least = std::min(most, 120);
  for (int step = 0; step < most && (step < least || !(farthest < kRestored)); ++step) {
    ASSERT_TRUE(twins.step(origin, 0.3 * condition.scale * kind.bodies + 3.0 * size));
    double energy = 0.0;
    farthest = 0.0;
    for (const BodySnapshot& body : twins.seen().bodies) {
      energy += deformationEnergy(*body.model, body.material, h, body.particles) + body.measures.kinetic_energy;
      farthest = std::max(farthest, distanceFromRest(*body.model, body.particles));
    }
    const testing::AssertionResult held = law.holds(energy);
    if (condition.potential)
      ASSERT_TRUE(held) << "step " << step;
    else
      ASSERT_LE(energy, 10.0 * law.first()) << "step " << step;
  }
  if (condition.returns) EXPECT_LT(farthest, kRestored);
}

INSTANTIATE_TEST_SUITE_P(Stress, Conditions, testing::ValuesIn(crossed(allKinds(), allConditions())),
                         crossedName<Condition>);

}  // namespace conditions_test
}  // namespace meshless::stress
