#include "meshless_surgery/training/followed_places.h"

#include <cmath>

#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/organs.h"
#include "training/played.h"

namespace meshless {
namespace followed_places_test {

struct Case {
  std::string name;
  BodyDef def;
};

/// Of particles and of cells, placed and turned.
std::vector<Case> cases() {
  std::vector<Case> all;
  const Pose pose{Quat(Eigen::AngleAxisd(0.7, Vec3(0.3, 0.1, 0.9).normalized())), Vec3(0.1, -0.05, 0.3)};
  for (const bool elastic : {false, true})
    for (const char* name : {"block", "ball", "liver"}) {
      BodyDef def = name == std::string("block") ? test::block("tissue")
                    : name == std::string("ball") ? test::ball("tissue")
                                                  : test::defOf(liverMesh(), "tissue");
      def.pose = pose;
      if (elastic) def.material.youngs_modulus = 2e3;
      all.push_back({std::string(name) + (elastic ? " of cells" : " of particles"), def});
    }
  return all;
}

/// Through the middle of a body's bounds, across the longest side.
CutPlan middlePlan(const BodyDef& def) {
  const Box box = boundsOf(def.mesh.vertices);
  const Vec3 size = box.max - box.min;
  int axis = 0;
  size.maxCoeff(&axis);
  CutPlan plan;
  plan.body = "tissue";
  plan.along = def.pose.rotation * Vec3::Unit((axis + 1) % 3);
  plan.out = def.pose.rotation * Vec3::Unit((axis + 2) % 3);
  plan.length = plan.depth = 2.0;
  plan.origin = def.pose * Vec3(0.5 * (box.min + box.max) + 0.013 * size[axis] * Vec3::Unit(axis)) - plan.along + plan.out;
  return plan;
}

TriangleMesh placedMesh(const BodyDef& def) {
  TriangleMesh mesh = def.mesh;
  for (Vec3& p : mesh.vertices) p = def.pose * p;
  return mesh;
}

WorldSnapshot seen(World& world) {
  SnapshotWants wants;
  wants.surfaces = wants.particles = true;
  return world.snapshot(wants);
}

CutCommand along(const CutPlan& plan) {
  CutCommand cut;
  cut.blades.origin = plan.origin;
  cut.blades.x_axis = plan.along;
  cut.blades.y_axis = plan.out;
  return cut;
}

TEST(FollowedPlaces, GoWithTheTissueWhereverItGoes) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    World world(test::weightless());
    ASSERT_TRUE(world.addSceneBody(test::shared(c.def)).ok());
    Points rest = planOutlineOn(middlePlan(c.def), placedMesh(c.def));
    ASSERT_GT(rest.size(), 20u);
    rest.push_back(c.def.pose * Vec3(0, 0, 0));
    FollowedPlaces places("tissue", rest, Vec3::Zero());
    WorldSnapshot shot = seen(world);
    const Points still = places.now(shot);
    for (std::size_t k = 0; k < rest.size(); ++k) EXPECT_LT((still[k] - rest[k]).norm(), 1e-9);
    Mat3 linear = Quat(Eigen::AngleAxisd(2.0, Vec3(0.6, 0.0, 0.8))).toRotationMatrix();
    linear.col(0) *= 1.2;
    for (BodySnapshot& body : shot.bodies)
      for (Vec3& p : body.particles) p = linear * p + Vec3(0.3, 0.2, 0.1);
    const Points moved = places.now(shot);
    for (std::size_t k = 0; k < rest.size(); ++k)
      EXPECT_LT((moved[k] - (linear * rest[k] + Vec3(0.3, 0.2, 0.1))).norm(), 1e-9);
  }
}

TEST(FollowedPlaces, OfTheSurfaceLieOnItHoweverItHangs) {
  for (Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const Box box = boundsOf(placedMesh(c.def).vertices);
    c.def.fixed.emplace_back(box.min - Vec3::Ones(), Vec3(box.min.x() + 0.3 * (box.max - box.min).x(), 9, 9));
    WorldSettings settings = test::weightless();
    settings.gravity = Vec3(0, 0, -9.81);
    World world(settings);
    ASSERT_TRUE(world.addSceneBody(test::shared(c.def)).ok());
    const Points rest = planOutlineOn(middlePlan(c.def), placedMesh(c.def));
    FollowedPlaces places("tissue", rest, Vec3::Zero());
    for (int k = 0; k < 60; ++k) world.step();
    const WorldSnapshot shot = seen(world);
    TriangleMesh surface = shot.bodies[0].model->surface;
    surface.vertices = shot.bodies[0].surface;
    const SolidQuery query(surface);
    const Points now = places.now(shot);
    double sunk = 0.0, most = 0.0;
    for (std::size_t k = 0; k < now.size(); ++k) {
      most = std::max(most, query.distance(now[k]));
      sunk = std::max(sunk, (now[k] - rest[k]).norm());
    }
    EXPECT_GT(sunk, 0.002);
    EXPECT_LT(most, 0.05 * sunk);
  }
}

