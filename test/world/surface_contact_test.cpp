// Laws of contact in present space, on whole bodies in a world.
#include <cmath>
#include <cstdio>

#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/refine.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"
#include "support/random.h"

namespace meshless {
namespace surface_contact_test {

using test::replyOf;

constexpr double kG = 9.81;

WorldSettings surface(WorldSettings settings = {}) {
  settings.contact = ContactMethod::kSurface;
  return settings;
}

WorldSettings space() {
  WorldSettings settings = surface(test::weightless());
  settings.sleep = false;
  return settings;
}

/// Elastic, of four cells along its longest side; longest: edge of the surface, in cells.
BodyDef block(const std::string& name, const Vec3& at, const Vec3& size = Vec3::Constant(0.1), double longest = 1.5) {
  const double cell = size.maxCoeff() / 4.0;
  const auto parts = [cell](double length) { return std::max(1, static_cast<int>(std::lround(length / cell))); };
  const TriangleMesh mesh = boxMesh(size, parts(size.x()), parts(size.y()), parts(size.z()));
  BodyDef def = test::defOf(withShortEdges(mesh, longest * cell), name);
  def.pose.translation = at;
  def.spacing = cell;
  def.material.youngs_modulus = 2e4;
  def.material.poissons_ratio = 0.4;
  def.material.density = 1000.0;
  def.material.damping = 5.0;
  def.material.friction = 0.5;
  return def;
}

void add(World& world, const BodyDef& def, const Vec3& velocity = Vec3::Zero(), const Vec3& spin = Vec3::Zero()) {
  PreparedBody body = test::prepared(def);
  for (std::size_t i = 0; i < body.state.velocities.size(); ++i)
    body.state.velocities[i] = velocity + spin.cross(body.state.positions[i] - def.pose.translation);
  const Result<SpawnReply> reply = world.addSceneBody(std::make_shared<const PreparedBody>(std::move(body)));
  ASSERT_TRUE(reply.ok()) << reply.error().detail;
}

void run(World& world, double seconds) {
  const int steps = static_cast<int>(std::lround(seconds * world.settings().step_rate));
  for (int n = 0; n < steps; ++n) world.step();
}

// Two flat blocks that lie on each other: cubes as soft would buckle.
BodyDef slab(const std::string& name, const Vec3& at, double youngs_modulus = 1e5) {
  BodyDef def = block(name, at, Vec3(0.1, 0.1, 0.05));
  def.material.youngs_modulus = youngs_modulus;
  return def;
}
void addStack(World& world, double youngs_modulus = 1e5) {
  add(world, slab("low", Vec3(0, 0, 0.0255), youngs_modulus));
  add(world, slab("high", Vec3(0.013, 0.007, 0.0765), youngs_modulus));
}

WorldSnapshot seen(World& world) { return world.snapshot({true, true, true, true}); }
Vec3 centre(World& world, std::size_t body) { return seen(world).bodies[body].measures.centre_of_mass; }
Vec3 velocity(World& world, std::size_t body) {
  const BodySnapshot b = seen(world).bodies[body];
  return b.measures.linear_momentum / b.model->mass;
}

struct Books {
  Vec3 momentum = Vec3::Zero(), angular = Vec3::Zero();
  double kinetic = 0.0;
};
Books books(World& world) {
  Books sum;
  for (const BodySnapshot& b : seen(world).bodies) {
    sum.momentum += b.measures.linear_momentum;
    sum.angular += b.measures.angular_momentum + b.measures.centre_of_mass.cross(b.measures.linear_momentum);
    sum.kinetic += b.measures.kinetic_energy;
  }
  return sum;
}

/// [m] of the deepest vertex of a inside b.
double depth(const BodySnapshot& a, const BodySnapshot& b) {
  TriangleMesh mesh = b.model->surface;
  mesh.vertices = b.surface;
  const SolidQuery solid(mesh);
  double deepest = 0.0;
  for (const Vec3& p : a.surface)
    if (solid.contains(p)) deepest = std::max(deepest, solid.distance(p));
  return deepest;
}
double depthBetween(World& world) {
  const WorldSnapshot shot = seen(world);
  return std::max(depth(shot.bodies[0], shot.bodies[1]), depth(shot.bodies[1], shot.bodies[0]));
}

double lowest(const BodySnapshot& body) {
  double z = std::numeric_limits<double>::infinity();
  for (const Vec3& p : body.surface) z = std::min(z, p.z());
  return z;
}

ObstacleDef table(double thickness = 0.05, double friction = 0.5) {
  ObstacleDef def;
  def.name = "table";
  def.mesh = boxMesh(Vec3(0.6, 0.6, thickness), 6, 6, 1);
  def.friction = friction;
  return def;
}

TEST(SurfaceContact, ABlockComesToRestOnTheGroundAndSleeps) {
  World world(surface());
  add(world, block("block", Vec3(0, 0, 0.07)));
  run(world, 3.0);
  const BodySnapshot body = seen(world).bodies[0];
  EXPECT_TRUE(body.asleep);
  EXPECT_NEAR(body.measures.centre_of_mass.z(), 0.05, 0.003) << "it settles under its weight";
  EXPECT_LT(body.measures.centre_of_mass.head<2>().norm(), 0.001);
  EXPECT_GT(lowest(body), -2e-4);
}

TEST(SurfaceContact, ABlockComesToRestOnAnObstacleAndSleeps) {
  WorldSettings settings = surface();
  settings.ground.reset();
  World world(settings);
  ASSERT_TRUE(world.addObstacle(table()).ok());
  add(world, block("block", Vec3(0.02, 0.01, 0.1)));
  run(world, 3.0);
  const BodySnapshot body = seen(world).bodies[0];
  EXPECT_TRUE(body.asleep);
  EXPECT_NEAR(body.measures.centre_of_mass.z(), 0.075, 0.004);
  EXPECT_LT((body.measures.centre_of_mass - Vec3(0.02, 0.01, 0)).head<2>().norm(), 0.001);
  EXPECT_GT(lowest(body), 0.025 - 2e-4);
}

TEST(SurfaceContact, ABlockComesToRestOnAnotherAndBothSleep) {
  World world(surface());
  addStack(world);
  run(world, 4.0);
  const WorldSnapshot shot = seen(world);
  EXPECT_TRUE(shot.bodies[0].asleep);
  EXPECT_TRUE(shot.bodies[1].asleep);
  EXPECT_NEAR(shot.bodies[0].measures.centre_of_mass.z(), 0.025, 0.0015);
  EXPECT_NEAR(shot.bodies[1].measures.centre_of_mass.z(), 0.075, 0.003);
  EXPECT_LT((shot.bodies[1].measures.centre_of_mass - Vec3(0.013, 0.007, 0)).head<2>().norm(), 0.002);
  EXPECT_LT(depthBetween(world), 0.001);
}

// Soft bodies are kneaded where they roll: without a loss there they rock for a quarter of a minute.
TEST(SurfaceContact, AnEggThatRocksComesToRestAndSleeps) {
  World world(surface());
  BodyDef egg = block("egg", Vec3(0, 0, 0.056));
  egg.mesh = sphereMesh(0.05, 0.012);
  for (Vec3& v : egg.mesh.vertices) v.x() *= 1.6;
  egg.pose.rotation = Quat(Eigen::AngleAxisd(0.3, Vec3::UnitY()));
  egg.spacing = 0.0125;
  egg.material.youngs_modulus = 1e4;
  add(world, egg, Vec3(0.1, 0.3, 0.0), Vec3(-6.0, 2.0, 0.0));
  run(world, 6.5);
  const BodySnapshot body = seen(world).bodies[0];
  EXPECT_TRUE(body.asleep) << std::sqrt(2.0 * body.measures.kinetic_energy / body.model->mass) << " m/s";
  EXPECT_GT(body.measures.centre_of_mass.head<2>().norm(), 0.05) << "it has rolled";
}

// Rolling kneads tissue: what rolls on the ground is damped as what deforms.
TEST(SurfaceContact, ABallRollsOutAsFastAsItsTissueIsDamped) {
  for (const double damping : {0.5, 2.0}) {
    SCOPED_TRACE(damping);
    World world(surface());
    BodyDef ball = block("ball", Vec3(0, 0, 0.0501));
    ball.mesh = sphereMesh(0.05, 0.012);
    ball.spacing = 0.0125;
    ball.material.youngs_modulus = 5e4;
    ball.material.damping = damping;
    ball.material.friction = 0.9;
    add(world, ball, Vec3(0.5, 0, 0), Vec3(0, 10.0, 0));
    const auto speed = [&] { return seen(world).bodies[0].measures.velocity.norm(); };
    run(world, 0.2);
    const double before = speed();
    run(world, 1.0 / damping);
    EXPECT_GT(before, 0.25);
    EXPECT_NEAR(std::log(before / speed()), 1.0, 0.35);
  }
}

// As on each other above, with a material five times as soft.
TEST(SurfaceContact, SoftBlocksOnEachOtherSleep) {
  World world(surface());
  addStack(world, 2e4);
  run(world, 6.0);
  double speed = 0.0;
  for (const BodySnapshot& b : seen(world).bodies)
    speed = std::max(speed, std::sqrt(2.0 * b.measures.kinetic_energy / b.model->mass));
  EXPECT_LT(depthBetween(world), 0.001);
  EXPECT_LT((centre(world, 1) - Vec3(0.013, 0.007, 0)).head<2>().norm(), 0.004);
  EXPECT_LT(speed, 0.02);
  EXPECT_EQ(world.snapshot({}).report.asleep, 2u) << speed << " m/s";
}

// (At 4 m/s they are crushed to a third, and gain half of their energy as they unfold.)
/// Of edges of the surface, in cells: users' surfaces are often finer than their cells.
class Fineness : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(SurfaceContact, Fineness, testing::Values(1.5, 1.0, 0.7, 0.5));

TEST_P(Fineness, MomentumAndAngularMomentumStayInACollision) {
  for (const double speed : {0.5, 2.0}) {
    SCOPED_TRACE(speed);
    World world(space());
    add(world, block("a", Vec3(0, 0, 0), Vec3::Constant(0.1), GetParam()), Vec3(speed, 0, 0), Vec3(0.3, 0.5, 2.0));
    BodyDef other = block("b", Vec3(0.14, 0.03, 0.04), Vec3::Constant(0.1), GetParam());
    other.pose.rotation = Quat(Eigen::AngleAxisd(0.5, Vec3(0.3, 1.0, 0.2).normalized()));
    other.material.youngs_modulus = 1e4;
    add(world, other, Vec3(-0.3 * speed, 0, 0));
    const Books before = books(world);
    std::size_t met = 0;
    double kinetic = before.kinetic;
    for (int step = 0; step < 90; ++step) {
      world.step();
      met += world.snapshot({}).report.contact_counters.corrected > 0;
      kinetic = std::max(kinetic, books(world).kinetic);
    }
    const Books after = books(world);
    EXPECT_GT(met, 0u);
    EXPECT_GT(velocity(world, 1).x(), -0.1 * speed) << "it was hit";
    EXPECT_LT((after.momentum - before.momentum).norm(), 1e-9 * before.momentum.norm());
    EXPECT_LT((after.angular - before.angular).norm(), 1e-9 * before.momentum.norm() * 0.1);
    EXPECT_LT(kinetic, before.kinetic * (1.0 + 1e-6));
    EXPECT_LT(depthBetween(world), 0.001);
  }
}

/// [m] of the lowest vertex ever, of a block thrown onto the table.
double lowestOfThrown(double speed, double thickness, double youngs_modulus) {
  World world(space());
  EXPECT_TRUE(world.addObstacle(table(thickness)).ok());
  BodyDef def = block("block", Vec3(0.01, 0.02, 0.12));
  def.pose.rotation = Quat(Eigen::AngleAxisd(0.4, Vec3(1.0, 0.3, 0.1).normalized()));
  def.material.youngs_modulus = youngs_modulus;
  add(world, def, Vec3(0, 0, -speed));
  double z = 1.0;
  for (int step = 0; step < 40; ++step) {
    world.step();
    z = std::min(z, lowest(seen(world).bodies[0]));
  }
  return z;
}

// On what is thinner than the way of a step.
TEST(SurfaceContact, AThrownBlockDoesNotGoThroughAThinPlate) {
  for (const double speed : {2.0, 8.0}) EXPECT_GT(lowestOfThrown(speed, 0.004, 2e4), 0.0) << speed;
  for (const double speed : {8.0, 20.0}) EXPECT_GT(lowestOfThrown(speed, 0.004, 2e5), 0.0) << speed;
}

// The pressure of the impact is ten times what the material resists with: it is crushed, but on this side of the plate.
TEST(SurfaceContact, ABlockThatIsCrushedDoesNotGoThroughAPlate) {
  for (const double thickness : {0.005, 0.02}) EXPECT_GT(lowestOfThrown(10.0, thickness, 2e4), 0.0) << thickness;
}

// Bounced, spun and turned inside out by the impact, whatever the block and the plate are: what touches while it is
// inside out is known by the side it was on.
TEST(SurfaceContact, ThrownBlocksStayOnTheirSideOfThinPlates) {
  test::Random random(11);
  int stayed = 0, visits = 0, shots_inside = 0;
  for (int shot = 0; shot < 32; ++shot) {
    WorldSettings settings = space();
    settings.gravity = Vec3(0, 0, -kG);
    settings.step_rate = shot % 2 ? 60.0 : 120.0;
    settings.substeps = 1;
    World world(settings);
    ObstacleDef plate = table();
    const double thickness = shot % 3 ? 0.005 : random.uniform(0.005, 0.03), top = 0.5 * thickness, rim = 2.0;
    plate.mesh = boxMesh(Vec3(2.0 * rim, 2.0 * rim, thickness), 40, 40, 1);
    ASSERT_TRUE(world.addObstacle(plate).ok());
    const Quat turn(Eigen::AngleAxisd(random.uniform(0.0, 3.0), random.vector(1.0).normalized()));
    const int parts = 2 + shot % 5;
    BodyDef def = test::defOf(boxMesh(Vec3::Constant(0.05), parts, parts, parts), "block");
    def.pose.translation = Vec3(0.01, 0.02, 0.08 + top);
    def.pose.rotation = turn;
    def.spacing = 0.05 / (shot % 4 ? 2 + parts : parts);
    if (shot % 4) {
      def.material.youngs_modulus = std::pow(10.0, random.uniform(3.7, 5.7));
      def.material.poissons_ratio = random.uniform(0.2, 0.45);
      def.material.damping = 20.0;
    } else {
      def.clusters.kind = ClusterOptions::Kind::kOne;
      def.material.alpha = random.uniform(0.8, 1.0);
    }
    const Vec3 way(random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3), -1.0);
    add(world, def, random.uniform(1.0, 10.0) * way.normalized());
    bool left = false;
    int inside_now = 0;
    for (int step = 0; step < settings.step_rate && !left; ++step) {
      world.step();
      inside_now = 0;
      const BodySnapshot body = seen(world).bodies[0];
      left = body.measures.centre_of_mass.head<2>().cwiseAbs().maxCoeff() > 0.9 * rim;
      for (const Vec3& p : body.surface) inside_now += p.z() < top - 1e-3 && p.z() > -top;
      if (!left) visits += inside_now;
    }
    if (left) continue;
    ++stayed;
    EXPECT_GT(lowest(seen(world).bodies[0]), top - 1e-3) << "shot " << shot;
    shots_inside += inside_now > 0;
  }
  EXPECT_GT(stayed, 10);
  EXPECT_LE(visits, 20) << "vertices inside the plate, step by step";
  EXPECT_EQ(shots_inside, 0);
}

TEST(SurfaceContact, ResultsDoNotDependOnThreads) {
  std::uint64_t hash[2];
  for (const int threads : {1, 2}) {
    WorldSettings settings = surface();
    settings.threads = threads;
    World world(settings);
    ASSERT_TRUE(world.addObstacle(table()).ok());
    add(world, block("low", Vec3(0, 0, 0.08)));
    add(world, block("high", Vec3(0.02, 0.01, 0.19)), Vec3(0.2, 0, -1.0));
    add(world, block("beside", Vec3(0.6, 0, 0.055)));
    BodyDef large = block("large, whose cells are shared out", Vec3(2.0, 0, 0.2));
    large.material.youngs_modulus = 5000.0;
    large.spacing = 0.006;
    add(world, large, Vec3(0.1, 0.2, 0.3));
    run(world, 0.4);
    hash[threads - 1] = world.stateHash();
  }
  EXPECT_EQ(hash[0], hash[1]);
}

TEST(SurfaceContact, ThePushSphereReportsItsForceAndIsNotPassedThrough) {
  World world(space());
  BodyDef def = block("block", Vec3::Zero());
  def.fixed.push_back(Box{Vec3(-1, -1, -1), Vec3(1, 1, -0.049)});
  add(world, def);
  PushCommand push;
  push.radius = 0.03;
  push.position = Vec3(0.004, 0.003, 0.09);
  ASSERT_TRUE(world.apply(push).ok());
  run(world, 0.1);
  EXPECT_EQ(world.push().force.norm(), 0.0);
  push.position.z() = 0.07;  // a centimetre deep
  push.speed = 0.1;
  ASSERT_TRUE(world.apply(push).ok());
  double last = 0.0;
  run(world, 0.6);
  EXPECT_TRUE(world.push().touching);
  last = world.push().force.z();
  EXPECT_GT(std::abs(last), 0.5);
  EXPECT_LT(world.push().force.head<2>().norm(), 0.3 * std::abs(last));
  const WorldSnapshot shallowly = seen(world);
  for (const Vec3& p : shallowly.bodies[0].surface) EXPECT_GT((p - push.position).norm(), push.radius - 1e-3);
  const double shallow = std::abs(last);
  push.position.z() = 0.06;
  ASSERT_TRUE(world.apply(push).ok());
  run(world, 0.6);
  EXPECT_GT(std::abs(world.push().force.z()), 1.5 * shallow);
  const WorldSnapshot deeper = seen(world);
  for (const Vec3& p : deeper.bodies[0].surface) EXPECT_GT((p - push.position).norm(), push.radius - 1e-3);
  push.position.z() = 0.2;
  ASSERT_TRUE(world.apply(push).ok());
  run(world, 1.5);
  EXPECT_EQ(world.push().force.norm(), 0.0);
  EXPECT_NEAR(seen(world).bodies[0].measures.volume, 1e-3, 1e-5) << "it comes back";
}

TEST(SurfaceContact, APickLiftsABlockOffAnother) {
  World world(surface());
  addStack(world);
  run(world, 3.0);
  PickCommand pick;
  pick.point = Vec3(0.013, 0.007, 0.1);
  pick.body = "high";
  pick.stiffness = 2000.0;
  const PickReply reply = replyOf<PickReply>(world.apply(pick));
  EXPECT_EQ(reply.body, "high");
  const Vec3 low = centre(world, 0), high = centre(world, 1);
  for (int n = 1; n <= 60; ++n) {
    MovePickCommand move;
    move.pick = reply.pick;
    move.target = reply.position + Vec3(0, 0, 0.15 * n / 60.0);
    ASSERT_TRUE(world.apply(move).ok());
    world.step();
  }
  run(world, 2.0);
  EXPECT_GT(centre(world, 1).z() - high.z(), 0.1);
  EXPECT_LT((centre(world, 0) - low).norm(), 0.005);
  EXPECT_GT(lowest(seen(world).bodies[1]), 0.08);
  EXPECT_EQ(depthBetween(world), 0.0);
}

TEST(SurfaceContact, WhoIsFarFromAllCostsNothing) {
  WorldSettings settings = space();
  settings.ground = -10.0;
  World world(settings);
  add(world, block("a", Vec3::Zero()), Vec3(0.1, 0, 0));
  add(world, block("b", Vec3(1, 0, 0)));
  for (int step = 0; step < 20; ++step) {
    world.step();
    if (step == 0) continue;  // in themselves they are looked at once
    const StepReport report = world.snapshot({}).report;
    EXPECT_EQ(report.contact_counters.pairs, 0u);
    EXPECT_EQ(report.contact_counters.contacts, 0u);
    EXPECT_EQ(report.contact_counters.queries, 0u);
    EXPECT_EQ(report.contact_counters.corrected, 0u);
    EXPECT_EQ(report.contact_shapes, 0u);
  }
}

// Bodies that lie still next to each other are queried now and then, sleeping ones never.
TEST(SurfaceContact, WhoLiesStillIsNotQueried) {
  World world(surface());
  addStack(world);
  run(world, 0.8);
  std::size_t queried = 0, rows = 0;
  for (int step = 0; step < 240; ++step) {
    world.step();
    const StepReport report = world.snapshot({}).report;
    queried += report.contact_counters.queries;
    rows += report.contact_counters.contacts;
  }
  EXPECT_LT(queried, rows / 4);
  EXPECT_EQ(world.snapshot({}).report.asleep, 2u);
  EXPECT_EQ(world.snapshot({}).report.contact_counters.contacts, 0u);
}

TEST(SurfaceContact, WhoSleepsIsWokenByWhatFallsOnIt) {
  World world(surface());
  add(world, slab("low", Vec3(0, 0, 0.0255)));
  run(world, 2.0);
  ASSERT_TRUE(seen(world).bodies[0].asleep);
  SpawnCommand spawn;
  spawn.body = test::shared(slab("high", Vec3(0.013, 0.007, 0.082)));
  ASSERT_TRUE(world.apply(spawn).ok());
  std::size_t woken = 0;
  for (int step = 0; step < 60; ++step) {
    world.step();
    woken += world.snapshot({}).report.woken;
    EXPECT_LT(depthBetween(world), 0.001) << step;
  }
  EXPECT_GT(woken, 0u);
  run(world, 3.0);
  EXPECT_EQ(world.snapshot({}).report.asleep, 2u);
  EXPECT_NEAR(centre(world, 1).z(), 0.075, 0.003);
}

TEST_P(Fineness, BodiesSpawnedInEachOtherPartSlowly) {
  World world(space());
  add(world, block("a", Vec3::Zero(), Vec3::Constant(0.1), GetParam()));
  add(world, block("b", Vec3(0.013, 0.007, 0.05), Vec3::Constant(0.1), GetParam()));
  const double mass = 2.0;  // [kg]
  for (int step = 0; step < 720; ++step) {
    world.step();
    const Books now = books(world);
    ASSERT_LT(now.kinetic, 0.5 * mass * 0.1 * 0.1) << "step " << step;
    ASSERT_LT(now.momentum.norm(), 1e-9);
  }
  EXPECT_LT(depthBetween(world), 0.001);
  for (const BodySnapshot& b : seen(world).bodies) EXPECT_NEAR(b.measures.volume, 1e-3, 2e-5);
}

// Twelve triangles, whose corners the sphere never comes near.
TEST(SurfaceContact, ABoxOfTwelveTrianglesIsDentedInTheMiddleOfAFace) {
  double force[2];
  for (const int parts : {1, 20}) {
    World world(space());
    BodyDef def = block("block", Vec3(0, 0, 0.025));
    def.mesh = boxMesh(Vec3(0.1, 0.1, 0.05), parts, parts, std::max(1, parts / 2));
    def.spacing = 0.005;
    def.material.youngs_modulus = 5000.0;
    def.material.damping = 20.0;
    def.fixed.push_back(Box{Vec3(-1, -1, -1), Vec3(1, 1, 0)});
    add(world, def);
    PushCommand push;
    push.radius = 0.025;
    push.position = Vec3(0.0007, 0.0004, 0.076);
    ASSERT_TRUE(world.apply(push).ok());
    push.position.z() = 0.072;
    push.speed = 0.02;
    ASSERT_TRUE(world.apply(push).ok());
    run(world, 2.0);
    force[parts > 1] = world.push().force.z();
  }
  EXPECT_NEAR(force[1], 0.218, 0.15 * 0.218) << "by CalculiX";
  EXPECT_NEAR(force[0], force[1], 0.2 * force[1]);
}

// A bar that swings for seconds under a small load: at its turning points it is slow and far from its rest.
TEST(SurfaceContact, ASlowSwingIsNotTakenForRest) {
  double tip[2];
  for (const bool sleeps : {false, true}) {
    WorldSettings settings = surface();
    settings.ground.reset();
    settings.gravity = Vec3(0, 0, -0.05);
    settings.sleep = sleeps;
    World world(settings);
    BodyDef bar = block("bar", Vec3::Zero(), Vec3(0.2, 0.05, 0.05));
    bar.material.youngs_modulus = 5000.0;
    bar.material.damping = 2.0;
    bar.fixed.push_back(Box{Vec3(-1, -1, -1), Vec3(-0.09, 1, 1)});
    add(world, bar);
    run(world, 15.0);
    EXPECT_EQ(seen(world).bodies[0].asleep, sleeps);
    tip[sleeps] = boundsOf(seen(world).bodies[0].surface).min.z() + 0.025;
  }
  EXPECT_LT(tip[0], -1e-3);
  EXPECT_NEAR(tip[1], tip[0], 0.01 * -tip[0]);
}

TEST(SurfaceContact, WhatSleepsUnderThePushSphereIsPressedAsBeforeAndAPoseThatStaysLeavesItAsleep) {
  World world(surface());
  add(world, slab("slab", Vec3(0, 0, 0.0255), 2e4));
  add(world, block("beside", Vec3(0.5, 0, 0.5)));  // it falls meanwhile
  PushCommand push;
  push.radius = 0.03;
  push.position = Vec3(0.004, 0.003, 0.085);
  ASSERT_TRUE(world.apply(push).ok());
  push.position.z() = 0.075;
  push.speed = 0.1;
  ASSERT_TRUE(world.apply(push).ok());
  Vec3 force;
  for (int n = 0; n < 1200 && !seen(world).bodies[0].asleep; ++n) {
    force = world.push().force;
    world.step();
  }
  ASSERT_TRUE(seen(world).bodies[0].asleep);
  ASSERT_GT(force.norm(), 0.1);
  for (int n = 0; n < 240; ++n) {
    if (n == 120) add(world, block("late", Vec3(-0.5, 0, 0.3)));
    ASSERT_TRUE(world.apply(push).ok());
    world.step();
    EXPECT_TRUE(seen(world).bodies[0].asleep);
    EXPECT_TRUE(world.push().touching);
    EXPECT_LT((world.push().force - force).norm(), 0.02 * force.norm());
  }
  push.position.z() = 0.2;
  ASSERT_TRUE(world.apply(push).ok());
  run(world, 2.0);
  EXPECT_EQ(world.push().force.norm(), 0.0);
  EXPECT_NEAR(boundsOf(seen(world).bodies[0].surface).max.z(), 0.05, 2e-3) << "it comes back";
}

// A hard crumb on a soft slab: the slab takes the substeps that it needs itself, and the crumb is slowed, which is
// said. Where a hand holds the crumb its own motion is what counts.
TEST(SurfaceContact, ASliverDoesNotMakeAllTakeItsSubsteps) {
  const auto substepsWith = [](bool crumb, bool picked) {
    World world(surface());
    add(world, block("slab", Vec3(0, 0, 0.051), Vec3(0.2, 0.2, 0.1)));
    BodyDef hard = block("crumb", Vec3(0.01, 0.0, 0.118), Vec3::Constant(0.03));
    hard.material.youngs_modulus = 5e4;
    if (crumb) add(world, hard);
    run(world, 0.3);
    world.takeEvents();
    if (picked) {
      PickCommand pick;
      pick.body = "crumb";
      pick.point = Vec3(0.01, 0.0, 0.13);
      EXPECT_TRUE(world.apply(pick).ok());
    }
    world.step();
    if (crumb) {
      EXPECT_EQ(seen(world).bodies[0].stiffness_factor, 1.0);
      EXPECT_EQ(seen(world).bodies[1].stiffness_factor < 1.0, !picked);
      EXPECT_TRUE(test::allFinite(seen(world).bodies[1].particles));
    }
    return seen(world).report.substeps;
  };
  const std::size_t alone = substepsWith(false, false);
  EXPECT_LE(substepsWith(true, false), alone + 1);
  EXPECT_GE(substepsWith(true, true), 2 * alone);
}

/// What is said of bodies that are slowed, in the steps of a second.
struct SaidSlowed {
  double needed = 0.0, given = 0.0;  // substeps a step
  std::string text;
};
std::vector<SaidSlowed> slowedWithin(World& world, const std::string& body, double seconds) {
  std::vector<SaidSlowed> all;
  const int steps = static_cast<int>(std::lround(seconds * world.settings().step_rate));
  for (int n = 0; n < steps; ++n) {
    world.step();
    for (const Event& event : world.takeEvents()) {
      if (event.type != EventType::kOverBudget || event.body != body) continue;
      SaidSlowed said;
      said.text = event.text;
      EXPECT_EQ(std::sscanf(event.text.c_str() + body.size(), " needs %lf", &said.needed), 1) << event.text;
      EXPECT_EQ(std::sscanf(event.text.c_str() + event.text.find("; with "), "; with %lf", &said.given), 1)
          << event.text;
      EXPECT_LE(said.given, static_cast<double>(seen(world).report.substeps)) << event.text;
      all.push_back(said);
    }
  }
  return all;
}
double neededAtRest(World& world, std::size_t body) {
  return substepsNeeded(*seen(world).bodies[body].model, BodyState(), 1.0 / world.settings().step_rate);
}

// Not of max_substeps, of which there are enough.
TEST(SurfaceContact, ASliverIsToldThatItIsOne) {
  World world(surface());
  add(world, block("slab", Vec3(0, 0, 0.051), Vec3(0.2, 0.2, 0.1)));
  BodyDef hard = block("crumb", Vec3(0.01, 0.0, 0.118), Vec3::Constant(0.03));
  hard.material.youngs_modulus = 5e4;
  add(world, hard);
  const std::vector<SaidSlowed> said = slowedWithin(world, "crumb", 1.0);
  ASSERT_EQ(said.size(), 1u);
  EXPECT_NE(said[0].text.find("it is a sliver: at most 5 % of the mass"), std::string::npos) << said[0].text;
  EXPECT_EQ(said[0].text.find("max_substeps"), std::string::npos) << said[0].text;
  EXPECT_GE(said[0].needed, neededAtRest(world, 1));
  EXPECT_LT(said[0].given, said[0].needed);
  EXPECT_LT(said[0].given, world.settings().max_substeps);
}

// A frame of what goes fast has several parts, and what swings needs now more and now less than there is.
TEST(SurfaceContact, OfWhatIsSlowedIsSaidOnceASecondWhatAStepHas) {
  for (const double speed : {0.0, 6.0, 12.0}) {
    WorldSettings settings = surface();
    World measured(settings);
    add(measured, block("thrown", Vec3(0, 0, 0.2)));
    settings.max_substeps = static_cast<int>(neededAtRest(measured, 0));
    World world(settings);
    add(world, block("thrown", Vec3(0, 0, 0.2)), Vec3(0, 0, -speed), Vec3(3, 40, 0));
    add(world, block("wall", Vec3(0, 0, 0.0505), Vec3(0.2, 0.2, 0.1)));
    const std::vector<SaidSlowed> said = slowedWithin(world, "thrown", 1.0);
    std::string texts;
    for (const SaidSlowed& one : said) texts += one.text + "\n";
    ASSERT_EQ(said.size(), 1u) << texts;
    EXPECT_GE(said[0].given, settings.max_substeps) << said[0].text;
    EXPECT_GT(said[0].needed, said[0].given) << said[0].text;
    EXPECT_NE(said[0].text.find("(max_substeps is " + std::to_string(settings.max_substeps) + ")"), std::string::npos)
        << said[0].text;
    EXPECT_NE(said[0].text.find(std::to_string(settings.max_substeps) + " at rest"), std::string::npos) << said[0].text;
  }
}

// Walls of twelve triangles: along their upper edges nothing but the edges themselves holds the tissue.
TEST(SurfaceContact, TissueLiesOnLongEdgesBetweenItsVertices) {
  for (const double turned : {0.0, 0.2, 0.7}) {
    World world(surface());
    std::vector<Vec3> tops;
    const Mat3 turn = Eigen::AngleAxisd(turned, Vec3::UnitZ()).toRotationMatrix();
    for (const double y : {-0.03, 0.03}) {
      ObstacleDef wall;
      wall.name = y < 0.0 ? "right" : "left";
      wall.mesh = boxMesh(Vec3(0.4, 0.004, 0.05), 1, 1, 1);
      for (Vec3& p : wall.mesh.vertices) p = turn * (p + Vec3(0, y, 0.025));
      ASSERT_TRUE(world.addObstacle(wall).ok());
      for (const double side : {-0.002, 0.002})
        for (double x = -0.06; x <= 0.06; x += 1e-3) tops.push_back(turn * Vec3(x, y + side, 0.05));
    }
    BodyDef def = block("tissue", Vec3(0, 0, 0.0755), Vec3(0.1, 0.1, 0.05));
    def.material.youngs_modulus = 5000.0;
    add(world, def);
    run(world, 2.0);
    const BodySnapshot body = seen(world).bodies[0];
    TriangleMesh mesh = body.model->surface;
    mesh.vertices = body.surface;
    const SolidQuery solid(mesh);
    double deepest = 0.0;
    for (const Vec3& p : tops)
      if (solid.contains(p)) deepest = std::max(deepest, solid.distance(p));
    EXPECT_LT(deepest, 1e-3) << turned;
    EXPECT_GT(body.measures.centre_of_mass.z(), 0.06) << turned;
  }
}

// What is held cannot give way, and what is next to it would have to go many times as far in its stead.
TEST(SurfaceContact, ASphereOnHeldTissueFlingsNothingAway) {
  for (const auto& [seed, spacing] : std::vector<std::pair<std::uint64_t, double>>{
           {1, 0.0}, {2, 0.0}, {3, 0.0}, {1, 0.006}, {2, 0.0055}, {2, 0.008}, {3, 0.0035}, {1, 0.009}}) {
    SCOPED_TRACE(std::to_string(seed) + ", spacing " + std::to_string(spacing));
    WorldSettings settings = surface();
    settings.ground.reset();
    World world(settings);
    Result<TriangleMesh> mesh = randomOrgan(seed, 0, 0.06, 1500);
    ASSERT_TRUE(mesh.ok());
    const Box box = boundsOf(mesh->vertices);
    BodyDef def = test::defOf(std::move(*mesh), "organ");
    def.material.youngs_modulus = 2500.0;
    def.material.poissons_ratio = 0.45;
    def.material.damping = 2.0;
    def.spacing = spacing;
    const double top = box.max.z();
    def.fixed.push_back(Box{Vec3(-1, -1, top - 0.2 * (top - box.min.z())), Vec3(1, 1, 1)});
    add(world, def);
    run(world, 0.5);
    const Box hung = boundsOf(seen(world).bodies[0].surface);
    PushCommand push;
    push.radius = 0.015;
    push.position = Vec3(0.001, 0.002, top + 0.02);
    ASSERT_TRUE(world.apply(push).ok());
    push.position.z() = top;
    push.speed = 0.2;
    ASSERT_TRUE(world.apply(push).ok());
    double farthest = 0.0;
    for (int n = 0; n < 30; ++n) {
      world.step();
      const WorldSnapshot now = seen(world);
      for (const Vec3& p : now.bodies[0].surface)
        farthest = std::max(farthest, (p - p.cwiseMax(hung.min).cwiseMin(hung.max)).norm());
    }
    EXPECT_LT(farthest, 2.0 * push.radius) << seed;
    push.enable = false;
    ASSERT_TRUE(world.apply(push).ok());
    run(world, 3.0);
    const BodySnapshot after = seen(world).bodies[0];
    EXPECT_NEAR(after.measures.volume / after.model->rest_volume, 1.0, 0.02) << seed;
  }
}

// What too few substeps slow comes to rest where enough of them would bring it.
class SlowedBodies : public ::testing::TestWithParam<const char*> {
 protected:
  static BodyDef stiff(BodyDef def, double density = 1000.0) {
    def.material.youngs_modulus = 4e5;
    def.material.density = density;
    def.material.damping = 10.0;
    return def;
  }

