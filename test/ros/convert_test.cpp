#include "ros/convert.h"

#include <cstring>

#include "ros/scene_support.h"
#include "support/bodies.h"

namespace meshless {
namespace convert_test {

std_msgs::Header header() {
  std_msgs::Header h;
  h.frame_id = "world";
  h.stamp = ros::Time(3.0);
  return h;
}

template <class T>
T at(const sensor_msgs::PointCloud2& cloud, std::size_t point, const std::string& name) {
  T value{};
  for (const auto& field : cloud.fields) {
    if (field.name == name) std::memcpy(&value, &cloud.data[point * cloud.point_step + field.offset], sizeof(T));
  }
  return value;
}

TEST(Convert, BladesAndPosesAreEachOthersInverse) {
  Pose pose;
  pose.rotation = Quat(0.5, -0.1, 0.7, 0.3).normalized();
  pose.translation = Vec3(0.1, -0.2, 0.3);
  const ScissorBlades blades = bladesAt(pose, 0.06, 0.02);
  EXPECT_LT((blades.blade().plane().normal - pose.rotation * Vec3::UnitZ()).norm(), 1e-12);
  EXPECT_EQ(0.06, blades.length);
  EXPECT_EQ(0.02, blades.width);
  const Pose back = poseOf(blades);
  EXPECT_LT(back.rotation.angularDistance(pose.rotation), 1e-7);
  EXPECT_EQ(pose.translation, back.translation);
}

TEST(Convert, TheCloudHoldsEveryParticleWithItsBodyAndColour) {
  const auto world = twoBoxes();
  SnapshotWants wants;
  wants.particles = true;
  const auto snapshot = world->snapshot(wants);
  const auto cloud = toCloud(snapshot, header());
  std::size_t point = 0;
  for (const BodySnapshot& body : snapshot.bodies) {
    ASSERT_FALSE(body.particles.empty());
    for (const Vec3& p : body.particles) {
      EXPECT_FLOAT_EQ(static_cast<float>(p.x()), at<float>(cloud, point, "x"));
      EXPECT_FLOAT_EQ(static_cast<float>(p.y()), at<float>(cloud, point, "y"));
      EXPECT_FLOAT_EQ(static_cast<float>(p.z()), at<float>(cloud, point, "z"));
      EXPECT_EQ(body.number, at<std::uint32_t>(cloud, point, "body"));
      const auto rgb = at<std::uint32_t>(cloud, point, "rgb");
      EXPECT_NEAR(body.material.color.r, (rgb >> 16 & 255) / 255.0, 0.5 / 255.0);
      EXPECT_NEAR(body.material.color.g, (rgb >> 8 & 255) / 255.0, 0.5 / 255.0);
      EXPECT_NEAR(body.material.color.b, (rgb & 255) / 255.0, 0.5 / 255.0);
      ++point;
    }
  }
  EXPECT_EQ(point, cloud.width);
  EXPECT_EQ(1u, cloud.height);
  EXPECT_EQ(cloud.data.size(), static_cast<std::size_t>(cloud.row_step) * cloud.height);
}

TEST(Convert, TheCloudShowsWhichParticlesAreHeld) {
  for (const double youngs_modulus : {0.0, 5000.0}) {
    BodyDef def = test::defOf(boxMesh(Vec3(0.1, 0.1, 0.1), 4, 4, 4));
    def.material.youngs_modulus = youngs_modulus;
    def.spacing = 0.025;
    def.fixed.push_back({Vec3(-1, -1, -1), Vec3(1, 1, -0.02)});
    World world(WorldSettings{});
    ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
    SnapshotWants wants;
    wants.particles = true;
    const auto snapshot = world.snapshot(wants);
    const auto cloud = toCloud(snapshot, header());
    const BodyModel& model = *snapshot.bodies[0].model;
    std::size_t point = 0, held = 0;
    for (Index i = 0; i < model.rest.size(); ++i) {
      if (!model.isTissue(i)) continue;
      const auto rgb = at<std::uint32_t>(cloud, point++, "rgb");
      const bool is_blue = (rgb & 255) > 200 && (rgb >> 16 & 255) < 50;
      EXPECT_EQ(model.fixed[i], is_blue) << youngs_modulus << ", particle " << i;
      held += is_blue;
    }
    EXPECT_EQ(cloud.width, point);
    EXPECT_GT(held, 0u);
    EXPECT_LT(held, cloud.width);
  }
}

TEST(Convert, StateHasTheNumbersOfEveryBodyAndPick) {
  const auto world = twoBoxes();
  PickCommand pick;
  pick.point = Vec3(0.55, 0.05, 0.05);
  ASSERT_TRUE(world->apply(pick).ok());
  world->step();
  SnapshotWants wants;
  wants.measures = true;
  RunnerStatus status;
  status.real_time_factor = 0.75;
  const auto state = toState(world->snapshot(wants), status, header());
  EXPECT_EQ(1u, state.step);
  EXPECT_DOUBLE_EQ(1.0 / 120.0, state.sim_time);
  EXPECT_EQ(0.75, state.real_time_factor);
  ASSERT_EQ(2u, state.bodies.size());
  EXPECT_EQ("a", state.bodies[0].name);
  EXPECT_NEAR(1e-3, state.bodies[1].rest_volume, 1e-9);
  EXPECT_NEAR(1e-3, state.bodies[1].volume, 1e-9);
  EXPECT_NEAR(0.06, state.bodies[1].area, 1e-9);
  EXPECT_NEAR(1.0, state.bodies[1].mass, 1e-6);
  EXPECT_NEAR(0.5, state.bodies[1].centre_of_mass.x, 0.01);  // masses follow a random filling
  EXPECT_EQ(6u * 9u * 2u, state.bodies[1].triangles);
  EXPECT_GT(state.bodies[1].particles, 0u);
  EXPECT_GT(state.bodies[1].clusters, 0u);
  ASSERT_EQ(1u, state.picks.size());
  EXPECT_EQ("b", state.picks[0].body);
  EXPECT_FALSE(state.picks[0].locked);
}

TEST(Convert, EventsKeepTheirWords) {
  const auto world = twoBoxes();
  ASSERT_TRUE(world->apply(cutAcross(0.01)).ok());
  bool found = false;
  for (const Event& event : world->takeEvents()) {
    const auto message = toEvent(event, header());
    EXPECT_EQ(toString(event.type), message.type);
    EXPECT_EQ("world", message.header.frame_id);
    if (message.type != "cut") continue;
    found = true;
    EXPECT_EQ("a", message.body);
    EXPECT_FALSE(message.text.empty());
  }
  EXPECT_TRUE(found);
}

TEST(Convert, AMeshKeepsItsVerticesAndTheirOrder) {
  const TriangleMesh box = boxMesh(Vec3(1.0, 2.0, 3.0), 1, 1, 1);
  const auto mesh = toMesh(box.vertices, box.triangles);
  ASSERT_EQ(8u, mesh.vertices.size());
  ASSERT_EQ(12u, mesh.triangles.size());
  for (std::size_t v = 0; v < 8; ++v) EXPECT_EQ(box.vertices[v].y(), mesh.vertices[v].y);
  for (std::size_t t = 0; t < 12; ++t)
    for (std::size_t k = 0; k < 3; ++k) EXPECT_EQ(box.triangles[t][k], mesh.triangles[t].vertex_indices[k]);
}

}  // namespace convert_test
}  // namespace meshless
