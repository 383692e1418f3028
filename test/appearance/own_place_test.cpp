// Patterns fill the body's own frame: the frame is the file's, wherever a body is put, and its pieces keep it.
#include <gtest/gtest.h>

#include "meshless_surgery/appearance/look.h"
#include "support/bodies.h"
#include "support/images.h"

namespace meshless {
namespace own_place_test {

Look lobules() {
  Look look;
  look.noise = Noise::kLobules;
  look.scale = 0.02;
  return look;
}

Pose aside() {
  Pose pose;
  pose.rotation = Quat(Eigen::AngleAxisd(0.7, Vec3(1, 2, -1).normalized()));
  pose.translation = Vec3(0.3, -0.2, 0.5);
  return pose;
}

BodyDef tilted(double edge, bool cells) {
  BodyDef def = test::defOf(sphereMesh(0.1, edge));
  const Quat turn(Eigen::AngleAxisd(0.5, Vec3(1, 1, 3).normalized()));  // its main axes are not the file's
  for (Vec3& v : def.mesh.vertices) v = turn * v.cwiseProduct(Vec3(1.0, 0.7, 0.5)) + Vec3(0.01, 0.02, 0.0);
  def.pose = aside();
  def.clusters.kind = cells ? ClusterOptions::Kind::kCells : ClusterOptions::Kind::kOne;
  def.spacing = 0.03;
  return def;
}

Points ownPlaces(const BodyModel& model) {
  Points places;
  for (const Vec3& v : model.surface.vertices) places.push_back(model.own * v);
  return places;
}

double nearest(const Points& places, const Vec3& to) {
  double least = 1e9;
  for (const Vec3& p : places) least = std::min(least, (p - to).norm());
  return least;
}

TEST(OwnPlace, IsThatOfTheFileOnEveryMeshAndAtEveryPose) {
  for (const bool cells : {false, true})
    for (const double edge : {0.02, 0.035}) {
      const BodyDef def = tilted(edge, cells);
      const PreparedBody body = test::prepared(def), copy = placedCopy(body, "copy", Pose());
      const Points places = ownPlaces(*body.model);
      for (const Vec3& v : def.mesh.vertices) ASSERT_LT(nearest(places, v), 1e-12) << cells << " " << edge;
      for (const PreparedBody* one : {&body, &copy})
        for (std::size_t v = 0; v < places.size(); ++v)
          ASSERT_LT((one->def.pose * places[v] - one->state.surface[v]).norm(), 1e-3) << cells << " " << edge;
    }
}

TEST(OwnPlace, PiecesHaveTheirParentsColoursWhereTheyAreTheParent) {
  for (const bool cells : {false, true}) {
    World world(test::weightless());
    const BodyDef def = tilted(0.03, cells);
    ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
    const Points whole = ownPlaces(*world.snapshot({}).bodies[0].model);
    for (int i = 0; i < 10; ++i) world.step();
    CutCommand cut;
    cut.blades.origin = def.pose * Vec3(0.013, -1.0, 0.0);
    cut.blades.x_axis = def.pose.rotation * Vec3::UnitY();
    cut.blades.y_axis = def.pose.rotation * Vec3::UnitZ();
    ASSERT_TRUE(world.apply(cut).ok());
    const WorldSnapshot snapshot = world.snapshot({});
    ASSERT_EQ(2u, snapshot.bodies.size());
    std::size_t kept = 0, made = 0;
    for (const BodySnapshot& piece : snapshot.bodies)
      for (const Vec3& place : ownPlaces(*piece.model)) {
        const bool on_the_face = std::abs(place.x() - 0.013) < 2e-3;
        made += on_the_face;
        if (on_the_face) continue;
        ++kept;
        ASSERT_LT(nearest(whole, place), 1e-9) << cells;
      }
    EXPECT_GT(made, 10u);
    EXPECT_GE(kept, whole.size() * 9 / 10);
    // Both faces of a cut, and neighbours across its rim, look alike.
    const Points left = ownPlaces(*snapshot.bodies[0].model), right = ownPlaces(*snapshot.bodies[1].model);
    std::size_t common = 0;
    for (const Vec3& a : left)
      for (const Vec3& b : right)
        if ((a - b).norm() < 1e-9) {
          ++common;
          for (const Look& look : {lobules(), test::chequered(0.05)}) {  // the faces are turned against each other
            const Color one = colorAt(look, Color(), a, Vec3::UnitX()),
                        other = colorAt(look, Color(), b, -Vec3::UnitX());
            ASSERT_NEAR(one.r, other.r, 1e-5f);
          }
        }
    EXPECT_GT(common, 5u) << cells;
  }
}

}  // namespace own_place_test
}  // namespace meshless
