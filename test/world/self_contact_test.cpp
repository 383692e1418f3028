// A body that meets itself: wound faces of an incision, and a strip that is folded over.
#include "meshless_surgery/contact/contacts.h"
#include "support/bodies.h"

namespace meshless {
namespace {

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

TEST(SelfContact, AStripIsFoldedOntoItselfNotIntoItself) {
  EXPECT_GT(foldedInto(SelfContact::kNone), 10) << "else nothing presses";
  EXPECT_LE(foldedInto(SelfContact::kAll), 1);
}

/// A wedge with its ridge along x at the height of `at`, which opens upwards (up = 1) or downwards.
void addWedge(TriangleMesh& mesh, const Vec3& at, bool along_x, double up) {
  const Index v = static_cast<Index>(mesh.vertices.size());
  for (const double side : {-1.0, 1.0}) {
    const Vec3 end = along_x ? Vec3(0.05 * side, 0, 0) : Vec3(0, 0.05 * side, 0);
    const Vec3 out = along_x ? Vec3(0, 0.04, 0.03 * up) : Vec3(0.04, 0, 0.03 * up);
    const Vec3 in = along_x ? Vec3(0, -0.04, 0.03 * up) : Vec3(-0.04, 0, 0.03 * up);
    for (const Vec3& p : {Vec3(at + end), Vec3(at + end + out), Vec3(at + end + in)}) mesh.vertices.push_back(p);
  }
  std::vector<Triangle> triangles{{v, v + 1, v + 2},     {v + 3, v + 5, v + 4}, {v, v + 3, v + 4},
                                  {v, v + 4, v + 1},     {v, v + 2, v + 5},     {v, v + 5, v + 3},
                                  {v + 1, v + 4, v + 5}, {v + 1, v + 5, v + 2}};
  const Vec3 middle = at + Vec3(0, 0, 0.02 * up);
  const Vec3 &a = mesh.vertices[v], &b = mesh.vertices[v + 3], &c = mesh.vertices[v + 4];
  const bool inwards = (b - a).cross(c - a).dot(a - middle) < 0.0;
  for (Triangle t : triangles) {
    if (inwards) std::swap(t[1], t[2]);
    mesh.triangles.push_back(t);
  }
}

// Two wedges of one surface, far from each other at rest; now their ridges cross, and no vertex is over a face.
TEST(SelfContact, RidgesThatCrossArePressedApartByEqualAndOppositeImpulses) {
  TriangleMesh rest;
  addWedge(rest, Vec3(0, 0, 1.0), true, 1.0);
  addWedge(rest, Vec3(0, 0, -1.0), false, -1.0);
  std::vector<Index> particle;
  for (Index v = 0; v < rest.vertices.size(); ++v) particle.push_back(v);
  const ContactShape shape(rest, {&particle, nullptr, nullptr, nullptr, nullptr}, 0.05);
  SelfContactSet set = selfContactSet(shape, false, 0.02);
  EXPECT_EQ(set.ridges.size(), 18u) << "every edge of a wedge, without the diagonals of its sides";
  const std::vector<double> masses(rest.vertices.size(), 0.1), inverse(rest.vertices.size(), 10.0);
  for (const double gap : {0.001, -0.004, -0.012}) {
    SCOPED_TRACE(gap);
    Points before = rest.vertices, now = rest.vertices;
    for (Index v = 0; v < before.size(); ++v) {
      before[v].z() += v < 6 ? -1.0 + 0.0005 : 1.0;
      now[v].z() += v < 6 ? -1.0 + gap : 1.0;
    }
    Points positions = before;
    ContactMap map;
    ShapeCollider collider;
    collider.key = 1;
    collider.shape = &shape;
    collider.positions = positions.data();
    collider.previous = before.data();
    collider.masses = masses.data();
    collider.inverse_masses = inverse.data();
    collider.particles = static_cast<Index>(positions.size());
    collider.maps = &map;
    collider.map_count = 1;
    collider.mass = 1.2;
    collider.friction = 0.0;
    collider.meets_itself = true;
    collider.self = &set;
    for (const Vec3& p : before) collider.bounds.extend(p);
    collider.velocity = Vec3(0, 0, -0.5);
    collider.spread = 1.0;
    const std::vector<ShapeCollider> colliders{collider};
    Contacts contacts;
    ContactCounters counters;
    contacts.findPairs({}, colliders, 1.0 / 120.0, counters);
    contacts.make(colliders, 1.0 / 120.0, counters);
    EXPECT_EQ(counters.contacts, 1u);
    contacts.begin(colliders, 1.0 / 120.0);
    positions = now;
    contacts.solve(
        colliders, 1.0 / 120.0, [](Index, std::vector<ContactMap>&) {}, counters);
    const double above = 0.5 * (positions[0].z() + positions[3].z()),
                 below = 0.5 * (positions[6].z() + positions[9].z());
    EXPECT_NEAR(above - below, std::max(gap, 0.0), 1e-9);
    Vec3 sum = Vec3::Zero();
    for (Index v = 0; v < positions.size(); ++v) sum += positions[v] - now[v];
    EXPECT_LT(sum.norm(), 1e-12);
  }
}

}  // namespace
}  // namespace meshless