TEST(FollowedPlaces, OfACutGoWithThePieceOnTheirSideAndAreGoneWithIt) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    World world(test::weightless());
    ASSERT_TRUE(world.addSceneBody(test::shared(c.def)).ok());
    const CutPlan plan = middlePlan(c.def);
    const Vec3 normal = plan.along.cross(plan.out);
    const Points line = planOutlineOn(plan, placedMesh(c.def));
    FollowedPlaces above("tissue", line, normal), below("tissue", line, -normal);
    const Box box = boundsOf(c.def.mesh.vertices);
    const double far = 0.3 * (box.max - box.min).maxCoeff();
    FollowedPlaces beyond("tissue", {c.def.pose * Vec3(0.5 * (box.min + box.max)) + far * normal}, Vec3::Zero());
    const Points whole = above.now(seen(world));
    const Vec3 there = beyond.now(seen(world))[0];
    ASSERT_EQ(2u, test::replyOf<CutReply>(world.apply(along(plan))).new_bodies.size());
    WorldSnapshot shot = seen(world);
    std::string gone;
    for (BodySnapshot& body : shot.bodies) {
      double height = 0.0;
      for (const Vec3& p : body.surface) height += normal.dot(p - plan.origin);
      const bool up = height > 0.0;
      if (up) gone = body.name;
      for (Vec3& p : body.particles) p += (up ? 0.05 : -0.05) * normal;  // drawn apart
    }
    const Points up = above.now(shot), down = below.now(shot);
    for (std::size_t k = 0; k < line.size(); ++k) {
      EXPECT_LT((up[k] - line[k] - 0.05 * normal).norm(), 1e-6);
      EXPECT_LT((down[k] - line[k] + 0.05 * normal).norm(), 1e-6);
    }
    EXPECT_TRUE(there.allFinite());
    EXPECT_TRUE(beyond.now(shot)[0].allFinite());
    test::replyOf<Done>(world.apply(RemoveCommand{gone}));
    EXPECT_FALSE(beyond.now(seen(world))[0].allFinite());
    test::replyOf<UndoCutReply>(world.apply(UndoCutCommand{}));
    const Points again = above.now(seen(world));
    for (std::size_t k = 0; k < line.size(); ++k) EXPECT_LT((again[k] - whole[k]).norm(), 1e-12);
  }
}

TEST(FollowedPlaces, OfAWoundStayOnOneLip) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.16, 0.12, 0.02), 32, 24, 4), "tissue");
  def.spacing = 0.02 / 3.0;
  def.material.youngs_modulus = 1.5e4;
  def.material.damping = 20.0;
  World world(test::weightless());
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  CutPlan plan;
  plan.body = "tissue";
  plan.origin = Vec3(-0.0401, 0.0012, 0.01);
  plan.length = 0.08;
  plan.depth = 0.013;
  const Points line = planOutlineOn(plan, def.mesh);
  const Vec3 normal = plan.along.cross(plan.out);
  FollowedPlaces above("tissue", line, normal), below("tissue", line, -normal);
  InciseCommand incise;
  incise.blade = {plan.origin + 0.001 * plan.out, plan.along, plan.out, 0.08, 0.014};
  test::replyOf<InciseReply>(world.apply(incise));
  for (const double side : {-1.0, 1.0}) {
    PickCommand pick;
    pick.point = Vec3(0, 0.0012, 0.01) + side * 0.008 * normal;
    pick.max_distance = 0.01;
    const auto picked = test::replyOf<PickReply>(world.apply(pick));
    test::replyOf<Done>(world.apply(MovePickCommand{picked.pick, picked.position + side * 0.02 * normal}));
  }
  for (int k = 0; k < 60; ++k) world.step();
  const Points up = above.now(seen(world)), down = below.now(seen(world));
  std::size_t open = 0;
  for (std::size_t k = 0; k < line.size(); ++k) {
    if (std::abs(line[k].x()) > 0.03 || line[k].z() < 0.0) continue;
    EXPECT_GT(normal.dot(up[k] - down[k]), 0.001) << line[k].transpose();
    ++open;
  }
  EXPECT_GT(open, 20u);
}

TEST(PlanOutline, HasTheLengthOfItsSides) {
  const TriangleMesh box = test::block("tissue").mesh;  // 0.2 x 0.1 x 0.1 about the origin
  const auto lengthOf = [&](const CutPlan& plan) {
    const Points ends = planOutlineOn(plan, box);
    double length = 0.0;
    for (std::size_t k = 0; k + 1 < ends.size(); k += 2) {
      length += (ends[k + 1] - ends[k]).norm();
      EXPECT_LT(plan.distance(ends[k]), plan.tolerance);
    }
    return length;
  };
  CutPlan plan;
  plan.body = "tissue";
  plan.origin = Vec3(0.0123, -1, 1);
  plan.along = Vec3::UnitY();
  plan.length = plan.depth = 2.0;
  EXPECT_NEAR(0.4, lengthOf(plan), 1e-9);  // all around
  plan.origin.x() = 0.0;                   // through vertices
  EXPECT_NEAR(0.4, lengthOf(plan), 1e-9);
  for (const double above : {0.001, -0.001}) {  // of a wound, a little beside the surface
    plan.origin = Vec3(0.0123, -0.0301, 0.05 + above);
    plan.length = 0.06;
    plan.depth = 0.02;
    // The surface, the sides, the lower edge, and the upper one where it is in the tissue.
    EXPECT_NEAR(2.0 * 0.02 + (above > 0.0 ? 2.0 : 3.0) * 0.06, lengthOf(plan), 0.01);
  }
}

}  // namespace followed_places_test
}  // namespace meshless
