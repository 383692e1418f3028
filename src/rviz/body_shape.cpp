#include "body_shape.h"

#include <algorithm>
#include <limits>
#include <string>

#include <OgreManualObject.h>
#include <OgreMaterialManager.h>
#include <OgreResourceGroupManager.h>
#include <OgreSceneManager.h>
#include <OgreSceneNode.h>
#include <OgreTechnique.h>

#include "ogre_convert.h"

namespace meshless {
namespace {

constexpr float kSmoothUpTo = 0.8f;  // cosine between faces that share a normal: the edges of a box stay sharp
constexpr float kSelfLight =
    0.25f;                      // share of the colour that is there without a light: rviz has a lamp and no daylight
constexpr float kLamp = 0.85f;  // share of the colour that the lamp adds
constexpr double kSeenThrough = 0.6;  // opacity up to which what is inside of a body shows, whatever is drawn first
constexpr std::uint32_t kNoPlace = std::numeric_limits<std::uint32_t>::max();

Ogre::ColourValue toColour(const std_msgs::ColorRGBA& c) { return Ogre::ColourValue(c.r, c.g, c.b, c.a); }

}  // namespace

Ogre::ColourValue heatColour(double share) {
  const auto s = static_cast<float>(std::clamp(share, 0.0, 1.0));
  if (s < 0.5f) return Ogre::ColourValue(0.15f, 0.25f + 1.1f * s, 0.85f - 1.4f * s);
  return Ogre::ColourValue(0.15f + 1.5f * (s - 0.5f), 0.8f - 1.4f * (s - 0.5f), 0.15f);
}

BodyShape::BodyShape(Ogre::SceneManager* scene_manager, Ogre::SceneNode* parent)
    : scene_manager_(scene_manager), node_(parent->createChildSceneNode()) {
  static int count = 0;
  const std::string name = "meshless_body_" + std::to_string(count++);
  material_ =
      Ogre::MaterialManager::getSingleton().create(name, Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME);
  material_->setReceiveShadows(false);
  Ogre::Pass* pass = material_->getTechnique(0)->getPass(0);
  pass->setLightingEnabled(true);
  pass->setVertexColourTracking(Ogre::TVC_AMBIENT | Ogre::TVC_DIFFUSE);
  pass->setSpecular(0.25f, 0.25f, 0.25f, 1.0f);  // tissue is wet
  pass->setShininess(40.0f);
  object_ = scene_manager_->createManualObject(name);
  object_->setDynamic(true);
  node_->attachObject(object_);
}

BodyShape::~BodyShape() {
  scene_manager_->destroyManualObject(object_);
  scene_manager_->destroySceneNode(node_);
  Ogre::MaterialManager::getSingleton().remove(material_);
}

void BodyShape::findCorners(const meshless_surgery::Surface& surface) {
  const std::size_t vertices = surface.vertices.size() / 3;
  const std::size_t triangles = surface.cut.size();
  faces_.resize(triangles);
  starts_.assign(vertices + 1, 0);
  for (int cut = 0; cut < 2; ++cut) {
    normals_[cut].assign(vertices, Ogre::Vector3::ZERO);
    place_[cut].assign(vertices, kNoPlace);
  }
  for (std::size_t t = 0; t < triangles; ++t) {
    const std::uint32_t* corner = &surface.triangles[3 * t];
    const Ogre::Vector3 a = vertexOf(surface, corner[0]);
    faces_[t] = (vertexOf(surface, corner[1]) - a).crossProduct(vertexOf(surface, corner[2]) - a);  // by its area
    for (int k = 0; k < 3; ++k) {
      normals_[surface.cut[t] != 0][corner[k]] += faces_[t];
      ++starts_[corner[k] + 1];
    }
  }
  for (auto& normals : normals_)
    for (Ogre::Vector3& normal : normals) normal.normalise();
  for (std::size_t v = 0; v < vertices; ++v) starts_[v + 1] += starts_[v];
  around_.resize(3 * triangles);
  next_.assign(starts_.begin(), starts_.end() - 1);
  for (std::size_t c = 0; c < 3 * triangles; ++c)
    around_[next_[surface.triangles[c]]++] = static_cast<std::uint32_t>(c / 3);

  corners_.clear();
  indices_.clear();
  indices_.reserve(3 * triangles);
  for (std::size_t t = 0; t < triangles; ++t) {
    const bool cut = surface.cut[t] != 0;
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t v = surface.triangles[3 * t + k];
      std::uint32_t at = place_[cut][v];
      if (at == kNoPlace) {
        at = static_cast<std::uint32_t>(corners_.size());
        if (isSmooth(surface, v, cut)) {
          corners_.push_back({v, normals_[cut][v], cut});
          place_[cut][v] = at;
        } else {
          corners_.push_back({v, creasedNormal(surface, t, v), cut});
        }
      }
      indices_.push_back(at);
    }
  }
}

