// What a snapshot says of bodies and contacts is what follows from the particles, their masses and the surface alone.
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <string>

#include "support/bodies.h"

namespace meshless {
namespace measures_law_test {

constexpr double kG = 9.81;     // [m/s^2]
constexpr double kRate = 1000;  // [Hz] of steps short enough that an elastic body needs no substeps

struct Kind {
  const char* name;
  double youngs_modulus;  // [Pa] 0: appearance
  bool one_cluster;
};
constexpr Kind kKinds[] = {{"appearance", 0.0, false}, {"one cluster", 0.0, true}, {"elastic", 4e4, false}};

BodyDef brick(const Kind& kind, const std::string& name, const Vec3& at) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.12, 0.1, 0.05), 5, 4, 2), name);
  def.pose.translation = at;
  def.spacing = 0.025;
  if (kind.one_cluster) def.clusters.kind = ClusterOptions::Kind::kOne;
  def.material.youngs_modulus = kind.youngs_modulus;
  def.material.density = 1100.0;
  def.material.damping = 5.0;
  def.material.friction = 0.8;
  return def;
}

void add(
    World& world, const BodyDef& def, const std::function<void(PreparedBody&)>& change = [](PreparedBody&) {}) {
  PreparedBody body = test::prepared(def);
  change(body);
  const auto reply = world.addSceneBody(std::make_shared<const PreparedBody>(std::move(body)));
  ASSERT_TRUE(reply.ok()) << reply.error().detail;
}

WorldSnapshot seen(World& world) { return world.snapshot({true, true, true, true}); }

void run(World& world, int steps) {
  for (int n = 0; n < steps; ++n) world.step();
}

/// Of the tetrahedra from a far point to each triangle.
double volumeOf(const Points& surface, const std::vector<Triangle>& triangles) {
  const Vec3 apex(0.3, -0.2, 0.5);
  double sum = 0.0;
  for (const Triangle& t : triangles) {
    Mat3 edges;
    edges << surface[t[0]] - apex, surface[t[1]] - apex, surface[t[2]] - apex;
    sum += edges.determinant() / 6.0;
  }
  return sum;
}

double areaOf(const Points& surface, const std::vector<Triangle>& triangles) {
  double sum = 0.0;  // by Heron
  for (const Triangle& t : triangles) {
    const double a = (surface[t[0]] - surface[t[1]]).norm(), b = (surface[t[1]] - surface[t[2]]).norm(),
                 c = (surface[t[2]] - surface[t[0]]).norm(), s = 0.5 * (a + b + c);
    sum += std::sqrt(std::max(0.0, s * (s - a) * (s - b) * (s - c)));
  }
  return sum;
}

/// A step of one substep goes from place to place with the velocity that the body has after it.
void expectMeasures(const BodySnapshot& before, const BodySnapshot& now, const std::string& what) {
  SCOPED_TRACE(what + ", " + now.name);
  const std::vector<double>& masses = now.model->masses;
  double mass = 0.0, energy = 0.0;
  Vec3 moment = Vec3::Zero(), momentum = Vec3::Zero(), angular = Vec3::Zero();
  for (std::size_t i = 0; i < masses.size(); ++i) {
    const Vec3 velocity = kRate * (now.particles[i] - before.particles[i]);
    mass += masses[i];
    moment += masses[i] * now.particles[i];
    momentum += masses[i] * velocity;
    angular += masses[i] * now.particles[i].cross(velocity);
    energy += 0.5 * masses[i] * velocity.squaredNorm();
  }
  angular -= moment.cross(momentum) / mass;
  const BodyMeasures& m = now.measures;
  EXPECT_NEAR(now.model->mass, mass, 1e-9 * mass);
  EXPECT_LT((m.centre_of_mass - moment / mass).norm(), 1e-9);
  EXPECT_LT((m.linear_momentum - momentum).norm(), 1e-6 * momentum.norm());
  EXPECT_LT((m.velocity - momentum / mass).norm(), 1e-6 * m.velocity.norm());
  EXPECT_LT((m.angular_momentum - angular).norm(), 1e-6 * angular.norm());
  EXPECT_NEAR(m.kinetic_energy, energy, 1e-6 * energy);
  EXPECT_GT(energy, 1.2 * 0.5 * momentum.squaredNorm() / mass) << "it spins";
  const std::vector<Triangle>& triangles = now.model->surface.triangles;
  EXPECT_NEAR(m.volume, volumeOf(now.surface, triangles), 1e-9 * m.volume);
  EXPECT_NEAR(m.area, areaOf(now.surface, triangles), 1e-9 * m.area);
  EXPECT_NEAR(now.model->rest_volume, volumeOf(now.model->surface.vertices, triangles), 1e-9 * m.volume);
  EXPECT_GT(std::abs(m.volume / now.model->rest_volume - 1.0), 1e-3) << "it is stretched";
}

