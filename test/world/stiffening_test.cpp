// Bodies of materials that stiffen, in the world at its defaults: whatever is done to them, they come back.
#include <cmath>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"
#include "support/random.h"

namespace meshless {
namespace stiffening_test {

using test::Random;

void run(World& world, double seconds) {
  for (int step = 0; step < seconds * world.settings().step_rate; ++step) world.step();
}

// A body whose organ, material and treatment the seed says.
void expectThatItComesBack(unsigned seed, double asymmetry, double stiffening) {
  SCOPED_TRACE(testing::Message() << "seed " << seed << ", asymmetry " << asymmetry << ", stiffening " << stiffening);
  Random random(seed);
  const double size = random.uniform(0.05, 0.15);
  BodyDef def = test::defOf(*randomOrgan(seed, 0, size, 1500));
  Material& material = def.material;
  material.youngs_modulus = 1060.0 * 9.81 * size * random.uniform(2.0, 10.0);
  material.poissons_ratio = random.uniform(0.3, 0.47);
  material.asymmetry = asymmetry;
  material.stiffening = stiffening;
  material.density = 1060.0;
  material.damping = 10.0;
  def.pose.translation.z() = random.uniform(0.0, 0.5) - boundsOf(def.mesh.vertices).min.z();
  World world{WorldSettings()};
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  run(world, 2.0);
  const BodySnapshot laid = world.snapshot({true, true, true}).bodies[0];
  ASSERT_TRUE(test::allFinite(laid.particles));
  const double rest = signedVolume(laid.model->surface);
  EXPECT_GT(laid.measures.volume, 0.9 * rest);
  EXPECT_LT(laid.measures.volume, 1.05 * rest);

  PickCommand pick;  // drawn far out, at once, and let go
  pick.point = laid.surface[random.integer(0, static_cast<int>(laid.surface.size()) - 1)];
  MovePickCommand move;
  move.pick = test::replyOf<PickReply>(world.apply(pick)).pick;
  move.target = pick.point + Vec3(0.0, 0.0, 1.5 * size);
  ASSERT_TRUE(world.apply(move).ok());
  run(world, 0.5);
  ReleaseCommand release;
  release.pick = move.pick;
  ASSERT_TRUE(world.apply(release).ok());

  CutCommand cut;
  cut.blades.origin = world.snapshot({false, false, true}).bodies[0].measures.centre_of_mass;
  cut.blades.x_axis = random.vector(1.0).normalized();
  cut.blades.y_axis = cut.blades.x_axis.unitOrthogonal();
  const auto done = world.apply(cut);
  EXPECT_TRUE(done.ok()) << done.error().detail;
  std::size_t mended = 0;
  for (int step = 0; step < 4.0 * world.settings().step_rate; ++step) {
    world.step();
    mended += world.snapshot({}).report.mended;
  }
  EXPECT_EQ(mended, 0u);
  const WorldSnapshot end = world.snapshot({true, true, true});
  double whole = 0.0;
  for (const BodySnapshot& body : end.bodies) {
    ASSERT_TRUE(test::allFinite(body.particles));
    whole += body.measures.volume;
    EXPECT_LT(body.measures.kinetic_energy, 1e-5 * body.model->mass) << body.name;
  }
  EXPECT_GT(whole, 0.9 * rest);
  EXPECT_LT(whole, 1.05 * rest);
}

TEST(Stiffening, BodiesThatFallAreDrawnAndCutComeBack) {
  expectThatItComesBack(1, 12.0, 1.0);
  expectThatItComesBack(2, 10.0, 5.0);
  expectThatItComesBack(3, -10.0, 20.0);
}

TEST(Stiffening, BodiesOfAnyNumbersComeBack_Long) {
  Random random(7);
  for (unsigned seed = 10; seed < 30; ++seed) {
    const double extreme = seed % 4 == 0 ? 30.0 : random.uniform(0.0, 15.0);
    expectThatItComesBack(seed, seed % 3 == 0 ? -extreme : extreme,
                          seed % 5 == 0 ? 1000.0 : std::pow(10.0, random.uniform(-1.0, 2.0)));
  }
}

}  // namespace stiffening_test
}  // namespace meshless
