// Organs whose surface is finer than their cells meet others by even triangles, before and after cuts.
#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"

namespace meshless {
namespace collision_surface_test {

BodyDef organ(CollisionChoice::Kind kind) {
  BodyDef def = test::defOf(*randomOrgan(1, 0, 0.2, 20000), "organ");
  def.pose.translation.z() = 0.002 - boundsOf(def.mesh.vertices).min.z();
  def.material.youngs_modulus = 4500.0;
  def.material.poissons_ratio = 0.45;
  def.material.density = 1060.0;
  def.material.damping = 10.0;
  def.collision.kind = kind;
  return def;
}

struct Lain {
  double spacing = 0.0;  // [m]
  Vec3 centre = Vec3::Zero();
  double most_contacts = 0.0, bodies = 0.0, least_volume = 1.0, deepest = 0.0;
};

Lain lie(CollisionChoice::Kind kind, bool cut) {
  World world{WorldSettings()};
  EXPECT_TRUE(world.addSceneBody(test::shared(organ(kind))).ok());
  Lain lain;
  const auto run = [&](int steps) {
    for (int n = 0; n < steps; ++n) {
      world.step();
      const double contacts =
          static_cast<double>(world.snapshot({false, false, false}).report.contact_counters.contacts);
      lain.most_contacts = std::max(lain.most_contacts, contacts);
    }
  };
  run(60);
  if (cut) {
    CutCommand command;
    const Vec3 across = Vec3(1.0, 0.2, 0.1).normalized();
    command.blades.x_axis = across.unitOrthogonal();
    command.blades.y_axis = across.cross(command.blades.x_axis);
    command.blades.origin =
        world.snapshot({false, false, true}).bodies[0].measures.centre_of_mass - 10.0 * command.blades.x_axis;
    EXPECT_TRUE(world.apply(command).ok());
    run(60);
  }
  const WorldSnapshot shot = world.snapshot({true, true, true});
  lain.bodies = static_cast<double>(shot.bodies.size());
  for (const BodySnapshot& body : shot.bodies) {
    lain.spacing = body.model->spacing;
    lain.least_volume = std::min(lain.least_volume, body.measures.volume / body.model->rest_volume);
    for (const Vec3& p : body.surface) lain.deepest = std::max(lain.deepest, -p.z());
    EXPECT_EQ(bool(body.model->collision), kind == CollisionChoice::Kind::kAuto) << body.name;
  }
  lain.centre = shot.bodies[0].measures.centre_of_mass;
  return lain;
}

TEST(CollisionSurfaces, CarryAnOrganAsHighAsItsVisualSurfaceDoesForAFractionOfTheContacts) {
  const Lain even = lie(CollisionChoice::Kind::kAuto, false), visual = lie(CollisionChoice::Kind::kVisual, false);
  std::printf("%.0f contacts for %.0f, %.4f spacings apart\n", even.most_contacts, visual.most_contacts,
              (even.centre - visual.centre).norm() / even.spacing);
  EXPECT_LT((even.centre - visual.centre).norm(), 0.05 * even.spacing);
  EXPECT_LT(even.most_contacts, 0.4 * visual.most_contacts);
  EXPECT_LT(even.deepest, 0.12 * even.spacing) << "what is seen is as near to what meets the ground as is said";
}

TEST(CollisionSurfaces, KeepTheirPiecesApartAndWhole) {
  const Lain even = lie(CollisionChoice::Kind::kAuto, true);
  EXPECT_EQ(even.bodies, 2.0);
  EXPECT_GT(even.least_volume, 0.9);
  EXPECT_LT(even.deepest, 0.2 * even.spacing);
}

}  // namespace collision_surface_test
}  // namespace meshless
