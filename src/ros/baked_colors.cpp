#include "meshless_surgery/ros/baked_colors.h"

#include <algorithm>

namespace meshless {
namespace {

bool sameColor(const Color& one, const Color& other) {
  return one.r == other.r && one.g == other.g && one.b == other.b && one.a == other.a;
}

}  // namespace

VertexColors bakeColors(const BodyModel& model, const Material& material) {
  const Points& rest = model.surface.vertices;
  const std::vector<std::uint32_t>& patches = model.surface.patches;
  VertexColors colors;
  if (const Look& look = material.appearance.outer; look.noise != Noise::kPlain) {
    colors.outer.reserve(rest.size());
    for (const Vec3& v : rest) colors.outer.push_back(colorAt(look, material.color, model.own * v));
  }
  std::vector<std::pair<const Look*, const Color*>> inside{{&material.appearance.inner, &material.inside_color}};
  for (const RegionTissue& region : model.regions)
    inside.emplace_back(&region.material.appearance.inner, &region.material.inside_color);
  const bool plain = inside.size() == 1 && inside.front().first->noise == Noise::kPlain;
  if (plain || std::none_of(patches.begin(), patches.end(), isCutPatch)) return colors;
  std::vector<bool> on_cut(rest.size(), false);
  for (std::size_t t = 0; t < model.surface.triangles.size(); ++t)
    if (isCutPatch(patches[t]))
      for (const Index v : model.surface.triangles[t]) on_cut[v] = true;
  std::vector<std::uint8_t> regions = surfaceRegions(model);
  regions.resize(rest.size(), 0);
  colors.inside.assign(rest.size(), Color{0.0f, 0.0f, 0.0f, 1.0f});
  for (std::size_t v = 0; v < rest.size(); ++v)
    if (on_cut[v]) {
      const auto& [look, base] = inside[regions[v]];
      colors.inside[v] = colorAt(*look, *base, model.own * rest[v]);
    }
  return colors;
}

BakedBody::BakedBody(const BodySnapshot& body)
    : number(body.number),
      model(body.model),
      color(body.material.color),
      inside_color(body.material.inside_color),
      appearance(body.material.appearance) {}

bool BakedBody::isOf(const BodySnapshot& body) const {
  return number == body.number && model == body.model && sameColor(color, body.material.color) &&
         sameColor(inside_color, body.material.inside_color) && appearance == body.material.appearance;
}

void BakedColors::update(const WorldSnapshot& snapshot) {
  std::map<std::uint32_t, std::pair<BakedBody, VertexColors>> now;
  for (const BodySnapshot& body : snapshot.bodies) {
    const auto known = bodies_.find(body.number);
    if (known != bodies_.end() && known->second.first.isOf(body))
      now.insert(bodies_.extract(known));
    else
      now.try_emplace(body.number, BakedBody(body), bakeColors(*body.model, body.material));
  }
  bodies_ = std::move(now);
}

}  // namespace meshless
