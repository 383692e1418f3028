// Contact of bodies that are bent, turned inside out, or lie exactly along each other.
#include <cmath>

#include "dynamics/rotation.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "support/bodies.h"

namespace meshless {
namespace contact_geometry_test {

constexpr double kPi = 3.14159265358979323846;

BodyDef box(const std::string& name, const Vec3& size, const std::array<int, 3>& parts, const Vec3& at) {
  BodyDef def = test::defOf(boxMesh(size, parts[0], parts[1], parts[2]), name);
  def.pose.translation = at;
  def.clusters.kind = ClusterOptions::Kind::kOne;
  def.spacing = std::max({size.x() / parts[0], size.y() / parts[1], size.z() / parts[2]});
  return def;
}

WorldSnapshot seen(World& world) { return world.snapshot({true, true, true}); }

/// Deepest vertex of a in b [m]; 0 where none is inside.
double deepestIn(const BodySnapshot& a, const BodySnapshot& b) {
  TriangleMesh mesh = b.model->surface;
  mesh.vertices = b.surface;
  const SolidQuery solid(mesh);
  double deepest = 0.0;
  for (const Vec3& p : a.surface)
    if (solid.contains(p)) deepest = std::max(deepest, solid.distance(p));
  return deepest;
}

TEST(ContactGeometry, BodiesThatWereTurnedInsideOutStayFiniteAndPart) {
  for (const bool flat : {false, true}) {
    WorldSettings settings = test::weightless();
    settings.sleep = false;
    World world(settings);
    PreparedBody first = test::prepared(box("inverted", Vec3(0.1, 0.1, 0.1), {4, 4, 4}, Vec3::Zero()));
    for (Vec3& p : first.state.positions) p.z() *= flat ? 0.0 : -1.0;
    PreparedBody second = test::prepared(box("other", Vec3(0.1, 0.1, 0.1), {2, 2, 2}, Vec3(0.03, 0.02, 0.09)));
    for (Vec3& v : second.state.velocities) v = Vec3(0, 0, -0.2);
    const double mass = second.model->mass;
    ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(std::move(first))).ok());
    ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(std::move(second))).ok());
    for (int step = 0; step < 360; ++step) {
      world.step();
      const WorldSnapshot shot = seen(world);
      Vec3 momentum = Vec3::Zero();
      for (const BodySnapshot& b : shot.bodies) {
        ASSERT_TRUE(test::allFinite(b.particles)) << "step " << step;
        ASSERT_LT(b.measures.velocity.norm(), 3.0) << "step " << step;
        momentum += b.measures.linear_momentum;
      }
      ASSERT_NEAR((momentum - Vec3(0, 0, -0.2 * mass)).norm(), 0.0, 1e-9 * mass) << "step " << step;
    }
    const WorldSnapshot shot = seen(world);
    EXPECT_LT(deepestIn(shot.bodies[1], shot.bodies[0]), 0.002) << flat;
    EXPECT_LT(deepestIn(shot.bodies[0], shot.bodies[1]), 0.002) << flat;
  }
}

/// By how much a body is turned out of its upright rest shape [rad].
double tiltOf(const BodySnapshot& body) {
  Mat3 a = Mat3::Zero();
  for (std::size_t i = 0; i < body.particles.size(); ++i)
    a += body.model->masses[i] * (body.particles[i] - body.measures.centre_of_mass) * body.model->rest[i].transpose();
  const Vec3 up = nearestRotationExact(a, Quat::Identity()).rotation * Vec3::UnitZ();
  return std::atan2(up.head<2>().norm(), up.z());
}

// Edge on edge and side along side: samples of the upper one lie exactly in the planes of the lower one's sides, and
// those sides are as near to them as its top is.
TEST(ContactGeometry, CubesStackedExactlyAlongEachOtherStand) {
  for (const double alpha : {0.9, 0.99, 1.0}) {
    WorldSettings settings;
    settings.sleep = false;
    World world(settings);
    for (int k = 0; k < 3; ++k) {
      BodyDef def = box("cube" + std::to_string(k), Vec3::Constant(0.1), {2, 2, 2}, Vec3(0, 0, 0.0501 + 0.1001 * k));
      def.material.alpha = alpha;
      def.material.damping = 5.0;
      ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
    }
    // Soft ones wobble: contact of now cannot do better, and they should be held as still as the others.
    const double way = alpha < 0.99 ? 0.05 : 0.002, tilt = alpha < 0.99 ? 0.02 : 0.005;
    std::vector<Vec3> settled;  // [m] their centres, after a second
    for (int step = 0; step < 1200; ++step) {
      world.step();
      if (step % 10) continue;
      const WorldSnapshot shot = seen(world);
      for (int k = 0; k + 1 < 3; ++k) {
        const double deep =
            std::max(deepestIn(shot.bodies[k + 1], shot.bodies[k]), deepestIn(shot.bodies[k], shot.bodies[k + 1]));
        EXPECT_LT(deep, (step < 120 ? 0.005 : 0.002) * 0.1)
            << "cube " << k << " at alpha " << alpha << ", step " << step;
      }
      // Soft ones are pressed flatter by those on them, and then stay so: they neither sink, nor walk, nor rock.
      for (int k = 0; k < 3; ++k) {
        const BodySnapshot& cube = shot.bodies[k];
        const Vec3 centre = cube.measures.centre_of_mass;
        if (step == 120) settled.push_back(centre);
        if (step >= 120)
          EXPECT_LT((centre - settled[k]).norm(), way * 0.1)
              << "cube " << k << " at alpha " << alpha << ", step " << step;
        EXPECT_LT(tiltOf(cube), tilt) << "cube " << k << " at alpha " << alpha << ", step " << step;
      }
      EXPECT_GT(shot.bodies[2].measures.centre_of_mass.z(), (alpha < 0.99 ? 0.96 : 0.99) * 0.25) << alpha;
    }
  }
}

}  // namespace contact_geometry_test
}  // namespace meshless
