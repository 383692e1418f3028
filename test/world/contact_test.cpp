// Laws of contact, on whole bodies in a world.
#include <cmath>

#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/query/nearest_on_triangle.h"
#include "meshless_surgery/world/saved_world.h"
#include "support/bodies.h"
#include "support/random.h"

namespace meshless {
namespace contact_test {

constexpr double kPi = 3.14159265358979323846;

WorldSettings space() {
  WorldSettings settings = test::weightless();
  settings.sleep = false;
  return settings;
}

BodyDef box(const std::string& name, const Vec3& size, const std::array<int, 3>& parts, const Vec3& at,
            const Quat& turn = Quat::Identity()) {
  BodyDef def = test::defOf(boxMesh(size, parts[0], parts[1], parts[2]), name);
  def.pose.translation = at;
  def.pose.rotation = turn;
  def.clusters.kind = ClusterOptions::Kind::kOne;
  def.spacing = std::min({size.x() / parts[0], size.y() / parts[1], size.z() / parts[2]});
  return def;
}

/// With a velocity from the start.
std::shared_ptr<const PreparedBody> thrown(const BodyDef& def, const Vec3& velocity) {
  PreparedBody body = test::prepared(def);
  for (Vec3& v : body.state.velocities) v = velocity;
  return std::make_shared<const PreparedBody>(std::move(body));
}

void add(World& world, const BodyDef& def, const Vec3& velocity = Vec3::Zero()) {
  const Result<SpawnReply> reply = world.addSceneBody(thrown(def, velocity));
  ASSERT_TRUE(reply.ok()) << reply.error().detail;
}

WorldSnapshot seen(World& world) { return world.snapshot({true, true, true}); }

Vec3 momentum(World& world) {
  Vec3 sum = Vec3::Zero();
  for (const BodySnapshot& b : seen(world).bodies) sum += b.measures.linear_momentum;
  return sum;
}

Vec3 angularMomentum(World& world) {
  Vec3 sum = Vec3::Zero();
  for (const BodySnapshot& b : seen(world).bodies)
    sum += b.measures.angular_momentum + b.measures.centre_of_mass.cross(b.measures.linear_momentum);
  return sum;
}

double energy(World& world, double gravity) {
  double sum = 0.0;
  for (const BodySnapshot& b : seen(world).bodies)
    sum += b.measures.kinetic_energy + gravity * b.model->mass * b.measures.centre_of_mass.z();
  return sum;
}

/// Vertices of a inside b, and how deep the deepest is [m].
std::pair<std::size_t, double> inside(const BodySnapshot& a, const BodySnapshot& b) {
  TriangleMesh mesh = b.model->surface;
  mesh.vertices = b.surface;
  const SolidQuery solid(mesh);
  std::pair<std::size_t, double> found{0, 0.0};
  for (const Vec3& p : a.surface)
    if (solid.contains(p)) {
      ++found.first;
      found.second = std::max(found.second, solid.distance(p));
    }
  return found;
}

// All but a corner of it is inside.
TEST(Contact, ABodySpawnedInsideAnotherIsDepenetratedSlowlyAndMomentumStays) {
  for (const double size : {0.01, 1.0, 20.0}) {
    World world(space());
    add(world, box("large", Vec3::Constant(size), {4, 4, 4}, Vec3::Zero()), Vec3(0.1, 0.0, 0.0) * size);
    add(world, box("small", Vec3::Constant(0.3 * size), {2, 2, 2}, Vec3(0.36, 0.1, -0.02) * size));
    const Vec3 before = momentum(world);
    const double scale = seen(world).bodies[0].model->mass * size;
    Vec3 last = seen(world).bodies[1].measures.centre_of_mass - seen(world).bodies[0].measures.centre_of_mass;
    for (int step = 0; step < 1200; ++step) {
      world.step();
      const WorldSnapshot shot = seen(world);
      const Vec3 apart = shot.bodies[1].measures.centre_of_mass - shot.bodies[0].measures.centre_of_mass;
      EXPECT_LE((apart - last).norm() * 120.0, 3.0 * size) << "step " << step;
      last = apart;
    }
    EXPECT_NEAR((momentum(world) - before).norm(), 0.0, 1e-9 * scale);
    const WorldSnapshot shot = seen(world);
    EXPECT_EQ(inside(shot.bodies[1], shot.bodies[0]).first, 0u) << "size " << size;
    EXPECT_EQ(inside(shot.bodies[0], shot.bodies[1]).first, 0u) << "size " << size;
  }
}

TEST(Contact, BodiesAtTheSamePlacePart) {
  World world(space());
  add(world, box("a", Vec3::Constant(0.1), {2, 2, 2}, Vec3::Zero()));
  add(world, box("b", Vec3::Constant(0.1), {2, 2, 2}, Vec3::Zero()));
  for (int step = 0; step < 360; ++step) world.step();
  const WorldSnapshot shot = seen(world);
  EXPECT_TRUE(test::allFinite(shot.bodies[0].particles));
  EXPECT_LE(inside(shot.bodies[0], shot.bodies[1]).second, 0.002);
  EXPECT_NEAR(momentum(world).norm(), 0.0, 1e-9);
}

// Bars of which only the ends have particles: their middles are met by samples on their edges.
TEST(Contact, CrossedBarsDoNotPassThroughEachOther) {
  for (const double speed : {0.2, 1.0, 4.0}) {
    World world(space());
    add(world, box("low", Vec3(1.0, 0.1, 0.1), {1, 1, 1}, Vec3::Zero()));
    add(world,
        box("high", Vec3(1.0, 0.1, 0.1), {1, 1, 1}, Vec3(0.03, 0.02, 0.16),
            Quat(Eigen::AngleAxisd(0.5 * kPi, Vec3::UnitZ()))),
        Vec3(0, 0, -speed));
    const Vec3 before = momentum(world);
    const auto axisOf = [](const BodySnapshot& b) {  // from one end of the bar to the other
      Eigen::Index k = 0;
      b.model->rest[0].cwiseAbs().maxCoeff(&k);  // of a corner
      Vec3 sum = Vec3::Zero();
      for (std::size_t i = 0; i < b.particles.size(); ++i)
        sum += (b.model->rest[i][k] > 0.0 ? 1.0 : -1.0) * b.particles[i];
      return Vec3(sum.normalized());
    };
    const auto above = [&] {
      const WorldSnapshot shot = seen(world);
      const Vec3 across = axisOf(shot.bodies[0]).cross(axisOf(shot.bodies[1])).normalized();
      return across.dot(shot.bodies[1].measures.centre_of_mass - shot.bodies[0].measures.centre_of_mass);
    };
    const double side = above() > 0.0 ? 1.0 : -1.0;
    const int steps = static_cast<int>(120.0 * 0.5 / speed);
    for (int step = 0; step < steps; ++step) {
      world.step();
      EXPECT_GT(side * above(), 0.085) << "at " << speed << " m/s, step " << step;
    }
    EXPECT_LE((momentum(world) - before).norm(), 1e-9 * before.norm());
  }
}

/// Whether a body is at the lower side of a sheet, as that lies now, and not beside its rim.
bool isBehind(const BodySnapshot& sheet, const BodySnapshot& body) {
  double nearest = std::numeric_limits<double>::infinity(), side = 0.0, rim = 0.0;
  const Points& rest = sheet.model->surface.vertices;
  for (const Triangle& t : sheet.model->surface.triangles) {
    const Vec3 p =
        nearestOnTriangle(body.measures.centre_of_mass, sheet.surface[t[0]], sheet.surface[t[1]], sheet.surface[t[2]]);
    const double distance = (p - body.measures.centre_of_mass).norm();
    if (!(distance < nearest)) continue;
    nearest = distance;
    side = (rest[t[1]] - rest[t[0]]).cross(rest[t[2]] - rest[t[0]]).normalized().z();
    rim = rest[t[0]].head<2>().cwiseAbs().maxCoeff();
  }
  return side < -0.5 && rim < 0.07;
}

// A sheet of 5 mm that floats in space, hit by a block of 5 cm: the block takes it along, and neither ends in the
// other. Faster than 2 m/s the block is light: a heavy one wraps the sheet around itself.
TEST(Contact, FastBodiesDoNotTunnelThroughSheets) {
  test::Random random(5);
  for (const double speed : {2.0, 5.0}) {
    int through = 0, deep = 0, met = 0;
    constexpr int kShots = 60;
    for (int n = 0; n < kShots; ++n) {
      const bool turned = n % 3 >= 1, oblique = n % 3 == 2;
      World world(space());
      const BodyDef sheet = box("sheet", Vec3(0.2, 0.2, 0.005), {10, 10, 1}, Vec3::Zero());
      const Quat turn = turned ? Quat(random.rotation()) : Quat::Identity();
      Vec3 way(0, 0, -1);
      if (oblique) way = (way + 0.4 * Vec3(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), 0.0)).normalized();
      BodyDef block =
          box("block", Vec3::Constant(0.05), {2, 2, 2},
              Vec3(random.uniform(-0.02, 0.02), random.uniform(-0.02, 0.02), random.uniform(0.06, 0.11)), turn);
      block.material.density = speed > 2.0 || n % 2 ? 100.0 : 1000.0;
      add(world, sheet);
      add(world, block, speed * way);
      std::size_t contacts = 0;
      const int steps = 4 + static_cast<int>(120.0 * 0.3 / speed);
      for (int step = 0; step < steps; ++step) {
        world.step();
        contacts += seen(world).report.contact_counters.corrected;
      }
      const WorldSnapshot shot = seen(world);
      const BodySnapshot &held = shot.bodies[0], &thrown = shot.bodies[1];
      met += contacts > 0;
      deep += inside(held, thrown).second > 1e-3 || inside(thrown, held).second > 1e-3;
      through += isBehind(held, thrown);
    }
    EXPECT_EQ(through, 0) << "of " << kShots << " at " << speed << " m/s";
    EXPECT_EQ(deep, 0) << "of " << kShots << " at " << speed << " m/s";
    EXPECT_EQ(met, kShots);
  }
}

TEST(Contact, EnergyNeverExceedsItsStartAndNothingBouncesAboveWhereItFellFrom) {
  for (const double alpha : {0.3, 0.9, 1.0}) {
    WorldSettings settings;
    settings.sleep = false;
    World world(settings);
    for (int k = 0; k < 3; ++k) {
      BodyDef def =
          box("b" + std::to_string(k), Vec3(0.12, 0.1, 0.1), {3, 2, 2}, Vec3(0.02 * k, 0.01 * k, 0.2 + 0.16 * k),
              Quat(Eigen::AngleAxisd(0.4 + k, Vec3(1, 0.3 * k, 0.5).normalized())));
      def.material.alpha = alpha;
      def.material.damping = 0.0;
      add(world, def);
    }
    const double start = energy(world, 9.81);
    double top = 0.0;
    for (const BodySnapshot& b : seen(world).bodies) top = std::max(top, b.measures.centre_of_mass.z());
    for (int step = 0; step < 720; ++step) {
      world.step();
      ASSERT_LE(energy(world, 9.81), start * (1.0 + 1e-9)) << "alpha " << alpha << " step " << step;
      for (const BodySnapshot& b : seen(world).bodies) ASSERT_LE(b.measures.centre_of_mass.z(), top);
    }
  }
}

TEST(Contact, CollidingBodiesKeepTheirMomentumAndLoseEnergy) {
  for (const Vec3& far : {Vec3(0, 0, 0), Vec3(1000, -1000, 1000)})
    for (const double size : {0.001, 0.1, 100.0}) {
      World world(space());
      add(world, box("a", Vec3(1.0, 0.8, 0.6) * size, {3, 2, 2}, far), Vec3(0.5, 0, 0) * size);
      add(world,
          box("b", Vec3(0.7, 0.7, 0.7) * size, {2, 2, 2}, far + Vec3(1.3, 0.3, 0.1) * size,
              Quat(Eigen::AngleAxisd(0.6, Vec3(1, 2, 3).normalized()))),
          Vec3(-0.8, 0, 0) * size);
      const Vec3 before = momentum(world), turning = angularMomentum(world);
      const double mass = seen(world).bodies[0].model->mass, kinetic = energy(world, 0.0);
      std::size_t contacts = 0;
      for (int step = 0; step < 240; ++step) {
        world.step();
        contacts += seen(world).report.contact_counters.corrected;
        EXPECT_LE(energy(world, 0.0), kinetic * (1.0 + 1e-6));
      }
      EXPECT_GT(contacts, 0u);
      EXPECT_LE((momentum(world) - before).norm(), mass * (3e-9 * size + 8e-13 * far.norm())) << size;
      const double lever = size + far.norm();
      EXPECT_LE((angularMomentum(world) - turning).norm(),
                0.02 * mass * size * size + mass * lever * (3e-9 * size + 8e-13 * far.norm()))
          << size << " m, before " << turning.transpose() << ", after " << angularMomentum(world).transpose();
      const WorldSnapshot shot = seen(world);
      EXPECT_LE(inside(shot.bodies[0], shot.bodies[1]).second, 0.01 * size);
      EXPECT_LE(inside(shot.bodies[1], shot.bodies[0]).second, 0.01 * size);
    }
}

TEST(Contact, AnObstacleHoldsWhatFallsOnItAndNeverMoves) {
  WorldSettings settings;
  settings.ground.reset();
  World world(settings);
  ObstacleDef table;
  table.name = "table";
  table.mesh = boxMesh(Vec3(1.0, 1.0, 0.05), 1, 1, 1);
  table.friction = 1.0;
  const Points before = table.mesh.vertices;
  ASSERT_TRUE(world.addObstacle(table).ok());
  EXPECT_FALSE(world.addObstacle(table).ok()) << "the same name";
  add(world, box("stays", Vec3::Constant(0.1), {2, 2, 2}, Vec3(0.1, 0.0, 0.2)));
  add(world, box("falls", Vec3::Constant(0.1), {2, 2, 2}, Vec3(0.7, 0.0, 0.2)));
  for (int step = 0; step < 480; ++step) world.step();
  const WorldSnapshot shot = seen(world);
  EXPECT_EQ(shot.obstacles[0]->mesh.vertices, before);
  EXPECT_NEAR(shot.bodies[0].measures.centre_of_mass.z(), 0.075, 0.002);
  EXPECT_TRUE(shot.bodies[0].asleep);
  EXPECT_LT(shot.bodies[1].measures.centre_of_mass.z(), -10.0);
  ObstacleDef bad = table;
  bad.name = "open";
  bad.mesh.triangles.clear();
  EXPECT_FALSE(world.addObstacle(bad).ok());
  bad = table;
  bad.name = "rough";
  bad.friction = -1.0;
  const Status refused = world.addObstacle(bad);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().detail.find("-1"), std::string::npos);
}