  // What the scene's name says of it: a length that the material decides on, or a force.
  static double restingAt(const std::string& scene, int max_substeps, double& factor) {
    WorldSettings settings = surface();
    settings.sleep = false;
    settings.max_substeps = max_substeps;
    if (scene == "held" || scene == "hung") settings.ground.reset();
    World world(settings);
    const bool pressed = scene == "pressed" || scene == "pressed_held";
    if (scene == "stacked") {
      add(world, stiff(slab("low", Vec3(0, 0, 0.0255))));
      add(world, stiff(slab("high", Vec3(0.013, 0.007, 0.0765)), 5000.0));
    } else if (scene == "held") {
      BodyDef bar = stiff(block("bar", Vec3::Zero(), Vec3(0.2, 0.05, 0.05)));
      bar.fixed.push_back(Box{Vec3(-1, -1, -1), Vec3(-0.09, 1, 1)});
      add(world, bar);
    } else {
      BodyDef def = stiff(block("block", Vec3(0, 0, 0.051)), scene == "hung" ? 4000.0 : 1000.0);
      if (scene == "pressed_held") def.fixed.push_back(Box{Vec3(-1, -1, -1), Vec3(1, 1, 0.02)});
      add(world, def);
    }
    if (scene == "hung") {
      PickCommand pick;
      pick.point = Vec3(0, 0, 0.1);
      pick.stiffness = 5e4;
      EXPECT_TRUE(world.apply(pick).ok());
    }
    if (pressed) {
      PushCommand push;
      push.radius = 0.03;
      push.position = Vec3(0.004, 0.003, 0.14);
      EXPECT_TRUE(world.apply(push).ok());
      run(world, 0.1);
      push.position.z() = 0.125;
      push.speed = 0.1;
      EXPECT_TRUE(world.apply(push).ok());
    }
    run(world, 8.0);
    factor = seen(world).bodies[0].stiffness_factor;
    if (pressed) return world.push().force.z();
    if (scene == "stacked") return centre(world, 1).z() - 0.0755;
    const Box box = boundsOf(seen(world).bodies[0].surface);
    return scene == "held" ? box.min.z() + 0.025 : (box.max - box.min).z() - 0.1;
  }
};

TEST_P(SlowedBodies, ComeToRestWhereEnoughSubstepsWouldBringThem) {
  double factor = 0.0;
  const double expected = restingAt(GetParam(), 1000, factor);
  EXPECT_EQ(factor, 1.0);
  EXPECT_GT(std::abs(expected), 1e-4);
  const std::string scene = GetParam();
  const bool meets = scene != "held" && scene != "hung";
  for (const int most : {meets ? 8 : 4, meets ? 4 : 2}) {
    const double found = restingAt(GetParam(), most, factor);
    EXPECT_LT(factor, 0.5);
    // How deep rows lie in each other, up to the slop, depends on the substeps: 0.1 mm are 15 % in the stack, and 10 %
    // of how deep the sphere is in what lies loose on the ground.
    const double bound = scene == "stacked" ? 0.15 : scene == "pressed" ? 0.1 : 0.02;
    EXPECT_NEAR(found, expected, bound * std::abs(expected)) << most << " substeps, factor " << factor;
  }
}

// How far a soft body is slowed goes with how it is stretched, and so swings with it: contact has to follow within the
// frame, else it feeds the swing.
TEST(SurfaceContact, NothingFeedsTheSwingOfASlowedBody) {
  for (const double youngs_modulus : {1200.0, 1500.0, 2000.0}) {
    WorldSettings settings = surface();
    settings.sleep = false;
    World world(settings);
    add(world, block("slab", Vec3(0, 0, 0.0405), Vec3(0.2, 0.2, 0.08)));
    BodyDef ball = test::defOf(sphereMesh(0.025, 0.005), "ball");
    ball.pose.translation = Vec3(0.03, 0.02, 0.109);
    ball.material = block("", Vec3::Zero()).material;
    ball.material.youngs_modulus = youngs_modulus;
    ball.material.poissons_ratio = 0.45;
    ball.material.damping = 0.5;
    ball.material.friction = 0.7;
    add(world, ball);
    const auto fastest = [&] {  // [m/s] root mean square
      double most = 0.0, slowed = 1.0;
      for (int n = 0; n < 120; ++n) {
        world.step();
        const BodySnapshot now = seen(world).bodies[1];
        most = std::max(most, std::sqrt(2.0 * now.measures.kinetic_energy / now.model->mass));
        slowed = std::min(slowed, now.stiffness_factor);
      }
      EXPECT_LT(slowed, 0.95);
      return most;
    };
    run(world, 2.0);
    const double early = fastest();
    run(world, 8.0);
    const double late = fastest();
    EXPECT_LT(late, 1.5 * std::exp(-0.5 * ball.material.damping * 9.0) * early) << youngs_modulus << " Pa: " << early;
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, SlowedBodies, ::testing::Values("stacked", "held", "hung", "pressed", "pressed_held"),
                         [](const auto& info) { return std::string(info.param); });

}  // namespace surface_contact_test
}  // namespace meshless
