#include "convert.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include <meshless_surgery/BodyTopology.h>
#include <meshless_surgery/Release.h>
#include <meshless_surgery/Surface.h>
#include <sensor_msgs/point_cloud2_iterator.h>
#include <tf2_eigen/tf2_eigen.h>

namespace meshless {
namespace {

using sensor_msgs::PointField;

/// One row, dense, in the machine's own byte order.
sensor_msgs::PointCloud2 emptyCloud(const std_msgs::Header& header) {
  sensor_msgs::PointCloud2 cloud;
  cloud.header = header;
  cloud.height = 1;
  cloud.is_dense = true;
  cloud.is_bigendian = __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__;
  return cloud;
}

void setXyz(std::uint8_t* to, const Vec3& p) {
  const float xyz[3] = {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
  std::memcpy(to, xyz, sizeof(xyz));
}

constexpr Color kHeldColor{0.1f, 0.4f, 1.0f, 1.0f};  // of particles that are held: no tissue is blue

/// PCL's packing: 0x00rrggbb in the bits of a float.
std::uint32_t packed(const Color& color) {
  const auto byte = [](float channel) {
    return static_cast<std::uint32_t>(std::lround(255.0f * std::min(1.0f, std::max(0.0f, channel))));
  };
  return byte(color.r) << 16 | byte(color.g) << 8 | byte(color.b);
}

}  // namespace

geometry_msgs::Point toPoint(const Vec3& v) { return tf2::toMsg(v); }

std_msgs::ColorRGBA toColor(const Color& color) {
  std_msgs::ColorRGBA message;
  message.r = color.r;
  message.g = color.g;
  message.b = color.b;
  message.a = color.a;
  return message;
}

geometry_msgs::Vector3 toVector(const Vec3& v) {
  geometry_msgs::Vector3 vector;
  return tf2::toMsg(v, vector);
}

geometry_msgs::Quaternion toQuaternion(const Quat& q) { return tf2::toMsg(q); }

geometry_msgs::Pose toPose(const Pose& pose) {
  geometry_msgs::Pose message;
  message.position = toPoint(pose.translation);
  message.orientation = toQuaternion(pose.rotation);
  return message;
}

Pose poseOf(const ScissorBlades& blades) {
  Mat3 axes;
  axes << blades.x_axis, blades.y_axis, blades.x_axis.cross(blades.y_axis);
  Pose pose;
  pose.rotation = Quat(axes).normalized();
  pose.translation = blades.origin;
  return pose;
}

ScissorBlades bladesAt(const Pose& pose, double length, double width) {
  ScissorBlades blades;
  blades.origin = pose.translation;
  blades.x_axis = pose.rotation * Vec3::UnitX();
  blades.y_axis = pose.rotation * Vec3::UnitY();
  blades.length = length;
  blades.width = width;
  return blades;
}

std::vector<meshless_surgery::CavityState> toCavities(const BodyMeasures& measures) {
  std::vector<meshless_surgery::CavityState> cavities;
  for (const BodyMeasures::Cavity& cavity : measures.cavities) {
    cavities.emplace_back();
    cavities.back().volume = cavity.volume;
    cavities.back().pressure = cavity.pressure;
    cavities.back().open = cavity.open;
  }
  return cavities;
}

std::vector<meshless_surgery::PickState> toPicks(const WorldSnapshot& snapshot) {
  std::vector<meshless_surgery::PickState> picks;
  picks.reserve(snapshot.picks.size());
  for (const Pick& pick : snapshot.picks) {
    meshless_surgery::PickState message;
    message.pick_id = pick.id;
    const auto body = snapshot.pick_bodies.find(pick.id);
    if (body != snapshot.pick_bodies.end()) message.body = body->second;
    message.locked = pick.locked;
    message.position = toPoint(pick.position);
    message.target = toPoint(pick.target);
    message.force = toVector(pick.force);
    picks.push_back(std::move(message));
  }
  return picks;
}

meshless_surgery::State toState(const WorldSnapshot& snapshot, const RunnerStatus& status,
                                const std_msgs::Header& header) {
  meshless_surgery::State state;
  state.header = header;
  state.step = snapshot.step;
  state.sim_time = snapshot.sim_time;
  state.real_time_factor = status.real_time_factor;
  state.paused = status.paused;
  state.mean_step = status.mean_step;
  state.worst_step = status.worst_step;
  state.bodies.reserve(snapshot.bodies.size());
  for (const BodySnapshot& body : snapshot.bodies) {
    meshless_surgery::BodyState message;
    message.name = body.name;
    message.particles = static_cast<std::uint32_t>(body.model->rest.size());
    message.triangles = static_cast<std::uint32_t>(body.model->surface.triangles.size());
    message.tetrahedra = static_cast<std::uint32_t>(body.tetrahedra);
    message.clusters = body.model->groups();
    message.volume = body.measures.volume;
    message.rest_volume = body.model->rest_volume;
    message.area = body.measures.area;
    message.mass = body.model->mass;
    message.centre_of_mass = toPoint(body.measures.centre_of_mass);
    message.velocity = toVector(body.measures.velocity);
    message.kinetic_energy = body.measures.kinetic_energy;
    message.asleep = body.asleep;
    message.stiffness_factor = body.stiffness_factor;
    message.alpha = body.material.alpha;
    message.beta = body.material.beta;
    message.damping = body.material.damping;
    message.youngs_modulus = body.material.youngs_modulus;
    message.poissons_ratio = body.material.poissons_ratio;
    message.cavities = toCavities(body.measures);
    state.bodies.push_back(std::move(message));
  }
  state.picks = toPicks(snapshot);
  for (const Instrument& instrument : snapshot.instruments) {
    meshless_surgery::InstrumentState message;
    message.name = instrument.def.name;
    message.type = toString(instrument.def.type);
    message.pose = toPose(instrument.pose);
    message.jaw = instrument.jaw;
    message.force = toVector(instrument.force);
    message.torque = toVector(instrument.torque);
    message.holds = instrument.holds;
    message.grip = instrument.gripped;
    state.instruments.push_back(std::move(message));
  }
  for (const AttachmentSnapshot& attachment : snapshot.attachments) {
    meshless_surgery::AttachmentState message;
    message.name = attachment.name;
    message.ends = attachment.ends;
    message.fibres = static_cast<std::uint32_t>(attachment.fibres);
    message.made = static_cast<std::uint32_t>(attachment.made);
    message.area = attachment.area;
    message.force = attachment.force;
    message.jaws = attachment.jaws.value_or(0.0);
    message.middle = toPoint(attachment.middle);
    state.attachments.push_back(std::move(message));
  }
  return state;
}

template <class Message>
Message toSurfaceOf(const BodySnapshot& body) {
  const TriangleMesh& mesh = body.model->surface;
  Message message;
  message.id = body.number;
  message.name = body.name;
  message.color = toColor(body.material.color);
  message.inside_color = toColor(body.material.inside_color);
  message.triangles.reserve(3 * mesh.triangles.size());
  message.cut.reserve(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const Index v : mesh.triangles[t]) message.triangles.push_back(static_cast<std::uint32_t>(v));
    message.cut.push_back(isCutPatch(mesh.patchOf(t)) ? 1 : 0);
  }
  message.regions = surfaceRegions(*body.model);
  for (const RegionTissue& region : body.model->regions)
    message.region_colors.push_back(toColor(region.material.inside_color));
  return message;
}
template meshless_surgery::Surface toSurfaceOf(const BodySnapshot& body);
template meshless_surgery::BodyTopology toSurfaceOf(const BodySnapshot& body);

meshless_surgery::BodyInfo toInfo(const std::string& name, const BodyModel& model, const WorldSettings& settings) {
  meshless_surgery::BodyInfo message;
  message.name = name;
  message.particles = static_cast<std::uint32_t>(model.rest.size());
  message.triangles = static_cast<std::uint32_t>(model.surface.triangles.size());
  message.collision_triangles =
      model.collision ? static_cast<std::uint32_t>(model.collision->mesh.triangles.size()) : message.triangles;
  message.collision_distance = model.collision ? model.collision->distance : 0.0;
  message.clusters = static_cast<std::uint32_t>(model.groups());
  message.spacing = model.spacing;
  message.mass = model.mass;
  message.held = heldShare(model);
  const BodyState rest;
  const double h = 1.0 / settings.step_rate;
  message.substeps_needed = static_cast<std::uint32_t>(substepsNeeded(model, rest, h));
  message.stiffness_factor = stiffnessFactor(model, rest, h / std::max(settings.substeps, settings.max_substeps));
  for (const RegionTissue& region : model.regions) message.region_materials.push_back(region.material.name);
  message.region_shares = regionShares(model);
  return message;
}

meshless_surgery::Info toInfo(const WorldSnapshot& snapshot, const WorldSettings& settings) {
  meshless_surgery::Info info;
  info.step_rate = settings.step_rate;
  info.substeps = static_cast<std::uint32_t>(settings.substeps);
  info.max_substeps = static_cast<std::uint32_t>(settings.max_substeps);
  info.bodies.reserve(snapshot.bodies.size());
  for (const BodySnapshot& body : snapshot.bodies) {
    info.bodies.push_back(toInfo(body.name, *body.model, settings));
    info.bodies.back().stiffness_factor = body.stiffness_factor;
  }
  return info;
}

std::int32_t toErrorCode(ErrorCode code) {
  using Answer = meshless_surgery::ReleaseResponse;  // any: test/messages_test.py holds them to the same constants
  switch (code) {
    case ErrorCode::kInvalidArgument:
      return Answer::INVALID_ARGUMENT;
    case ErrorCode::kUnknownName:
      return Answer::UNKNOWN_NAME;
    case ErrorCode::kDuplicateName:
      return Answer::DUPLICATE_NAME;
    case ErrorCode::kUnreadable:
      return Answer::UNREADABLE;
    case ErrorCode::kForbidden:
      return Answer::FORBIDDEN;
    case ErrorCode::kUnsuitableShape:
      return Answer::UNSUITABLE_SHAPE;
    case ErrorCode::kMissed:
      return Answer::MISSED;
    case ErrorCode::kUnsupported:
      return Answer::UNSUPPORTED;
    case ErrorCode::kFailed:
      break;
  }
  return Answer::FAILED;
}

meshless_surgery::Event toEvent(const Event& event, const std_msgs::Header& header) {
  meshless_surgery::Event message;
  message.header = header;
  message.type = toString(event.type);
  message.body = event.body;
  message.pick_id = event.pick;
  message.instrument = event.instrument;
  message.force = event.force;
  message.step = event.step;
  message.sim_time = event.sim_time;
  message.text = event.text;
  return message;
}

sensor_msgs::PointCloud2 toCloud(const WorldSnapshot& snapshot, const std_msgs::Header& header) {
  sensor_msgs::PointCloud2 cloud = emptyCloud(header);
  sensor_msgs::PointCloud2Modifier layout(cloud);
  layout.setPointCloud2Fields(5, "x", 1, PointField::FLOAT32, "y", 1, PointField::FLOAT32, "z", 1, PointField::FLOAT32,
                              "body", 1, PointField::UINT32, "rgb", 1, PointField::FLOAT32);
  std::size_t points = 0;
  for (const BodySnapshot& body : snapshot.bodies)
    for (Index i = 0; i < body.particles.size(); ++i) points += body.model->isTissue(i);
  layout.resize(points);
  std::uint8_t* to = cloud.data.data();
  const std::uint32_t held = packed(kHeldColor);
  for (const BodySnapshot& body : snapshot.bodies) {
    const std::uint32_t free = packed(body.material.color);
    for (Index i = 0; i < body.particles.size(); ++i) {
      if (!body.model->isTissue(i)) continue;
      setXyz(to, body.particles[i]);
      std::memcpy(to + 12, &body.number, sizeof(body.number));
      const std::uint32_t rgb = body.model->fixed[i] ? held : free;
      std::memcpy(to + 16, &rgb, sizeof(rgb));
      to += cloud.point_step;
    }
  }
  return cloud;
}

sensor_msgs::PointCloud2 toCloud(const Points& points, const std_msgs::Header& header) {
  sensor_msgs::PointCloud2 cloud = emptyCloud(header);
  sensor_msgs::PointCloud2Modifier layout(cloud);
  layout.setPointCloud2Fields(3, "x", 1, PointField::FLOAT32, "y", 1, PointField::FLOAT32, "z", 1, PointField::FLOAT32);
  layout.resize(points.size());
  std::uint8_t* to = cloud.data.data();
  for (const Vec3& p : points) {
    setXyz(to, p);
    to += cloud.point_step;
  }
  return cloud;
}

shape_msgs::Mesh toMesh(const Points& vertices, const std::vector<Triangle>& triangles) {
  shape_msgs::Mesh mesh;
  mesh.vertices.reserve(vertices.size());
  for (const Vec3& p : vertices) mesh.vertices.push_back(toPoint(p));
  mesh.triangles.resize(triangles.size());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) mesh.triangles[t].vertex_indices[k] = triangles[t][k];
  }
  return mesh;
}