// Contact knows no way out: the small one in the large one, in either order, and either of them an obstacle. What
// stands out by a little may start there, and so may what lies in a cavity.
TEST(Contact, NobodyStartsWhollyInsideAnother) {
  const auto obstacle = [](const std::string& name, TriangleMesh mesh) {
    ObstacleDef def;
    def.name = name;
    def.mesh = std::move(mesh);
    return def;
  };
  const TriangleMesh small = boxMesh(Vec3::Constant(0.05), 1, 1, 1), large = boxMesh(Vec3::Constant(0.2), 2, 2, 2);
  TriangleMesh hollow = boxMesh(Vec3::Constant(0.3), 1, 1, 1);
  shapes::append(hollow, shapes::turnedInsideOut(boxMesh(Vec3::Constant(0.25), 1, 1, 1)));
  for (const double aside : {0.0, 0.074, 0.076}) {
    const bool inside = aside < 0.075;
    const auto body = [&](const TriangleMesh& mesh, const std::string& name) {
      BodyDef def = test::defOf(mesh, name);
      def.pose.translation = name == "small" ? Vec3(aside, 0.0, 0.0) : Vec3::Zero();
      return std::make_shared<const PreparedBody>(test::prepared(def));
    };
    for (const bool small_first : {true, false}) {
      World world(space());
      ASSERT_TRUE(world.addSceneBody(small_first ? body(small, "small") : body(large, "large")).ok());
      const Result<SpawnReply> second = world.addSceneBody(small_first ? body(large, "large") : body(small, "small"));
      EXPECT_EQ(second.ok(), !inside) << aside << small_first;
      if (!second.ok())
        EXPECT_NE(second.error().detail.find("body 'small' lies wholly inside body 'large'"), std::string::npos)
            << second.error().detail;
      EXPECT_EQ(world.bodyCount(), inside ? 1u : 2u);
    }
    World first(space()), then(space()), around(space());
    ASSERT_TRUE(first.addObstacle(obstacle("rock", large)).ok());
    EXPECT_EQ(first.addSceneBody(body(small, "small")).ok(), !inside);
    ASSERT_TRUE(then.addSceneBody(body(small, "small")).ok());
    EXPECT_EQ(then.addObstacle(obstacle("rock", large)).ok(), !inside);
    ASSERT_TRUE(around.addObstacle(obstacle("shell", hollow)).ok());
    EXPECT_TRUE(around.addSceneBody(body(small, "small")).ok());
    WorldSettings none = space();
    none.contact = ContactMethod::kNone;
    World unmet(none);
    ASSERT_TRUE(unmet.addSceneBody(body(large, "large")).ok());
    EXPECT_TRUE(unmet.addSceneBody(body(small, "small")).ok());
  }
}

