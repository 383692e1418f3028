// What is drawn at the tools is where they are and open as they are.
#include "ros/instruments.h"

#include <fstream>

#include "ros/convert.h"
#include "ros/markers.h"
#include "ros/scene_support.h"

namespace meshless {
namespace instruments_test {

using Parts = std::vector<meshless_surgery::InstrumentPart>;

Pose poseOfPart(const meshless_surgery::InstrumentPart& part) {
  const auto& p = part.pose.position;
  return {Quat(part.pose.orientation.w, part.pose.orientation.x, part.pose.orientation.y, part.pose.orientation.z),
          Vec3(p.x, p.y, p.z)};
}

Vec3 reach(const meshless_surgery::InstrumentPart& part) { return poseOfPart(part).rotation * Vec3::UnitX(); }

Parts of(const Parts& parts, const std::string& kind) {
  Parts found;
  for (const auto& part : parts)
    if (part.mesh.find("/" + kind + ".obj") != std::string::npos) found.push_back(part);
  return found;
}

PickId pickAt(World& world, const Vec3& point) {
  PickCommand pick;
  pick.point = point;
  pick.max_distance = 1.0;
  const auto reply = world.apply(pick);
  EXPECT_TRUE(reply.ok());
  return reply.ok() ? std::get<PickReply>(*reply).pick : 0;
}

Pose turnedBy(double angle) {
  return {Quat(Eigen::AngleAxisd(angle, Vec3(0.3, -0.5, 0.8).normalized())), Vec3::Zero()};
}

TEST(Instruments, ThereAreNoneWithoutTools) {
  const auto world = twoBoxes();
  EXPECT_TRUE(Instruments().parts(world->snapshot({}), {}, {}).empty());
}

TEST(Instruments, ScissorsOpenByTheirAngleAndAreAsLongAsTheirBlades) {
  const auto world = twoBoxes();
  ScissorBlades blades = bladesAt({turnedBy(1.1).rotation, Vec3(0.2, -0.3, 0.4)}, 0.05, 0.03);
  for (const double angle : {0.0, 0.4, 1.2}) {
    world->setScissors(blades, angle);
    const Parts parts = Instruments().parts(world->snapshot({}), {}, {});
    ASSERT_EQ(3u, parts.size());
    const Parts jaws = of(parts, "scissors_blade");
    ASSERT_EQ(2u, jaws.size());
    EXPECT_NEAR(std::cos(angle), reach(jaws[0]).dot(reach(jaws[1])), 1e-9);
    EXPECT_LT((reach(jaws[0]) + reach(jaws[1]) - 2.0 * std::cos(0.5 * angle) * blades.x_axis).norm(), 1e-9);
    // About the axis of the blades, and the second mirrors the first: its back is on the other side.
    const Vec3 normal = blades.x_axis.cross(blades.y_axis);
    for (int k : {0, 1}) {
      EXPECT_LT((poseOfPart(jaws[k]).translation - blades.origin).norm(), 1e-12);
      EXPECT_NEAR(k == 0 ? 1.0 : -1.0, (poseOfPart(jaws[k]).rotation * Vec3::UnitZ()).dot(normal), 1e-9);
    }
    for (const auto& part : parts) EXPECT_NEAR(0.05, 0.06 * part.scale, 1e-12);
  }
}

TEST(Instruments, AGrasperHoldsTheTissueAndIsTurnedAsItsHand) {
  const auto world = twoBoxes();
  Instruments instruments;
  const Pose hand = turnedBy(0.7);
  const PickId first = pickAt(*world, Vec3(0.05, 0.0, 0.0));
  const auto gripOf = [&](const Pick& pick, const Parts& parts) {
    for (const auto& shaft : of(parts, "shaft"))
      if (((poseOfPart(shaft) * Vec3(0.015, 0.0, 0.0)) - pick.position).norm() < 1e-9) return reach(shaft);
    ADD_FAILURE() << "no grasper at the pick";
    return Vec3(Vec3::Zero());
  };
  auto snapshot = world->snapshot({});
  // Nobody says how it is turned: from the front (-y) and from above.
  const Vec3 plain = gripOf(snapshot.picks[0], instruments.parts(snapshot, Pose{}, {}));
  EXPECT_GT(plain.y(), 0.0);
  EXPECT_LT(plain.z(), 0.0);
  Parts parts = instruments.parts(snapshot, hand, {});
  EXPECT_LT((gripOf(snapshot.picks[0], parts) - hand.rotation * Vec3::UnitX()).norm(), 1e-9);
  const Parts jaws = of(parts, "grasping_jaw");
  ASSERT_EQ(2u, jaws.size());
  EXPECT_GT(reach(jaws[0]).dot(reach(jaws[1])), std::cos(0.3)) << "closed, but for the tissue between";
  // Locked, it stays as it was, while the hand has another.
  LockCommand lock;
  lock.pick = first;
  ASSERT_TRUE(world->apply(lock).ok());
  pickAt(*world, Vec3(0.45, 0.0, 0.0));
  snapshot = world->snapshot({});
  ASSERT_EQ(2u, snapshot.picks.size());
  const Pose other = turnedBy(-1.0);
  parts = instruments.parts(snapshot, other, {});
  for (const Pick& pick : snapshot.picks)
    EXPECT_LT((gripOf(pick, parts) - (pick.id == first ? hand : other).rotation * Vec3::UnitX()).norm(), 1e-9);
}

TEST(Instruments, AProbeReachesToThePushSphere) {
  const auto world = twoBoxes();
  PushCommand push;
  push.position = Vec3(0.1, 0.2, 1.0);
  push.radius = 0.03;
  ASSERT_TRUE(world->apply(push).ok());
  Instruments instruments;
  const Pose hand = turnedBy(0.7);
  for (const std::optional<Pose>& said :
       {std::optional<Pose>(hand), std::optional<Pose>()}) {  // the stream falls silent
    const Parts parts = instruments.parts(world->snapshot({}), {}, said);
    ASSERT_EQ(1u, parts.size());
    EXPECT_LT((poseOfPart(parts[0]).translation - push.position).norm(), 1e-12);
    EXPECT_LT((reach(parts[0]) - hand.rotation * Vec3::UnitX()).norm(), 1e-9);
  }
}

TEST(Instruments, MarkersShowEachPartAndThenDeleteIt) {
  const auto world = twoBoxes();
  SnapshotWants wants;
  wants.surfaces = true;
  MarkerBuilder builder("world");
  Instruments instruments;
  const auto build = [&](int action) {
    const auto snapshot = world->snapshot(wants);
    std::vector<visualization_msgs::Marker> found;
    for (const auto& marker : builder.build(snapshot, ros::Time(), false, instruments.parts(snapshot, {}, {})).markers)
      if (marker.ns == "instruments" && marker.action == action) found.push_back(marker);
    return found;
  };
  EXPECT_TRUE(build(visualization_msgs::Marker::ADD).empty());
  world->setScissors(cutAcross(0.0).blades, 0.4);
  const auto parts = instruments.parts(world->snapshot({}), {}, {});
  const auto shown = build(visualization_msgs::Marker::ADD);
  ASSERT_EQ(parts.size(), shown.size());
  const std::string package = "package://meshless_surgery/";
  for (std::size_t k = 0; k < parts.size(); ++k) {
    EXPECT_EQ(visualization_msgs::Marker::MESH_RESOURCE, shown[k].type);
    EXPECT_EQ(parts[k].pose, shown[k].pose);
    EXPECT_EQ(parts[k].scale, shown[k].scale.y);
    ASSERT_EQ(0u, shown[k].mesh_resource.rfind(package, 0));
    EXPECT_TRUE(std::ifstream(std::string(SOURCE_DIR) + "/" + shown[k].mesh_resource.substr(package.size())).good())
        << shown[k].mesh_resource;
  }
  world->hideScissors();
  EXPECT_EQ(parts.size(), build(visualization_msgs::Marker::DELETE).size());
}

}  // namespace instruments_test
}  // namespace meshless
