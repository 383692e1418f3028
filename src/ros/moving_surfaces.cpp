#include "meshless_surgery/ros/moving_surfaces.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/ros/convert.h"

namespace meshless {
namespace {

constexpr double kFinest = 65535.0;

bool same(const Color& one, const Color& other) {
  return one.r == other.r && one.g == other.g && one.b == other.b && one.a == other.a;
}

meshless_surgery::BodyTopology toTopology(const BodySnapshot& body) {
  const TriangleMesh& mesh = body.model->surface;
  meshless_surgery::BodyTopology message;
  message.id = body.number;
  message.name = body.name;
  message.color = toColor(body.material.color);
  message.inside_color = toColor(body.material.inside_color);
  message.vertices = static_cast<std::uint32_t>(mesh.vertices.size());
  message.triangles.reserve(3 * mesh.triangles.size());
  message.cut.reserve(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const Index v : mesh.triangles[t]) message.triangles.push_back(static_cast<std::uint32_t>(v));
    message.cut.push_back(isCutPatch(mesh.patchOf(t)) ? 1 : 0);
  }
  message.regions = surfaceRegions(*body.model);
  message.region_colors = regionColors(*body.model);
  return message;
}

meshless_surgery::BodyVertices toVertices(const BodySnapshot& body) {
  meshless_surgery::BodyVertices message;
  message.id = body.number;
  Box box;
  for (const Vec3& v : body.surface) box.extend(v);
  if (body.surface.empty()) return message;
  message.origin = toPoint(box.min);
  message.step = std::max((box.max - box.min).maxCoeff(), 1e-9) / kFinest;
  message.xyz.reserve(3 * body.surface.size());
  for (const Vec3& v : body.surface) {
    const Vec3 place = (v - box.min) / message.step;
    for (int axis = 0; axis < 3; ++axis) {
      message.xyz.push_back(static_cast<std::uint16_t>(std::lround(std::clamp(place[axis], 0.0, kFinest))));
    }
  }
  return message;
}

}  // namespace

bool MovingSurfaces::isKnown(const WorldSnapshot& snapshot) const {
  if (topology_ == 0 || run_ != snapshot.run || known_.size() != snapshot.bodies.size()) return false;
  for (std::size_t i = 0; i < known_.size(); ++i) {
    const BodySnapshot& body = snapshot.bodies[i];
    if (known_[i].number != body.number || known_[i].model != body.model ||
        !same(known_[i].color, body.material.color) || !same(known_[i].inside_color, body.material.inside_color)) {
      return false;
    }
  }
  return true;
}

std::optional<meshless_surgery::Topology> MovingSurfaces::change(const WorldSnapshot& snapshot,
                                                                 const std_msgs::Header& header) {
  if (isKnown(snapshot)) return std::nullopt;
  known_.clear();
  run_ = snapshot.run;
  meshless_surgery::Topology message;
  message.header = header;
  message.run = run_;
  message.topology = ++topology_;
  message.bodies.reserve(snapshot.bodies.size());
  for (const BodySnapshot& body : snapshot.bodies) {
    known_.push_back({body.number, body.model, body.material.color, body.material.inside_color});
    message.bodies.push_back(toTopology(body));
  }
  return message;
}

meshless_surgery::Vertices MovingSurfaces::vertices(const WorldSnapshot& snapshot, const std_msgs::Header& header,
                                                    bool complete) {
  meshless_surgery::Vertices message;
  message.header = header;
  message.run = run_;
  message.topology = topology_;
  message.complete = complete || said_topology_ != topology_;
  if (said_topology_ != topology_) said_.clear();
  said_topology_ = topology_;
  for (const BodySnapshot& body : snapshot.bodies) {
    auto now = toVertices(body);
    const auto before = said_.find(body.number);
    const bool moved = before == said_.end() || !(before->second == now);
    if (!moved && !message.complete) continue;
    message.bodies.push_back(now);
    if (moved) said_[body.number] = std::move(now);
  }
  return message;
}

}  // namespace meshless