// Thrown, it comes to rest in few and longer substeps, with the impulses of the many short ones of the impact.
TEST(Contact, AnOverhangingBlockStaysOnAThinPlate) {
  for (const double speed : {3.0, 10.0}) {
    WorldSettings settings = space();
    settings.gravity = {0.0, 0.0, -9.81};
    settings.step_rate = 60.0;
    World world(settings);
    ObstacleDef plate;
    plate.name = "plate";
    plate.mesh = boxMesh(Vec3(0.4, 0.4, 0.005), 4, 4, 1);
    ASSERT_TRUE(world.addObstacle(plate).ok());
    BodyDef block = box("block", Vec3::Constant(0.05), {2, 2, 2}, Vec3(0.18, 0.0, 0.1));
    block.material.alpha = 0.92;
    add(world, block, Vec3(0.0, 0.0, -speed));
    for (int step = 0; step < 120; ++step) world.step();
    EXPECT_NEAR(seen(world).bodies[0].measures.centre_of_mass.z(), 0.0275, 0.0015) << speed;
  }
}

// Thrown at plates of 5 mm to 3 cm, bodies bounce, turn over and come to rest: nobody is on the other side, or in it.
TEST(Contact, ThinPlatesHoldWhatTumblesOnThem) {
  test::Random random(7);
  int stayed = 0, deep = 0;
  for (int shot = 0; shot < 120; ++shot) {
    WorldSettings settings = space();
    settings.gravity = {0.0, 0.0, -9.81};
    settings.ground.reset();
    settings.step_rate = shot % 2 ? 60.0 : 120.0;
    settings.substeps = 1;
    World world(settings);
    ObstacleDef plate;
    plate.name = "plate";
    const double thickness = shot % 3 ? 0.005 : random.uniform(0.005, 0.03);
    plate.mesh = boxMesh(Vec3(4.0, 4.0, thickness), 40, 40, 1);
    ASSERT_TRUE(world.addObstacle(plate).ok());
    const int parts = 1 + shot % 4;
    const Vec3 tilt(random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0), random.uniform(-1.0, 1.0));
    BodyDef block = box("block", Vec3::Constant(0.05), {parts, parts, parts}, Vec3(0.01, 0.02, 0.08),
                        Quat(Eigen::AngleAxisd(random.uniform(0.0, 3.0), tilt.normalized())));
    block.material.alpha = random.uniform(0.8, 1.0);
    const double speed = random.uniform(1.0, 10.0);
    add(world, block, speed * Vec3(0.3 * tilt.x(), 0.3 * tilt.y(), -1.0).normalized());
    bool left = false;
    for (int step = 0; step < 2.0 * settings.step_rate && !left; ++step) {
      world.step();
      left = seen(world).bodies[0].measures.centre_of_mass.head<2>().cwiseAbs().maxCoeff() > 1.9;
    }
    if (left) continue;
    ++stayed;
    double lowest = 1.0;
    const WorldSnapshot last = seen(world);
    for (const Vec3& v : last.bodies[0].surface) lowest = std::min(lowest, v.z());
    deep += lowest < 0.5 * thickness - 0.001;
  }
  EXPECT_GT(stayed, 30);
  EXPECT_EQ(deep, 0);
}