TEST(MeasuresLaw, BodiesThatFlySpinAndAreStretchedMeasureAsTheirParticlesDoAndTheirPiecesToo) {
  for (const Kind& kind : kKinds) {
    WorldSettings settings = test::weightless();
    settings.sleep = false;
    settings.contact = ContactMethod::kNone;
    settings.step_rate = kRate;
    settings.max_substeps = 1;
    World world(settings);
    add(world, brick(kind, "brick", Vec3(0.1, 0.2, 0.3)), [](PreparedBody& body) {
      for (std::size_t i = 0; i < body.state.positions.size(); ++i) {
        Vec3& place = body.state.positions[i];
        body.state.velocities[i] = Vec3(0.1, -0.2, 0.15) + Vec3(3, 9, 6).cross(place - Vec3(0.1, 0.2, 0.3));
        place.x() += 0.1 * (place.x() - 0.1);
      }
    });
    const auto expectAll = [&](const char* what) {
      const WorldSnapshot before = seen(world);
      world.step();
      const WorldSnapshot now = seen(world);
      for (std::size_t b = 0; b < now.bodies.size(); ++b)
        expectMeasures(before.bodies[b], now.bodies[b], std::string(kind.name) + what);
      return now;
    };
    const WorldSnapshot whole = expectAll(" whole");
    CutCommand cut;
    cut.blades.x_axis = Vec3::UnitY();
    cut.blades.y_axis = Vec3::UnitZ();
    cut.blades.origin = Vec3(0.11, -1.0, 0.3);
    EXPECT_EQ(test::replyOf<CutReply>(world.apply(cut)).new_bodies.size(), 2u);
    run(world, 1);
    const WorldSnapshot pieces = expectAll(" in two");
    double mass = 0.0, rest_volume = 0.0;
    for (const BodySnapshot& piece : pieces.bodies) {
      mass += piece.model->mass;
      rest_volume += piece.model->rest_volume;
    }
    EXPECT_NEAR(mass, whole.bodies[0].model->mass, 1e-9 * mass);
    EXPECT_NEAR(rest_volume, whole.bodies[0].model->rest_volume, 1e-6 * rest_volume);
  }
}

/// What lies on something and comes to rest there: on the ground, on a plate that is turned, on another body.
enum class Support { kGround, kPlate, kBody };

struct Load {
  Vec3 force = Vec3::Zero();  // [N] on who lies on the support, along the contacts' normals
  int points = 0;
};

