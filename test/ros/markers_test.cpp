#include "ros/markers.h"

#include <set>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "ros/scene_support.h"

namespace meshless {
namespace markers_test {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

SnapshotWants surfaces() {
  SnapshotWants wants;
  wants.surfaces = true;
  return wants;
}

std::vector<Marker> with(const MarkerArray& array, const std::string& ns, int action) {
  std::vector<Marker> found;
  for (const Marker& marker : array.markers)
    if (marker.ns == ns && marker.action == action) found.push_back(marker);
  return found;
}

double areaOf(const Marker& marker) {
  double area = 0.0;
  for (std::size_t k = 0; k + 2 < marker.points.size(); k += 3) {
    const auto at = [&](std::size_t i) { return Vec3(marker.points[i].x, marker.points[i].y, marker.points[i].z); };
    area += 0.5 * (at(k + 1) - at(k)).cross(at(k + 2) - at(k)).norm();
  }
  return area;
}

TEST(Markers, OneTriangleListABodyWithItsWholeSurface) {
  const auto world = twoBoxes();
  MarkerBuilder builder("map");
  const MarkerArray array = builder.build(world->snapshot(surfaces()), ros::Time(7.0), false);
  const auto bodies = with(array, "bodies", Marker::ADD);
  ASSERT_EQ(2u, bodies.size());
  EXPECT_NE(bodies[0].id, bodies[1].id);
  for (const Marker& body : bodies) {
    EXPECT_EQ("map", body.header.frame_id);
    EXPECT_EQ(ros::Time(7.0), body.header.stamp);
    EXPECT_EQ(Marker::TRIANGLE_LIST, body.type);
    EXPECT_EQ(0u, body.points.size() % 3);
    EXPECT_NEAR(0.06, areaOf(body), 1e-9);
    EXPECT_EQ(1.0, body.pose.orientation.w);
    EXPECT_GT(body.color.a, 0.0f);
  }
}

TEST(Markers, TheFirstArrayAFreshOneAndAResetBeginWithDeleteAll) {
  const auto world = twoBoxes();
  MarkerBuilder builder("world");
  const auto first = [&](bool fresh) {
    return builder.build(world->snapshot(surfaces()), ros::Time(), fresh).markers.at(0).action;
  };
  EXPECT_EQ(Marker::DELETEALL, first(false));
  EXPECT_EQ(Marker::ADD, first(false));
  EXPECT_EQ(Marker::DELETEALL, first(true));
  EXPECT_EQ(Marker::ADD, first(false));
  world->reset();
  EXPECT_EQ(Marker::DELETEALL, first(false));
  EXPECT_EQ(Marker::ADD, first(false));
}

// The same colour in another light.
bool isShadeOf(const std_msgs::ColorRGBA& shade, const std_msgs::ColorRGBA& color) {
  const Eigen::Vector3f a(shade.r, shade.g, shade.b), b(color.r, color.g, color.b);
  return a.cross(b).norm() < 1e-4f;
}

TEST(Markers, ACutBodyIsDeletedAndItsPiecesShowTheInside) {
  const auto world = twoBoxes();
  MarkerBuilder builder("world");
  const auto before = with(builder.build(world->snapshot(surfaces()), ros::Time(), false), "bodies", Marker::ADD);
  ASSERT_EQ(2u, before.size());
  const auto cut = world->apply(cutAcross(0.01));
  ASSERT_TRUE(cut.ok()) << cut.error().detail;
  const auto snapshot = world->snapshot(surfaces());
  const MarkerArray array = builder.build(snapshot, ros::Time(), false);
  const auto gone = with(array, "bodies", Marker::DELETE);
  ASSERT_EQ(1u, gone.size());
  EXPECT_EQ(before[0].id, gone[0].id);
  const auto now = with(array, "bodies", Marker::ADD);
  ASSERT_EQ(3u, now.size());
  const double cap_area = std::get<CutReply>(*cut).cap_area;
  std::size_t coloured = 0;
  for (const Marker& piece : now) {
    ASSERT_EQ(piece.points.size(), piece.colors.size());
    Marker inside;
    for (std::size_t p = 0; p < piece.colors.size(); ++p)
      if (!isShadeOf(piece.colors[p], piece.color)) inside.points.push_back(piece.points[p]);
    if (inside.points.empty()) continue;
    ++coloured;
    EXPECT_NEAR(cap_area, areaOf(inside), 1e-9);
  }
  EXPECT_EQ(2u, coloured);
}

TEST(Markers, ADeleteIsSaidForASecondAndThenNoMore) {
  const auto world = twoBoxes();
  MarkerBuilder builder("world");
  builder.build(world->snapshot(surfaces()), ros::Time(), false);
  EXPECT_FALSE(builder.deleting());
  RemoveCommand remove;
  remove.body = "a";
  ASSERT_TRUE(world->apply(remove).ok());
  for (int i = 0; i < 30; ++i) {
    const auto array = builder.build(world->snapshot(surfaces()), ros::Time(), false);
    EXPECT_EQ(1u, with(array, "bodies", Marker::DELETE).size()) << i;
    EXPECT_EQ(i < 29, builder.deleting()) << i;
  }
  const auto array = builder.build(world->snapshot(surfaces()), ros::Time(), false);
  EXPECT_EQ(0u, with(array, "bodies", Marker::DELETE).size());
}

TEST(Markers, TrianglesWithoutAnAreaAreLeftOut) {
  const auto world = twoBoxes();
  auto snapshot = world->snapshot(surfaces());
  const auto& triangles = snapshot.bodies[0].model->surface.triangles;
  // The second corner of the first triangle falls onto the first.
  Points& surface = snapshot.bodies[0].surface;
  surface[triangles[0][1]] = surface[triangles[0][0]];
  std::size_t flat = 0;
  for (const Triangle& t : triangles) {
    const Vec3 n = (surface[t[1]] - surface[t[0]]).cross(surface[t[2]] - surface[t[0]]);
    if (n.norm() == 0.0) ++flat;
  }
  ASSERT_GE(flat, 1u);
  MarkerBuilder builder("world");
  const auto bodies = with(builder.build(snapshot, ros::Time(), false), "bodies", Marker::ADD);
  EXPECT_EQ(3 * (triangles.size() - flat), bodies[0].points.size());
}

TEST(Markers, ToolsComeAndGo) {
  const auto world = twoBoxes();
  MarkerBuilder builder("world");
  const auto ids = [&](int action) {
    std::set<int> found;
    for (const Marker& m : with(builder.build(world->snapshot(surfaces()), ros::Time(), false), "tools", action))
      found.insert(m.id);
    return found;
  };
  EXPECT_EQ(std::set<int>{}, ids(Marker::ADD));
  PickCommand pick;
  pick.point = Vec3(0.05, 0.05, 0.05);
  ASSERT_TRUE(world->apply(pick).ok());
  EXPECT_EQ((std::set<int>{0, 1}), ids(Marker::ADD));
  PushCommand push;
  push.position = Vec3(0.0, 0.0, 1.0);
  push.radius = 0.03;
  ASSERT_TRUE(world->apply(push).ok());
  EXPECT_EQ((std::set<int>{0, 1, 2}), ids(Marker::ADD));
  const auto sphere = with(builder.build(world->snapshot(surfaces()), ros::Time(), false), "tools", Marker::ADD)[2];
  EXPECT_EQ(Marker::SPHERE, sphere.type);
  EXPECT_DOUBLE_EQ(0.06, sphere.scale.x);
  EXPECT_EQ(1.0, sphere.pose.position.z);
  ASSERT_TRUE(world->apply(ClearPicksCommand{}).ok());
  EXPECT_EQ((std::set<int>{0, 1}), ids(Marker::DELETE));
  EXPECT_EQ((std::set<int>{2}), ids(Marker::ADD));
}

}  // namespace markers_test
}  // namespace meshless