// Who comes and goes elsewhere changes the numbers of the others, and nothing of what presses them.
TEST(Contact, WhoComesAndGoesElsewhereChangesNothing) {
  const auto stackOf = [](World& world, bool with_guest) {
    if (with_guest) add(world, box("guest", Vec3::Constant(0.1), {2, 2, 2}, Vec3(5.0, 0.0, 0.05)));
    for (int n = 0; n < 3; ++n)
      add(world, box("block" + std::to_string(n), Vec3::Constant(0.1), {2, 2, 2},
                     Vec3(0.01 * n, 0.005 * n, 0.05 + 0.1001 * n)));
  };
  WorldSettings settings;
  settings.sleep = false;
  World alone(settings), visited(settings);
  stackOf(alone, false);
  stackOf(visited, true);
  for (int step = 0; step < 60; ++step) {
    alone.step();
    visited.step();
  }
  ASSERT_TRUE(visited.apply(RemoveCommand{"guest"}).ok());
  for (int step = 0; step < 30; ++step) {
    const WorldSnapshot a = seen(alone), b = seen(visited);
    ASSERT_EQ(b.bodies.size(), step < 1 || step > 20 ? 3u : 4u);
    for (std::size_t n = 0; n < 3; ++n) ASSERT_EQ(a.bodies[n].surface, b.bodies[n].surface) << step;
    if (step == 0) add(visited, box("next", Vec3::Constant(0.1), {2, 2, 2}, Vec3(-5.0, 0.0, 0.05)));
    if (step == 20) {
      ASSERT_TRUE(visited.apply(RemoveCommand{"next"}).ok());
    }
    alone.step();
    visited.step();
  }
}