TEST(ContactPointLaw, ForcesAlongNormalsThatPointOutOfTheSupportCarryTheWeight) {
  constexpr double kTilt = 0.25;  // [rad] of the plate, less than what friction holds
  for (const Kind& kind : kKinds)
    for (const Support support : {Support::kGround, Support::kPlate, Support::kBody}) {
      const std::string what = std::string(kind.name) + " on support " + std::to_string(static_cast<int>(support));
      WorldSettings settings;
      settings.contact = ContactMethod::kSurface;
      settings.sleep = false;
      World world(settings);
      const Quat turn(Eigen::AngleAxisd(support == Support::kPlate ? kTilt : 0.0, Vec3(1, 2, 0).normalized()));
      const Vec3 up = turn * Vec3::UnitZ();
      if (support == Support::kPlate) {
        ObstacleDef plate;
        plate.name = "plate";
        plate.friction = 0.9;
        plate.mesh = boxMesh(Vec3(0.4, 0.4, 0.1), 4, 4, 1);
        for (Vec3& v : plate.mesh.vertices) v = turn * v + Vec3(0, 0, 0.5);
        ASSERT_TRUE(world.addObstacle(plate).ok());
      }
      const Vec3 floor = support == Support::kPlate ? Vec3(Vec3(0, 0, 0.5) + 0.05 * up) : Vec3::Zero();
      BodyDef low = brick(kind, "low", floor + 0.0255 * up);
      low.pose.rotation = turn;
      add(world, low);
      if (support == Support::kBody) add(world, brick(kind, "high", Vec3(0.005, 0.003, 0.0765)));
      run(world, 360);
      // In the mean: what is soft still trembles, by two to three thousandths of its weight.
      constexpr int kSteps = 60;
      std::vector<ContactPoint> contacts;
      for (int step = 0; step < kSteps; ++step) {
        run(world, 1);
        const WorldSnapshot now = seen(world);
        contacts.insert(contacts.end(), now.contacts.begin(), now.contacts.end());
      }
      const WorldSnapshot shot = seen(world);
      Load below, between;
      const std::string ground = support == Support::kPlate ? "plate" : kGroundName;
      std::map<std::string, Vec3> carried;  // [N]
      std::set<std::string> known;
      for (const BodySnapshot& body : shot.bodies) known.insert(body.name);
      for (const std::string& name : {std::string("low"), std::string("high"), ground}) carried[name] = Vec3::Zero();
      for (const ContactPoint& point : contacts) {
        EXPECT_NEAR(point.normal.norm(), 1.0, 1e-9) << what;
        EXPECT_GT(point.pressed(), 0.0) << what;
        const double height = (point.position - floor).dot(up);
        // Between two bodies the normal is that of either.
        const bool is_below = height < 0.02;
        Load& load = is_below ? below : between;
        if (is_below) EXPECT_GT(point.normal.dot(up), 0.999) << what;
        if (!is_below) EXPECT_NEAR(height, 0.05, 0.01) << what;
        load.force += (!is_below && point.normal.dot(up) < 0.0 ? -1.0 : 1.0) * point.pressed() / kSteps * point.normal;
        ++load.points;
        // All of it is named, friction too: who lies is carried, and who carries is pressed by the opposite.
        ASSERT_TRUE(known.count(point.body) && (known.count(point.other) || point.other == ground)) << what;
        ASSERT_NE(point.body, point.other) << what;
        EXPECT_EQ(is_below, point.other == ground) << what << " " << point.other;
        carried[point.body] += point.force / kSteps;
        carried[point.other] -= point.force / kSteps;
      }
      for (const BodySnapshot& body : shot.bodies)
        EXPECT_LT((carried[body.name] - Vec3(0, 0, body.model->mass * kG)).norm(), 6e-3 * body.model->mass * kG)
            << what << " " << body.name << " " << carried[body.name].transpose();
      double mass = 0.0;
      for (const BodySnapshot& body : shot.bodies) mass += body.model->mass;
      const double weight = mass * kG * up.z();
      EXPECT_GE(below.points, 3 * kSteps) << what;
      EXPECT_NEAR(below.force.dot(up) / weight, 1.0, 4e-3) << what;
      printf("%s: %d points carry %.6f of the weight", what.c_str(), below.points, below.force.dot(up) / weight);
      if (support == Support::kBody) {
        const double high = shot.bodies[1].model->mass * kG;
        EXPECT_NEAR(between.force.z() / high, 1.0, 1e-3) << what << ": action is reaction";
        printf(", %d between %.6f", between.points, between.force.z() / high);
      }
      printf("\n");
    }
}

}  // namespace measures_law_test
}  // namespace meshless
