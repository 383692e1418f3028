// Core values to messages, everything in the world frame.
#pragma once

#include <geometry_msgs/Pose.h>
#include <meshless_surgery/Event.h>
#include <meshless_surgery/Info.h>
#include <meshless_surgery/State.h>
#include <sensor_msgs/PointCloud2.h>
#include <shape_msgs/Mesh.h>
#include <std_msgs/ColorRGBA.h>

#include "runner.h"

namespace meshless {

geometry_msgs::Point toPoint(const Vec3& v);
geometry_msgs::Vector3 toVector(const Vec3& v);
geometry_msgs::Quaternion toQuaternion(const Quat& q);
geometry_msgs::Pose toPose(const Pose& pose);
std_msgs::ColorRGBA toColor(const Color& color);
/// +x along the blades, +z normal to them.
Pose poseOf(const ScissorBlades& blades);
ScissorBlades bladesAt(const Pose& pose, double length, double width);

std::vector<meshless_surgery::CavityState> toCavities(const BodyMeasures& measures);
std::vector<meshless_surgery::PickState> toPicks(const WorldSnapshot& snapshot);
/// Needs a snapshot with measures.
meshless_surgery::State toState(const WorldSnapshot& snapshot, const RunnerStatus& status,
                                const std_msgs::Header& header);
/// Without what a world does not know of itself: header, scene, version, world_frame.
meshless_surgery::Info toInfo(const WorldSnapshot& snapshot, const WorldSettings& settings);
/// Of a body at rest, before its first step.
meshless_surgery::BodyInfo toInfo(const std::string& name, const BodyModel& model, const WorldSettings& settings);
/// What a surface, with its vertices and without, says of its body: instantiated for Surface and BodyTopology.
template <class Message>
Message toSurfaceOf(const BodySnapshot& body);
/// The constant of every answer's error_code.
std::int32_t toErrorCode(ErrorCode code);
meshless_surgery::Event toEvent(const Event& event, const std_msgs::Header& header);
/// Every particle with x y z body rgb. Needs a snapshot with particles.
sensor_msgs::PointCloud2 toCloud(const WorldSnapshot& snapshot, const std_msgs::Header& header);
/// Of x y z as float32 or float64. Refuses kInvalidArgument: other fields, big-endian, less data than it says.
Result<Points> toPoints(const sensor_msgs::PointCloud2& cloud);
/// x y z alone.
sensor_msgs::PointCloud2 toCloud(const Points& points, const std_msgs::Header& header);
shape_msgs::Mesh toMesh(const Points& vertices, const std::vector<Triangle>& triangles);

}  // namespace meshless