// Contacts refer to a body's surface. After an incision they are found anew, and the state can be saved.
TEST(Contact, AnIncisedBodyThatCarriesAnotherIsSavedAndGoesOn) {
  for (const double youngs_modulus : {0.0, 1e4}) {
    WorldSettings settings;
    World world(settings);
    BodyDef below = box("below", Vec3(0.2, 0.2, 0.1), {8, 8, 4}, Vec3(0.0, 0.0, 0.05));
    below.material.youngs_modulus = youngs_modulus;
    if (youngs_modulus > 0.0) below.clusters.kind = ClusterOptions::Kind::kAuto;
    add(world, below);
    add(world, box("above", Vec3(0.1, 0.1, 0.1), {4, 4, 4}, Vec3(0.02, 0.01, 0.1502)));
    for (int step = 0; step < 60; ++step) world.step();
    InciseCommand incision;
    incision.blade.origin = Vec3(-0.2, 0.03, 0.1);
    incision.blade.x_axis = Vec3::UnitX();
    incision.blade.y_axis = Vec3::UnitZ();
    incision.blade.length = 0.4;
    incision.blade.depth = 0.03;
    incision.bodies = {"below"};
    const auto opened = world.apply(incision);
    ASSERT_TRUE(opened.ok()) << opened.error().detail;
    const Result<DecodedWorld> decoded = decode(encode(*world.capture()));
    ASSERT_TRUE(decoded.ok()) << decoded.error().detail;
    World loaded(settings);
    loaded.restore(*decoded->world);
    for (int step = 0; step < 30; ++step) {
      world.step();
      loaded.step();
      ASSERT_EQ(world.stateHash(), loaded.stateHash()) << step;
    }
    EXPECT_NEAR(seen(world).bodies[1].measures.centre_of_mass.z(), 0.15, 0.01);
  }
}

