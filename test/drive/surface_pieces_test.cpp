// Pieces of a cut organ under contact in present space.
#include <gtest/gtest.h>

#include "drive/crossing_law.h"
#include "drive/depth_law.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"

namespace meshless {
namespace {

CutCommand cutThrough(const Vec3& point, const Vec3& normal) {
  CutCommand cut;
  cut.blades.x_axis = normal.unitOrthogonal();
  cut.blades.y_axis = normal.cross(cut.blades.x_axis);
  cut.blades.origin = point - 10.0 * cut.blades.x_axis;
  return cut;
}

/// [m] of the deepest vertex of a body in another one or the ground.
double deepest(const Seen& seen) {
  double depth = 0.0;
  for (const SeenBody& body : seen.bodies) {
    for (const Vec3& p : body.surface.vertices) depth = std::max(depth, *seen.ground - p.z());
    const SolidQuery solid(body.surface);
    const Box bounds = boundsOf(body.surface.vertices);
    for (const SeenBody& other : seen.bodies) {
      if (&other == &body) continue;
      for (const Vec3& p : other.surface.vertices)
        if ((p.array() >= bounds.min.array()).all() && (p.array() <= bounds.max.array()).all() && solid.contains(p))
          depth = std::max(depth, solid.distance(p));
    }
  }
  return depth;
}

TEST(SurfacePieces, AnOrganCutTwiceKeepsItsPiecesWholeAndApart) {
  for (const std::uint64_t seed : {1, 3}) {  // lobes of 2 fall into each other: self-contact is off by default
    SCOPED_TRACE(seed);
    const Result<TriangleMesh> mesh = randomOrgan(seed, 0, 0.2, 1500);
    ASSERT_TRUE(mesh.ok());
    BodyDef def = test::defOf(*mesh, "organ");
    def.pose.translation.z() = -boundsOf(mesh->vertices).min.z() + 0.002;
    def.material.youngs_modulus = 4500.0;
    def.material.poissons_ratio = 0.45;
    def.material.density = 1060.0;
    def.material.damping = 4.0;
    WorldSettings settings;
    settings.contact = ContactMethod::kSurface;
    World world(settings);
    ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
    const auto run = [&](double seconds) {
      for (int n = 0; n < seconds * settings.step_rate; ++n) world.step();
    };
    run(0.25);
    const Vec3 middle = see(world, false).bodies[0].centre;
    ASSERT_TRUE(world.apply(cutThrough(middle, Vec3(1.0, 0.2, 0.1).normalized())).ok());
    run(0.25);
    ASSERT_TRUE(world.apply(cutThrough(middle, Vec3(0.1, 1.0, 0.3).normalized())).ok());
    run(2.0);
    const Seen now = see(world, true);
    EXPECT_GE(now.bodies.size(), 3u);
    for (const SeenBody& body : now.bodies) {
      const double ratio = signedVolume(body.surface) / body.rest_volume;
      EXPECT_GT(ratio, 0.85) << body.name;
      EXPECT_LT(ratio, 1.1) << body.name;
    }
    EXPECT_LT(deepest(now), 0.001);
    EXPECT_FALSE(depthLaw(now).broken()) << depthLaw(now).text;
    EXPECT_FALSE(crossingLaw(now).broken()) << crossingLaw(now).text;
    EXPECT_EQ(now.mended, 0u);
  }
}

}  // namespace
}  // namespace meshless
