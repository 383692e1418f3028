// A body that meets itself: wound faces of an incision, and a strip that is folded over.
#include <random>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"

namespace meshless {
namespace self_contact_test {

constexpr double kLength = 0.3, kWidth = 0.06;  // [m]

BodyDef bar(SelfContact self_contact, bool elastic) {
  BodyDef def = test::defOf(boxMesh(Vec3(kLength, kWidth, kWidth), 20, 4, 4), "bar");
  def.spacing = 0.015;
  if (elastic) {
    def.material.youngs_modulus = 30000.0;
    def.material.poissons_ratio = 0.3;
  } else {
    def.clusters.kind = ClusterOptions::Kind::kGrid;
    def.clusters.grid = {10, 2, 2};
    def.material.alpha = 0.97;
  }
  def.material.damping = 5.0;
  def.material.self_contact = self_contact;
  return def;
}

/// How far corresponding points of the wound faces have passed each other along x, at most [m]; negative: apart.
double woundFacesPassed(const BodySnapshot& body) {
  const TriangleMesh& mesh = body.model->surface;
  std::vector<double> facing(mesh.vertices.size(), 0.0);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    if (mesh.patchOf(t) != kOuterPatch) {
      const Triangle& c = mesh.triangles[t];
      const Vec3 area = (mesh.vertices[c[1]] - mesh.vertices[c[0]]).cross(mesh.vertices[c[2]] - mesh.vertices[c[0]]);
      for (Index v : c) facing[v] += area.x();
    }
  double most = -1.0;
  int pairs = 0;
  for (Index v = 0; v < facing.size(); ++v)
    for (Index u = 0; u < facing.size(); ++u)
      if (facing[v] > 0.0 && facing[u] < 0.0 && (mesh.vertices[v] - mesh.vertices[u]).norm() < 1e-9) {
        most = std::max(most, body.surface[v].x() - body.surface[u].x());
        ++pairs;
      }
  EXPECT_GT(pairs, 10);
  return most;
}

struct Sagged {
  double passed = 0.0, lowest = 0.0;  // [m]
  std::size_t queried = 0;
};

/// A bar between two walls sags under its weight: a slit in its top is pressed together.
Sagged sag(SelfContact self_contact, bool elastic) {
  WorldSettings settings;
  settings.ground.reset();
  World world(settings);
  BodyDef def = bar(self_contact, elastic);
  for (const double side : {-1.0, 1.0}) {
    Box wall;
    wall.extend(Vec3(side * (0.5 * kLength - 0.02), -1.0, -1.0));
    wall.extend(Vec3(side * kLength, 1.0, 1.0));
    def.fixed.push_back(wall);
  }
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  InciseCommand incise;
  incise.blade = {Vec3(0.002, -0.05, 0.5 * kWidth + 0.01), Vec3::UnitY(), Vec3::UnitZ(), 0.1, 0.05};
  const Result<Reply> cut = world.apply(incise);
  EXPECT_TRUE(cut.ok()) << (cut.ok() ? "" : cut.error().detail);
  Sagged sagged;
  for (int k = 0; k < 240; ++k) world.step();
  const WorldSnapshot shot = world.snapshot({true, true, false});
  sagged.queried = shot.report.contact_counters.self_points;
  sagged.passed = woundFacesPassed(shot.bodies[0]);
  for (const Vec3& p : shot.bodies[0].surface) {
    EXPECT_TRUE(p.allFinite());
    sagged.lowest = std::min(sagged.lowest, p.z());
  }
  return sagged;
}

TEST(SelfContact, WoundFacesThatPressOnEachOtherStayApart) {
  for (const bool elastic : {false, true}) {
    SCOPED_TRACE(elastic ? "elastic" : "appearance");
    const Sagged free = sag(SelfContact::kNone, elastic), held = sag(SelfContact::kWoundFaces, elastic);
    EXPECT_EQ(free.queried, 0u);
    EXPECT_GT(held.queried, 0u);
    EXPECT_GT(free.passed, 0.003) << "else nothing presses";
    EXPECT_LT(held.passed, 0.1 * free.passed);
    EXPECT_GT(held.lowest, free.lowest) << "closed wound faces carry";
  }
}

TEST(SelfContact, NothingIsQueriedWhereNothingCanMeet) {
  World world(test::weightless());
  BodyDef soft = bar(SelfContact::kWoundFaces, false);
  ASSERT_TRUE(world.addSceneBody(test::shared(soft)).ok());
  world.step();
  EXPECT_EQ(world.snapshot({}).report.contact_counters.self_points, 0u) << "no incision";
  World rigid_world(test::weightless());
  BodyDef rigid = bar(SelfContact::kAll, false);
  rigid.material.mode = MatchMode::kRigid;
  ASSERT_TRUE(rigid_world.addSceneBody(test::shared(rigid)).ok());
  rigid_world.step();
  EXPECT_EQ(rigid_world.snapshot({}).report.contact_counters.self_points, 0u) << "rigid";
}

/// How often the surface winds around p (Van Oosterom and Strackee 1983).
double windings(const Points& x, const std::vector<Triangle>& triangles, const Vec3& p) {
  double sum = 0.0;
  for (const Triangle& t : triangles) {
    const Vec3 a = x[t[0]] - p, b = x[t[1]] - p, c = x[t[2]] - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    sum += 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (4.0 * 3.14159265358979);
}

/// One half of a strip is folded over and pressed on the other. Its vertices that are over 1 mm deep in the other.
int foldedInto(SelfContact self_contact) {
  World world(test::weightless());
  BodyDef def = test::defOf(boxMesh(Vec3(0.6, 0.04, 0.04), 60, 4, 4), "strip");
  def.spacing = 0.01;
  def.clusters.kind = ClusterOptions::Kind::kGrid;
  def.clusters.grid = {30, 2, 2};
  def.material.alpha = 0.5;
  def.material.damping = 8.0;
  def.material.self_contact = self_contact;
  Box held;
  held.extend(Vec3(-1.0, -1.0, -1.0));
  held.extend(Vec3(-0.05, 1.0, -0.015));
  def.fixed.push_back(held);
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  PickCommand pick;
  pick.point = Vec3(0.28, 0.0, 0.02);
  pick.stiffness = 10.0;
  MovePickCommand move;
  move.pick = test::replyOf<PickReply>(world.apply(pick)).pick;
  for (int step = 0; step < 480; ++step) {
    const double angle = 3.14159 * std::min(1.0, step / 360.0);
    move.target = Vec3(0.05 + 0.23 * std::cos(angle), 0.0, 0.02 + 0.2 * std::sin(angle) - 0.015 * angle / 3.14159);
    EXPECT_TRUE(world.apply(move).ok());
    world.step();
  }
  const BodySnapshot body = world.snapshot({true, true, false}).bodies[0];
  EXPECT_TRUE(test::allFinite(body.particles));
  const TriangleMesh& mesh = body.model->surface;
  Points normals(mesh.vertices.size(), Vec3::Zero());
  for (const Triangle& t : mesh.triangles) {
    const Vec3 area = (body.surface[t[1]] - body.surface[t[0]]).cross(body.surface[t[2]] - body.surface[t[0]]);
    for (Index v : t) normals[v] += area;
  }
  int deep = 0;
  for (Index v = 0; v < mesh.vertices.size(); ++v)
    if (mesh.vertices[v].x() > 0.2)
      deep += windings(body.surface, mesh.triangles, body.surface[v] - 0.001 * normals[v].normalized()) > 1.5;
  return deep;
}

// Films between two cuts, thinner than samples see. Both sides of one hang on the same particles: who parts them by
// these turns it inside out.
TEST(SelfContact, FilmsBetweenCutsKeepTheirVolume) {
  for (const std::uint64_t seed : {4u, 20u}) {
    BodyDef def = test::defOf(*randomOrgan(seed, 0, 0.1, 16000), "organ");
    def.pose.translation.z() = 0.03 - boundsOf(def.mesh.vertices).min.z();
    def.spacing = 0.01;
    def.material.youngs_modulus = 4500.0;
    def.material.density = 1060.0;
    def.material.damping = 4.0;
    def.material.friction = 0.3;
    World world{WorldSettings()};
    ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(test::prepared(def))).ok());
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    for (int cut = 0; cut < 4; ++cut) {
      Vec3 centre = Vec3::Zero(), across;
      double mass = 0.0;
      for (const BodySnapshot& body : world.snapshot({false, false, true}).bodies) {
        centre += body.model->mass * body.measures.centre_of_mass;
        mass += body.model->mass;
      }
      normal.reset();
      for (int k = 2; k >= 0; --k) across[k] = normal(random);
      CutCommand command;
      command.blades.x_axis = across.normalized().unitOrthogonal();
      command.blades.y_axis = across.normalized().cross(command.blades.x_axis);
      command.blades.origin = centre / mass - 10.0 * command.blades.x_axis;
      ASSERT_TRUE(world.apply(command).ok());
    }
    for (int step = 0; step < 60; ++step) world.step();
    const WorldSnapshot seen = world.snapshot({true, false, true});
    EXPECT_GT(seen.bodies.size(), 10u);
    for (const BodySnapshot& body : seen.bodies)
      EXPECT_GT(body.measures.volume, 0.45 * body.model->rest_volume) << seed << ", " << body.name;
  }
}

TEST(SelfContact, AStripIsFoldedOntoItselfNotIntoItself) {
  EXPECT_GT(foldedInto(SelfContact::kNone), 4) << "else nothing presses";
  EXPECT_LE(foldedInto(SelfContact::kAll), 1);
}

}  // namespace self_contact_test
}  // namespace meshless
