// Cases of contact with a right answer: a pressed ball, a stack, a tray's edge, jaws, a bowl, a bladder, bodies inside.
#include <cmath>

#include "drive/supports.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"
#include "support/random.h"
#include "support/shapes.h"

namespace meshless {
namespace contact_cases_test {

using test::replyOf;

Material elastic(double youngs_modulus, double poissons_ratio = 0.45) {
  Material material;
  material.youngs_modulus = youngs_modulus;
  material.poissons_ratio = poissons_ratio;
  material.damping = 10.0;
  material.friction = 0.4;
  material.self_contact = SelfContact::kAll;
  return material;
}
Material looks(double alpha) {
  Material material;
  material.alpha = alpha;
  return material;
}

BodyDef bodyOf(const TriangleMesh& mesh, const Material& material, double spacing, const Vec3& at,
               const std::string& name = "body") {
  BodyDef def = test::defOf(mesh, name);
  def.material = material;
  def.spacing = spacing;
  def.pose.translation = at;
  return def;
}
void add(World& world, const BodyDef& def) { ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok()); }
void add(World& world, const std::string& name, TriangleMesh mesh, const Vec3& at = Vec3::Zero()) {
  ObstacleDef obstacle;
  obstacle.name = name;
  for (Vec3& v : mesh.vertices) v += at;
  obstacle.mesh = std::move(mesh);
  ASSERT_TRUE(world.addObstacle(obstacle).ok());
}
void run(World& world, double seconds) {
  for (int n = 0; n < std::lround(world.settings().step_rate * seconds); ++n) world.step();
}
WorldSnapshot seen(World& world) { return world.snapshot({true, true, true}); }
WorldSettings without(std::optional<double> ground) {
  WorldSettings settings;
  settings.ground = ground;
  return settings;
}
double speed(const BodySnapshot& body) { return std::sqrt(2.0 * body.measures.kinetic_energy / body.model->mass); }
TriangleMesh presentSurface(const BodySnapshot& body) {
  TriangleMesh mesh = body.model->surface;
  mesh.vertices = body.surface;
  return mesh;
}

/// [m] of the deepest vertex of a body inside another or an obstacle.
double deepest(World& world) {
  const WorldSnapshot shot = seen(world);
  double most = 0.0;
  const auto look = [&](const TriangleMesh& mesh, const BodySnapshot* own) {
    const SolidQuery solid(mesh);
    for (const BodySnapshot& body : shot.bodies)
      for (const Vec3& p : body.surface)
        if (&body != own && solid.contains(p)) most = std::max(most, solid.distance(p));
  };
  for (const auto& obstacle : shot.obstacles) look(obstacle->mesh, nullptr);
  for (const BodySnapshot& body : shot.bodies) look(presentSurface(body), &body);
  return most;
}

// Hertz 1882: F = 4/3 E / (1 - nu^2) sqrt(R) d^(3/2), of a ball between planes, pressed by d at each. The upper one is
// a push sphere a hundred times as large. Cells of a fifth of the radius answer by 5 to 18 % more.
TEST(ContactCases, APressedBallAnswersAsHertzSays) {
  const double radius = 0.05;
  for (const double poissons_ratio : {0.3, 0.45}) {
    WorldSettings settings = test::weightless();
    settings.ground = 0.0;
    settings.sleep = false;
    World world(settings);
    BodyDef ball = bodyOf(sphereMesh(radius, 0.01), elastic(1e4, poissons_ratio), 0.01, Vec3(0, 0, radius));
    ball.material.friction = 0.0;
    ball.material.damping = 100.0;
    add(world, ball);
    PushCommand push;
    push.radius = 100.0 * radius;
    push.position = Vec3(0, 0, 2.0 * radius + push.radius);
    replyOf<Done>(world.apply(push));
    push.speed = 0.03;
    for (const double share : {0.1, 0.14}) {
      const double depth = share * radius;
      push.position.z() = 2.0 * (radius - depth) + push.radius;
      replyOf<Done>(world.apply(push));
      run(world, 0.6);
      double force = 0.0;  // between the planes it swings for long
      for (int n = 0; n < 60; ++n) {
        world.step();
        force += world.push().force.norm() / 60.0;
      }
      const double hertz =
          4.0 / 3.0 * 1e4 / (1.0 - poissons_ratio * poissons_ratio) * std::sqrt(radius) * std::pow(depth, 1.5);
      EXPECT_NEAR(force / hertz, 1.0, 0.2) << poissons_ratio << ", " << share;
    }
  }
}

// What is too soft buckles under its own weight, as it has to.
TEST(ContactCases, AStackOfTenStands) {
  for (const double alpha : {0.99, 1.0}) {
    SCOPED_TRACE(alpha);
    World world({});
    for (int n = 0; n < 10; ++n)
      add(world, bodyOf(boxMesh(Vec3::Constant(0.05), 2, 2, 2), looks(alpha), 0.025, Vec3(0, 0, 0.025 + 0.0502 * n),
                        "cube" + std::to_string(n)));
    for (int second = 0; second < 10; ++second) {
      run(world, 1.0);
      const WorldSnapshot shot = seen(world);
      for (std::size_t n = 0; n < 10; ++n) {
        const Vec3& at = shot.bodies[n].measures.centre_of_mass;
        EXPECT_LT(std::hypot(at.x(), at.y()), 0.0125) << n << " after " << second;  // a quarter of a cube: it sways
        EXPECT_NEAR(at.z(), 0.025 + 0.05 * static_cast<double>(n), 0.002) << n << " after " << second;
      }
    }
    EXPECT_LT(deepest(world), 1e-3);
  }
}

// Half of it beyond the edge, and its weight within: it bends over the edge and lies. Or beyond: it falls.
TEST(ContactCases, AnOrganOnATraysEdge) {
  for (const Material& material : {elastic(5e3), elastic(2e4), looks(0.95)})
    for (const bool stays : {true, false}) {
      SCOPED_TRACE(std::to_string(material.youngs_modulus) + (stays ? " stays" : " falls"));
      World world(without(-0.3));
      add(world, "tray", boxMesh(Vec3(0.4, 0.4, 0.02), 1, 1, 1), Vec3(-0.2, 0, -0.01));
      add(world,
          bodyOf(boxMesh(Vec3(0.15, 0.08, 0.03), 10, 5, 2), material, 0.015, Vec3(stays ? -0.02 : 0.03, 0, 0.016)));
      for (int n = 0; n < 8; ++n) {
        run(world, 0.25);
        EXPECT_LT(deepest(world), 1.5e-3) << n;
      }
      const BodySnapshot body = seen(world).bodies[0];
      EXPECT_EQ(body.measures.centre_of_mass.z() > -0.1, stays);
      EXPECT_NEAR(body.measures.volume, body.model->rest_volume, 0.03 * body.model->rest_volume);
      if (stays) {
        EXPECT_LT(std::abs(body.measures.centre_of_mass.x() + 0.02), 0.01);
        EXPECT_LT(speed(body), 1e-3);
      }
    }
}

// Squeezed by a sixth between two blocks it hangs from them by friction.
TEST(ContactCases, AThreadBetweenJaws) {
  for (const Material& material : {elastic(2e4), elastic(2e5)}) {
    SCOPED_TRACE(material.youngs_modulus);
    World world(without(std::nullopt));
    for (const double side : {-1.0, 1.0})
      add(world, side < 0.0 ? "left" : "right", boxMesh(Vec3(0.01, 0.02, 0.02), 1, 1, 1),
          Vec3(side * (0.005 + 0.5 * 0.0025), 0, 0));
    BodyDef thread = bodyOf(boxMesh(Vec3(0.003, 0.003, 0.06), 1, 1, 18), material, 0.003, Vec3(0, 0, -0.015));
    add(world, thread);
    run(world, 1.0);
    const Vec3 before = seen(world).bodies[0].measures.centre_of_mass;
    run(world, 0.5);
    const Vec3 after = seen(world).bodies[0].measures.centre_of_mass;
    EXPECT_NEAR(after.z(), before.z(), 2e-4) << "it swings, and does not slide";
    EXPECT_LT(std::hypot(after.x(), after.y()), 0.005);
    EXPECT_NEAR(before.z(), -0.015, 0.002);
    EXPECT_LT(deepest(world), 5e-4);
  }
}

TEST(ContactCases, TenOrgansInABowlComeToRest) {
  for (const Material& material : {elastic(2e4), looks(0.9)}) {
    SCOPED_TRACE(material.youngs_modulus);
    World world(without(std::nullopt));
    add(world, "bowl", bowlMesh(0.18, 0.14, 0.01));
    test::Random random(3);
    for (unsigned n = 0; n < 10; ++n)
      add(world, bodyOf(*randomOrgan(300 + n, 0, 0.08, 200), material, 0.02,
                        Vec3(n % 2 ? 0.045 : -0.045, random.uniform(-0.02, 0.02), 0.09 + 0.075 * (n / 2)),
                        "organ" + std::to_string(n)));
    for (int n = 0; n < 6 && world.snapshot({}).report.asleep < 10; ++n) {
      run(world, 1.0);
      // Contact's surface of these cells of 2 cm is off the visual one by that much: 0.8 to 2.8 mm, by the organs.
      EXPECT_LT(deepest(world), 3e-3) << n;
    }
    EXPECT_EQ(world.snapshot({}).report.asleep, 10u);
    for (const BodySnapshot& body : seen(world).bodies) {
      EXPECT_GT(body.measures.centre_of_mass.z(), 0.0);
      EXPECT_GT(body.measures.volume, (material.elastic() ? 0.95 : 0.75) * body.model->rest_volume);
    }
  }
}

// It falls together, not into itself, and is cut.
TEST(ContactCases, ACollapsedBladderIsCut) {
  for (const double wall : {0.0025, 0.006}) {
    SCOPED_TRACE(wall);
    World world({});
    TriangleMesh mesh = sphereMesh(0.05, 0.01);
    shapes::append(mesh, shapes::turnedInsideOut(sphereMesh(0.05 - wall, 0.01)));
    add(world, bodyOf(mesh, elastic(11100.0), 0.01, Vec3(0, 0, 0.051)));
    run(world, 1.5);
    const BodySnapshot whole = seen(world).bodies[0];
    EXPECT_LT(boundsOf(whole.surface).max.z(), 0.06) << "it has collapsed";
    // Cells four times as wide as the thin wall let its two faces come nearer.
    EXPECT_GT(whole.measures.volume, (wall < 0.003 ? 0.6 : 0.9) * whole.model->rest_volume);
    CutCommand cut;
    cut.blades.origin = whole.measures.centre_of_mass - Vec3(0, 0.2, 0);
    cut.blades.x_axis = Vec3::UnitY();
    cut.blades.y_axis = Vec3(0.1, 0, 1).normalized();
    EXPECT_GE(replyOf<CutReply>(world.apply(cut)).new_bodies.size(), 2u);
    double volume = 0.0;
    for (const BodySnapshot& piece : seen(world).bodies) volume += piece.measures.volume;
    // Folded cells let go of what a blade has parted: the surface follows those of its own side from then on.
    EXPECT_NEAR(volume, whole.measures.volume, 1e-2 * whole.measures.volume);
    run(world, 0.5);
    for (const BodySnapshot& piece : seen(world).bodies) EXPECT_LT(speed(piece), 0.5);
  }
}

// A membrane that is as thin as one of its cells is wide.
TEST(ContactCases, AMembraneLiesOverABallAndIsCut) {
  const double thickness = 0.003, radius = 0.03;
  World world(without(0.0));
  add(world, "ball", sphereMesh(radius, 0.006), Vec3(0.0, 0.0, radius));
  BodyDef def;
  def.mesh.vertices = {{-0.05, -0.05, 0}, {0.05, -0.05, 0}, {0.05, 0.05, 0}, {-0.05, 0.05, 0}};
  def.mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  def = bodyOf(def.mesh, elastic(1e4), thickness, Vec3(0.0, 0.0, 2.0 * radius + 0.005), "membrane");
  def.solid = false;
  def.thickness = thickness;
  add(world, def);
  run(world, 1.0);
  CutCommand cut;
  cut.blades.x_axis = Vec3::UnitX();
  cut.blades.y_axis = Vec3(0.0, 0.6, 0.8);
  cut.blades.origin = Vec3(-1.0, 0.003, 2.0 * radius);
  ASSERT_EQ(replyOf<CutReply>(world.apply(cut)).new_bodies.size(), 2u);
  for (int n = 0; n < 6; ++n) {
    run(world, 0.25);
    const WorldSnapshot shot = seen(world);
    for (const BodySnapshot& body : shot.bodies) {
      EXPECT_NEAR(body.measures.volume, body.model->rest_volume, 0.05 * body.model->rest_volume);
      for (const Vec3& p : body.surface) {
        EXPECT_GT(p.z(), -0.001);
        EXPECT_GT((p - Vec3(0.0, 0.0, radius)).norm(), radius - 0.0015) << p.transpose();
      }
    }
  }
}

// Bodies of any shape, spawned inside of others and of obstacles, are refused where they are wholly inside. Others are
// not thrown out; who is half inside what is convex comes out.
TEST(ContactCases, WhoIsSpawnedInsideIsLetOutSlowly) {
  const std::vector<shapes::Shape> hosts = {{"box of 12", boxMesh(Vec3::Constant(0.2), 1, 1, 1)},
                                            {"hollow", shapes::moved(shapes::hollowSphere(), Pose(), 1.5)},
                                            {"torus", torusMesh(0.1, 0.04, 0.03)},
                                            {"plate", boxMesh(Vec3(0.3, 0.3, 0.005), 3, 3, 1)}};
  const std::vector<shapes::Shape> guests = {{"torus", torusMesh(0.035, 0.014, 0.012)},
                                             {"hollow", shapes::moved(shapes::hollowSphere(), Pose(), 0.5)}};
  int refused = 0;
  const auto inside = [&](const shapes::Shape& host, const shapes::Shape& guest, const Material& material,
                          bool obstacle, bool half) {
    SCOPED_TRACE(guest.name + (half ? " half in " : " in ") + (obstacle ? "obstacle " : "body ") + host.name +
                 (material.elastic() ? ", elastic" : ", alpha " + std::to_string(material.alpha)));
    World world(test::weightless());
    if (obstacle)
      add(world, "host", host.mesh);
    else
      add(world, bodyOf(host.mesh, material, 0.05, Vec3::Zero(), "host"));
    BodyDef def =
        bodyOf(guest.mesh, material, 0.025, half ? Vec3(0.083, 0.011, 0.007) : Vec3(0.004, 0.003, -0.002), "guest");
    def.pose.rotation = Quat(Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()));
    const PreparedBody prepared = test::prepared(def);
    const SolidQuery solid(host.mesh);
    const bool wholly = std::all_of(prepared.state.surface.begin(), prepared.state.surface.end(),
                                    [&](const Vec3& p) { return solid.contains(p); });
    ASSERT_EQ(world.addSceneBody(std::make_shared<const PreparedBody>(prepared)).ok(), !wholly);
    refused += wholly;
    if (wholly) return;
    const bool comes_out = half && host.mesh.vertices.size() == 8;
    const double before = comes_out ? deepest(world) : 0.0;
    double fastest = 0.0;
    for (int n = 0; n < 60; ++n) {
      world.step();
      for (const BodySnapshot& body : world.snapshot({false, false, true}).bodies)
        fastest = std::max(fastest, speed(body));
    }
    EXPECT_LT(fastest, 1.5);
    if (comes_out) EXPECT_LT(deepest(world), std::max(1e-3, 0.95 * before));
  };
  for (const shapes::Shape& host : hosts)
    for (const shapes::Shape& guest : guests)
      for (const Material& material : {elastic(2e4), looks(1.0)})
        for (const bool obstacle : {true, false})
          for (const bool half : {false, true})
            if (obstacle || host.name != "plate") inside(host, guest, material, obstacle, half);
  EXPECT_EQ(refused, 8) << "both guests in the middle of the box";
}

}  // namespace contact_cases_test
}  // namespace meshless