bool BodyShape::isSmooth(const meshless_surgery::Surface& surface, std::uint32_t v, bool cut) const {
  for (std::uint32_t i = starts_[v]; i < starts_[v + 1]; ++i) {
    const std::uint32_t t = around_[i];
    if ((surface.cut[t] != 0) == cut && faces_[t].dotProduct(normals_[cut][v]) < kSmoothUpTo * faces_[t].length())
      return false;
  }
  return true;
}

Ogre::Vector3 BodyShape::creasedNormal(const meshless_surgery::Surface& surface, std::size_t t, std::uint32_t v) const {
  Ogre::Vector3 normal = faces_[t];
  for (std::uint32_t i = starts_[v]; i < starts_[v + 1]; ++i) {
    const std::uint32_t other = around_[i];
    if (other == t || (surface.cut[other] != 0) != (surface.cut[t] != 0)) continue;
    if (faces_[other].dotProduct(faces_[t]) > kSmoothUpTo * faces_[other].length() * faces_[t].length())
      normal += faces_[other];
  }
  return normal.normalisedCopy();
}

void BodyShape::applyLook(const meshless_surgery::Surface& surface, const BodyLook& look) {
  Ogre::Pass* pass = material_->getTechnique(0)->getPass(0);
  const double opacity = look.opacity * static_cast<double>(surface.color.a);
  const bool clear = opacity < 0.998;
  pass->setSceneBlending(clear ? Ogre::SBT_TRANSPARENT_ALPHA : Ogre::SBT_REPLACE);
  pass->setDepthWriteEnabled(opacity > kSeenThrough);
  // Through clear tissue what is behind it shows, not its own back side: that would be drawn in any order.
  // Otherwise shells are seen from both sides.
  pass->setCullingMode(clear ? Ogre::CULL_CLOCKWISE : Ogre::CULL_NONE);
  pass->setSelfIllumination(look.by_strain ? Ogre::ColourValue(0.12f, 0.12f, 0.12f)
                                           : toColour(surface.color) * kSelfLight);
  pass->setPolygonMode(look.wire ? Ogre::PM_WIREFRAME : Ogre::PM_SOLID);
}

void BodyShape::show(const meshless_surgery::Surface& surface, const BodyLook& look) {
  const std::size_t vertices = surface.vertices.size() / 3;
  const bool whole = 3 * surface.cut.size() == surface.triangles.size() &&
                     std::all_of(surface.triangles.begin(), surface.triangles.end(),
                                 [vertices](std::uint32_t v) { return v < vertices; });
  node_->setVisible(whole && !surface.triangles.empty());
  if (!whole || surface.triangles.empty()) return;
  findCorners(surface);
  applyLook(surface, look);
  const bool regional = surface.regions.size() == vertices &&
                        std::all_of(surface.regions.begin(), surface.regions.end(),
                                    [&](std::uint8_t region) { return region <= surface.region_colors.size(); });
  const bool strained = look.by_strain && surface.strain.size() == vertices;
  std::vector<Ogre::ColourValue> colours{toColour(surface.color), toColour(surface.inside_color)};
  for (const auto& colour : surface.region_colors) colours.push_back(toColour(colour));
  for (Ogre::ColourValue& colour : colours) colour.a *= static_cast<float>(look.opacity);

  object_->estimateVertexCount(corners_.size());
  object_->estimateIndexCount(indices_.size());
  if (!begun_) {
    begun_ = true;
    object_->begin(material_->getName(), Ogre::RenderOperation::OT_TRIANGLE_LIST,
                   Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME);
  } else {
    object_->beginUpdate(0);
  }
  for (const Corner& corner : corners_) {
    object_->position(vertexOf(surface, corner.vertex));
    object_->normal(corner.normal);
    const std::size_t region = corner.cut && regional ? surface.regions[corner.vertex] : 0;
    Ogre::ColourValue colour = colours[region > 0 ? 1 + region : corner.cut];
    if (strained) {
      colour = heatColour(surface.strain[corner.vertex] / look.full_strain);
      colour.a = static_cast<float>(look.opacity);
    }
    const Ogre::ColourValue lit = colour * kLamp;
    object_->colour(lit.r, lit.g, lit.b, colour.a);
  }
  for (const std::uint32_t index : indices_) object_->index(index);
  object_->end();
}

}  // namespace meshless
