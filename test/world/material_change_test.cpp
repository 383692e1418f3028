// A change of material gives no energy: it takes hold over a time, and the body ends where one of the new material
// would.
#include <cmath>
#include <cstring>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/bodies.h"
#include "support/random.h"
#include "support/stress.h"

namespace meshless {
namespace material_change_test {

using test::replyOf;

Material elastic(double youngs_modulus, double poissons_ratio = 0.45, double density = 1000.0) {
  Material material;
  material.youngs_modulus = youngs_modulus;
  material.poissons_ratio = poissons_ratio;
  material.density = density;
  material.damping = 5.0;
  return material;
}
Material looks(double alpha, double beta = 0.2, MatchMode mode = MatchMode::kLinear) {
  Material material;
  material.alpha = alpha;
  material.beta = beta;
  material.mode = mode;
  return material;
}
Material keepsVolume(Material material) {
  material.volume.points = {{0.0, 0.5}};
  return material;
}

struct Change {
  const char* name;
  Material from, to;
};
// Of one family: clusters are made for the first.
std::vector<Change> changes() {
  return {{"stiffer", elastic(1.5e3), elastic(5e5)},
          {"softer", elastic(1e5), elastic(3e3)},
          {"less compressible", elastic(3e3, 0.1), elastic(3e3, 0.49)},
          {"lighter", elastic(3e3, 0.45, 3000.0), elastic(3e3)},
          {"heavier", elastic(3e3), elastic(3e3, 0.45, 3000.0)},
          {"volume", elastic(3e3, 0.2), keepsVolume(elastic(3e3, 0.2))},
          {"alpha to 1", looks(0.6), looks(1.0)},
          {"alpha down", looks(1.0), looks(0.6)},
          {"beta down", looks(0.5, 0.8), looks(0.5, 0.0)},
          {"rigid", looks(0.5, 0.8), looks(0.5, 0.0, MatchMode::kRigid)},
          {"volume, looks", looks(0.5), keepsVolume(looks(0.5))}};
}

void become(World& world, const Material& material) {
  replyOf<Done>(world.apply(SetMaterialCommand{"", [&](const Material&) { return Result<Material>(material); }}));
}

enum class Setting { kLying, kClamped, kLoaded };

BodyDef shape(bool round, const Material& material) {
  BodyDef def = test::defOf(round ? sphereMesh(0.04, 0.02) : boxMesh(Vec3(0.12, 0.04, 0.04), 6, 2, 2), "body");
  def.spacing = round ? 0.016 : 0.02;
  def.material = material;
  def.pose.translation = Vec3(0, 0, round ? 0.0405 : 0.0205);
  return def;
}

World worldOf(Setting setting, bool round, const Material& material) {
  World world({});
  BodyDef def = shape(round, material);
  if (setting == Setting::kClamped) {
    def.pose.translation.z() = 0.3;
    def.fixed.push_back(Box{Vec3(-1, -1, -1), Vec3(round ? -0.025 : -0.05, 1, 1)});
  }
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  if (setting == Setting::kLoaded) {
    BodyDef load = test::defOf(boxMesh(Vec3(0.06, 0.06, 0.02), 2, 2, 1), "load");
    load.spacing = 0.03;
    load.material.alpha = 1.0;
    load.pose.translation.z() = def.pose.translation.z() + (round ? 0.0505 : 0.0305);
    EXPECT_TRUE(world.addSceneBody(test::shared(load)).ok());
  }
  return world;
}

BodySnapshot seen(World& world) { return world.snapshot({true, true, true}).bodies.at(0); }
double lowest(World& world) { return boundsOf(seen(world).surface).min.z(); }
double height(World& world) {
  const Box bounds = boundsOf(seen(world).surface);
  return bounds.max.z() - bounds.min.z();
}
void run(World& world, double seconds) {
  for (int n = 0; n < std::lround(120.0 * seconds); ++n) world.step();
}

TEST(MaterialChange, LiftsNothingAndEndsWhereTheNewMaterialWould) {
  for (const Change& change : changes())
    for (const Setting setting : {Setting::kLying, Setting::kClamped, Setting::kLoaded})
      for (const bool round : {true, false}) {
        SCOPED_TRACE(std::string(change.name) + (round ? ", ball " : ", bar ") + std::to_string(int(setting)));
        if (setting == Setting::kLoaded && round) continue;  // the load rolls off
        World world = worldOf(setting, round, change.from);
        run(world, 2.0);
        become(world, change.to);
        double leap = 0.0;
        for (int n = 0; n < 120; ++n) {
          world.step();
          if (setting != Setting::kClamped) leap = std::max(leap, lowest(world));
        }
        EXPECT_LT(leap, change.to.elastic() ? 1e-3 : 2e-3);
        // By friction a ball that rolls, and who carries another, come to rest in more than one way.
        if (setting != Setting::kClamped && (round || setting == Setting::kLoaded)) continue;
        run(world, 2.0);
        World fresh = worldOf(setting, round, change.to);
        run(fresh, 4.0);
        // Goals that take all of a velocity let the bar creep to where it comes to rest.
        const bool creeps = !change.to.elastic() && std::max(change.from.alpha, change.to.alpha) == 1.0;
        EXPECT_NEAR(height(world) / height(fresh), 1.0, setting == Setting::kLying ? 0.02 : creeps ? 0.012 : 0.005);
      }
}

/// Of motion and of deformation, over the mass [J/kg].
double energyOf(World& world) {
  const BodySnapshot body = seen(world);
  const double h = 1.0 / world.settings().step_rate;
  const double deformed = stress::deformationEnergy(*body.model, body.material, h, body.particles);
  return (body.measures.kinetic_energy + deformed) / body.model->mass;
}

// Drawn out and let go, in space, at any moment of the vibration.
TEST(MaterialChange, GivesAVibrationNoEnergy) {
  for (const Change& change : changes()) {
    if (!std::strncmp(change.name, "volume", 6)) continue;
    for (const int after : {0, 3, 7, 12}) {
      SCOPED_TRACE(std::string(change.name) + " after " + std::to_string(after));
      WorldSettings settings = test::weightless();
      settings.contact = ContactMethod::kNone;
      World world(settings);
      Material from = change.from, to = change.to;
      from.damping = to.damping = 0.0;
      PreparedBody body = test::prepared(shape(false, from));
      for (Vec3& p : body.state.positions) p.x() *= 1.1;
      ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(std::move(body))).ok());
      for (int n = 0; n < after; ++n) world.step();
      const double before = energyOf(world);
      become(world, to);
      run(world, 0.5);
      EXPECT_LT(energyOf(world), 1.05 * before);
    }
  }
}