// A snapshot never shows one below the ground.
TEST(Contact, PiecesThatLieOnTheGroundAreNotSeenBelowIt) {
  World world{WorldSettings()};
  BodyDef def = test::defOf(boxMesh(Vec3(0.12, 0.1, 0.08), 12, 10, 8), "block");
  def.spacing = 0.02;
  def.pose.translation = Vec3(0, 0, 0.0401);
  def.material.youngs_modulus = 4000.0;
  def.material.poissons_ratio = 0.45;
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  for (int step = 0; step < 60; ++step) world.step();
  CutCommand cut;
  cut.blades.origin = Vec3(0.004, -1.0, 0.04);
  cut.blades.x_axis = Vec3::UnitY();
  cut.blades.y_axis = Vec3(0.3, 0.0, 1.0).normalized();
  ASSERT_EQ(test::replyOf<CutReply>(world.apply(cut)).new_bodies.size(), 2u);
  for (int step = 0; step < 120; ++step) {
    world.step();
    for (const BodySnapshot& body : world.snapshot({true, false, false}).bodies) {
      // A few sweeps leave a little, and a fresh piece is held by many rows at once.
      for (const Vec3& p : body.surface) ASSERT_GT(p.z(), -3.5e-4) << body.name << " in step " << step;
    }
  }
}

}  // namespace contact_test
}  // namespace meshless