Result<Points> toPoints(const sensor_msgs::PointCloud2& cloud) {
  const auto fault = [](const std::string& why) { return Error{ErrorCode::kInvalidArgument, "cloud " + why}; };
  if (cloud.is_bigendian) return fault("is big-endian; accepted: little-endian");
  std::array<const sensor_msgs::PointField*, 3> fields{};
  for (const sensor_msgs::PointField& field : cloud.fields)
    for (std::size_t d = 0; d < 3; ++d)
      if (field.name == std::string(1, "xyz"[d])) fields[d] = &field;
  for (const sensor_msgs::PointField* field : fields) {
    if (field == nullptr) return fault("has not the fields x, y and z");
    const bool single = field->datatype == sensor_msgs::PointField::FLOAT32;
    if (!single && field->datatype != sensor_msgs::PointField::FLOAT64)
      return fault("." + field->name + " is of datatype " + std::to_string(field->datatype) +
                   "; accepted: 7 (FLOAT32), 8 (FLOAT64)");
    if (std::uint64_t{field->offset} + (single ? 4u : 8u) > cloud.point_step)
      return fault("." + field->name + " begins at byte " + std::to_string(field->offset) + " of " +
                   std::to_string(cloud.point_step) + " of a point");
  }
  const std::uint64_t row = std::uint64_t{cloud.width} * cloud.point_step;
  if (cloud.row_step < row || (cloud.height > 0 && cloud.data.size() / cloud.height < cloud.row_step))
    return fault("has " + std::to_string(cloud.data.size()) + " bytes and a row_step of " +
                 std::to_string(cloud.row_step) + "; accepted: height " + std::to_string(cloud.height) +
                 " times a row_step of at least " + std::to_string(row));
  Points points;
  if (cloud.width == 0) return points;  // of however many rows
  points.reserve(std::size_t{cloud.width} * cloud.height);
  for (std::size_t r = 0; r < cloud.height; ++r)
    for (std::size_t c = 0; c < cloud.width; ++c) {
      const std::uint8_t* at = cloud.data.data() + r * cloud.row_step + c * cloud.point_step;
      Vec3 point;
      for (int d = 0; d < 3; ++d) {
        float single = 0.0f;
        if (fields[d]->datatype == sensor_msgs::PointField::FLOAT32) {
          std::memcpy(&single, at + fields[d]->offset, sizeof single);
          point[d] = single;
        } else {
          std::memcpy(&point[d], at + fields[d]->offset, sizeof(double));
        }
      }
      points.push_back(point);
    }
  return points;
}

}  // namespace meshless