// As a slider is dragged.
TEST(MaterialChange, AgainAndAgainLiftsNothing) {
  for (const bool of_looks : {false, true}) {
    SCOPED_TRACE(of_looks ? "looks" : "elastic");
    const auto next = [&](test::Random& random) {
      return of_looks ? looks(random.uniform(0.3, 1.0))
                      : elastic(std::exp(random.uniform(std::log(1.5e3), std::log(1e5))));
    };
    test::Random random(7);
    World world = worldOf(Setting::kLying, true, next(random));
    run(world, 1.0);
    double leap = 0.0;
    for (int n = 0; n < 240; ++n) {
      if (n % 5 == 0) become(world, next(random));
      world.step();
      leap = std::max(leap, lowest(world));
    }
    EXPECT_LT(leap, 1e-3);
  }
}

// Who is softened, or not strained at all, is of the new material at once.
TEST(MaterialChange, TakesHoldAtOnceWhereItGivesNothing) {
  for (const bool strained : {false, true}) {
    WorldSettings settings = test::weightless();
    std::vector<Points> ends;
    for (const bool set : {false, true}) {
      World world(settings);
      PreparedBody body = test::prepared(shape(false, elastic(set ? (strained ? 1e5 : 1e3) : 2e4)));
      if (strained)
        for (Vec3& p : body.state.positions) p.x() *= 1.1;
      ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(std::move(body))).ok());
      if (set) become(world, elastic(2e4));
      PickCommand pick;
      pick.point = Vec3(0.06, 0, 0.02);
      const PickReply picked = replyOf<PickReply>(world.apply(pick));
      replyOf<Done>(world.apply(MovePickCommand{picked.pick, Vec3(0.09, 0, 0.03)}));
      run(world, 0.1);
      ends.push_back(seen(world).particles);
    }
    for (std::size_t i = 0; i < ends[0].size(); ++i) ASSERT_LT((ends[0][i] - ends[1][i]).norm(), 1e-9) << strained;
  }
}

}  // namespace material_change_test
}  // namespace meshless
