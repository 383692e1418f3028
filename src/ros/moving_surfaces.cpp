#include "moving_surfaces.h"

#include <algorithm>
#include <cmath>

#include "convert.h"

namespace meshless {
namespace {

constexpr double kFinest = 65535.0;

std::vector<std::uint8_t> toBytes(const std::vector<Color>& colors) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(3 * colors.size());
  for (const Color& c : colors)
    for (const float channel : {c.r, c.g, c.b})
      bytes.push_back(static_cast<std::uint8_t>(std::lround(255.0f * channel)));
  return bytes;
}

meshless_surgery::Look toLook(const Look& look, const Color& base) {
  meshless_surgery::Look message;
  message.noise = static_cast<std::uint8_t>(look.noise);
  message.color = toColor(base);
  message.second = toColor(look.second);
  message.image = look.image ? look.image->id() : 0;
  message.scale = static_cast<float>(look.scale);
  message.wetness = static_cast<float>(look.wetness);
  message.bump = static_cast<float>(look.bump);
  return message;
}

void addLooks(const BodySnapshot& body, const VertexColors& baked, meshless_surgery::BodyTopology& message) {
  const Material& own = body.material;
  message.looks = {toLook(own.appearance.outer, own.color), toLook(own.appearance.inner, own.inside_color)};
  bool by_place = needsPlace(own.appearance.outer) || needsPlace(own.appearance.inner);
  for (const RegionTissue& region : body.model->regions) {
    message.looks.push_back(toLook(region.material.appearance.inner, region.material.inside_color));
    by_place = by_place || needsPlace(region.material.appearance.inner);
  }
  message.colors = toBytes(baked.outer);
  message.inside_colors = toBytes(baked.inside);
  message.uv.reserve(2 * baked.texture.size());
  for (const TexturePoint& point : baked.texture) message.uv.insert(message.uv.end(), point.begin(), point.end());
  if (!by_place) return;
  message.rest.reserve(3 * body.model->surface.vertices.size());
  for (const Vec3& v : body.model->surface.vertices) {
    const Vec3 place = body.model->own * v;
    for (int axis = 0; axis < 3; ++axis) message.rest.push_back(static_cast<float>(place[axis]));
  }
}

meshless_surgery::BodyTopology toTopology(const BodySnapshot& body, const VertexColors& baked) {
  auto message = toSurfaceOf<meshless_surgery::BodyTopology>(body);
  message.vertices = static_cast<std::uint32_t>(body.model->surface.vertices.size());
  addLooks(body, baked, message);
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

// To what the message resolves: the rounding of a body that floats at rest is no motion.
bool alike(const meshless_surgery::BodyVertices& one, const meshless_surgery::BodyVertices& other) {
  const auto near = [](std::uint16_t a, std::uint16_t b) { return std::abs(int{a} - int{b}) <= 1; };
  const Vec3 moved(one.origin.x - other.origin.x, one.origin.y - other.origin.y, one.origin.z - other.origin.z);
  return moved.norm() <= other.step && std::abs(one.step - other.step) * kFinest <= other.step &&
         std::equal(one.xyz.begin(), one.xyz.end(), other.xyz.begin(), other.xyz.end(), near);
}

}  // namespace

bool MovingSurfaces::isKnown(const WorldSnapshot& snapshot) const {
  if (topology_ == 0 || run_ != snapshot.run || known_.size() != snapshot.bodies.size()) return false;
  for (std::size_t i = 0; i < known_.size(); ++i) {
    if (!known_[i].isOf(snapshot.bodies[i])) return false;
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
  baked_.update(snapshot);
  for (const BodySnapshot& body : snapshot.bodies) {
    known_.emplace_back(body);
    message.bodies.push_back(toTopology(body, baked_.of(body)));
  }
  return message;
}

std::optional<meshless_surgery::TissueImages> MovingSurfaces::newImages(const WorldSnapshot& snapshot,
                                                                        const std_msgs::Header& header) {
  std::map<std::uint64_t, ImagePtr> now;
  const auto add = [&now](const Look& look) {
    if (look.image) now.emplace(look.image->id(), look.image);
  };
  for (const BodySnapshot& body : snapshot.bodies) {
    add(body.material.appearance.outer);
    add(body.material.appearance.inner);
    for (const RegionTissue& region : body.model->regions) add(region.material.appearance.inner);
  }
  const auto same = [](const auto& one, const auto& other) { return one.first == other.first; };
  if (std::equal(now.begin(), now.end(), images_.begin(), images_.end(), same)) return std::nullopt;
  images_ = std::move(now);
  meshless_surgery::TissueImages message;
  message.header = header;
  for (const auto& [id, image] : images_) {
    message.images.emplace_back();
    message.images.back().id = id;
    message.images.back().width = image->width();
    message.images.back().height = image->height();
    message.images.back().rgb = image->rgb();
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
    const bool moved = before == said_.end() || !alike(before->second, now);
    if (!moved && !message.complete) continue;
    message.bodies.push_back(now);
    if (moved) said_[body.number] = std::move(now);
  }
  return message;
}

}  // namespace meshless
