#include "meshless_surgery/world/baked_colors.h"

#include <algorithm>

#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace {

bool sameColor(const Color& one, const Color& other) {
  return one.r == other.r && one.g == other.g && one.b == other.b && one.a == other.a;
}

// At rest in the body's own frame, of the faces of cuts or of the others; empty where no look asks for them.
Points normalsOf(const BodyModel& model, bool of_cuts, bool needed) {
  if (!needed) return {};
  TriangleMesh faces;
  for (const Vec3& v : model.surface.vertices) faces.vertices.push_back(model.own * v);
  for (std::size_t t = 0; t < model.surface.triangles.size(); ++t)
    if (isCutPatch(model.surface.patchOf(t)) == of_cuts) faces.triangles.push_back(model.surface.triangles[t]);
  return vertexNormals(faces);
}

std::vector<TexturePoint> textureOf(const BodyModel& model) {
  std::vector<TexturePoint> points;
  points.reserve(3 * model.surface.triangles.size());
  for (std::size_t t = 0; t < model.surface.triangles.size(); ++t) {
    std::array<TexturePoint, 3> corners{};
    const Triangle& v = model.surface.triangles[t];
    const auto place = [&](int k) { return model.own * model.surface.vertices[v[k]]; };
    if (!isCutPatch(model.surface.patchOf(t))) corners = model.texture->of({place(0), place(1), place(2)});
    points.insert(points.end(), corners.begin(), corners.end());
  }
  return points;
}

}  // namespace

VertexColors bakeColors(const BodyModel& model, const Material& material) {
  const Points& rest = model.surface.vertices;
  const std::vector<std::uint32_t>& patches = model.surface.patches;
  VertexColors colors;
  if (const Look& look = material.appearance.outer; look.image && model.texture) {
    colors.texture = textureOf(model);
    colors.outer.assign(rest.size(), material.color);
    for (std::size_t c = 0; c < colors.texture.size(); ++c)
      if (!isCutPatch(model.surface.patchOf(c / 3)))
        colors.outer[model.surface.triangles[c / 3][c % 3]] = colorAt(look, material.color, colors.texture[c]);
  } else if (look.noise != Noise::kPlain) {
    const Points normals = normalsOf(model, false, look.image != nullptr);
    colors.outer.reserve(rest.size());
    for (std::size_t v = 0; v < rest.size(); ++v)
      colors.outer.push_back(
          colorAt(look, material.color, model.own * rest[v], normals.empty() ? Vec3(Vec3::Zero()) : normals[v]));
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
  const Points normals = normalsOf(model, true, std::any_of(inside.begin(), inside.end(), [](const auto& look) {
                                     return look.first->image != nullptr;
                                   }));
  colors.inside.assign(rest.size(), Color{0.0f, 0.0f, 0.0f, 1.0f});
  for (std::size_t v = 0; v < rest.size(); ++v)
    if (on_cut[v]) {
      const auto& [look, base] = inside[regions[v]];
      colors.inside[v] = colorAt(*look, *base, model.own * rest[v], normals.empty() ? Vec3(Vec3::Zero()) : normals[v]);
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
