// Bodies that springs pull into one place, one of them cut and one opened: they press on each other for good, and
// hold nearly still.
#include "support/bodies.h"

namespace meshless {
namespace {

constexpr int kSettling = 60, kSteps = 240;
// [J] of 1.5 kg: 0.16 m/s. Contact of now leaves them shivering, at 0.01 J for some steps: they are not at rest, and
// this is no more than that they do not gain.
constexpr double kShiver = 0.02;

void pullTogether(double stiffness) {
  World world{WorldSettings()};
  for (int k = 0; k < 3; ++k) {
    BodyDef def = test::defOf(k == 1 ? sphereMesh(0.06, 0.02) : boxMesh(Vec3(0.12, 0.08, 0.06), 6, 4, 3),
                              "body" + std::to_string(k));
    def.pose.translation = Vec3(0.15 * k, 0.0, 0.08);
    def.spacing = 0.02;
    def.material.damping = 3.0;
    if (k == 1)
      def.material.alpha = 0.6;
    else
      def.material.youngs_modulus = 5000.0;
    ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  }
  for (int k = 0; k < kSettling; ++k) world.step();
  InciseCommand incise;
  incise.blade = {Vec3(0.002, -0.02, 0.2), Vec3::UnitY(), Vec3::UnitZ(), 0.1, 0.17};
  ASSERT_TRUE(world.apply(incise).ok());
  CutCommand cut;
  cut.blades.origin = Vec3(0.31, 0.0, 0.05);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3::UnitZ();
  ASSERT_TRUE(world.apply(cut).ok());
  for (const double x : {-0.05, 0.05, 0.15, 0.33}) {
    PickCommand pick;
    pick.point = Vec3(x, 0.0, 0.06);
    pick.max_distance = 0.2;
    pick.stiffness = stiffness;
    MovePickCommand move;
    move.pick = test::replyOf<PickReply>(world.apply(pick)).pick;
    move.target = Vec3(0.15, 0.0, 0.05);
    ASSERT_TRUE(world.apply(move).ok());
  }
  for (int k = 0; k < kSteps; ++k) {
    world.step();
    if (k < kSettling) continue;
    double kinetic = 0.0;
    for (const BodySnapshot& body : world.snapshot({false, true, true}).bodies) {
      ASSERT_TRUE(test::allFinite(body.particles)) << k;
      kinetic += body.measures.kinetic_energy;
    }
    ASSERT_LT(kinetic, kShiver) << k;
  }
}

TEST(PulledTogether, BySoftSprings) { pullTogether(500.0); }
TEST(PulledTogether, ByStiffSprings) { pullTogether(1e4); }
TEST(PulledTogether, ByRods) { pullTogether(1e6); }

}  // namespace
}  // namespace meshless
