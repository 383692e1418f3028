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

namespace meshless {
namespace {

constexpr float kSmoothUpTo = 0.6f;  // cosine between face and smooth normal: the edges of a box stay sharp
constexpr std::uint32_t kNoPlace = std::numeric_limits<std::uint32_t>::max();

Ogre::ColourValue toColour(const std_msgs::ColorRGBA& c) { return Ogre::ColourValue(c.r, c.g, c.b, c.a); }

Ogre::Vector3 vertexOf(const meshless_surgery::Surface& surface, std::uint32_t v) {
  return Ogre::Vector3(surface.vertices[3 * v], surface.vertices[3 * v + 1], surface.vertices[3 * v + 2]);
}

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
  material_ = Ogre::MaterialManager::getSingleton().create(name, Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME);
  material_->setReceiveShadows(false);
  Ogre::Pass* pass = material_->getTechnique(0)->getPass(0);
  pass->setLightingEnabled(true);
  pass->setVertexColourTracking(Ogre::TVC_AMBIENT | Ogre::TVC_DIFFUSE);
  pass->setSpecular(0.25f, 0.25f, 0.25f, 1.0f);  // tissue is wet
  pass->setShininess(40.0f);
  pass->setCullingMode(Ogre::CULL_NONE);  // shells are seen from both sides
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
  for (int cut = 0; cut < 2; ++cut) {
    normals_[cut].assign(vertices, Ogre::Vector3::ZERO);
    place_[cut].assign(vertices, kNoPlace);
  }
  const auto flatOf = [&](std::size_t t) {
    const std::uint32_t* corner = &surface.triangles[3 * t];
    const Ogre::Vector3 a = vertexOf(surface, corner[0]);
    return (vertexOf(surface, corner[1]) - a).crossProduct(vertexOf(surface, corner[2]) - a);
  };
  for (std::size_t t = 0; t < triangles; ++t) {
    const Ogre::Vector3 flat = flatOf(t);  // as long as the triangle is large
    for (int k = 0; k < 3; ++k) normals_[surface.cut[t] != 0][surface.triangles[3 * t + k]] += flat;
  }
  for (auto& normals : normals_)
    for (Ogre::Vector3& normal : normals) normal.normalise();

  corners_.clear();
  indices_.clear();
  indices_.reserve(3 * triangles);
  for (std::size_t t = 0; t < triangles; ++t) {
    const bool cut = surface.cut[t] != 0;
    const Ogre::Vector3 flat = flatOf(t).normalisedCopy();
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t v = surface.triangles[3 * t + k];
      const bool smooth = normals_[cut][v].dotProduct(flat) > kSmoothUpTo;
      std::uint32_t at = smooth ? place_[cut][v] : kNoPlace;
      if (at == kNoPlace) {
        at = static_cast<std::uint32_t>(corners_.size());
        corners_.push_back({v, smooth ? normals_[cut][v] : flat, cut});
        if (smooth) place_[cut][v] = at;
      }
      indices_.push_back(at);
    }
  }
}

void BodyShape::applyLook(const meshless_surgery::Surface& surface, const BodyLook& look) {
  Ogre::Pass* pass = material_->getTechnique(0)->getPass(0);
  const bool clear = look.opacity * static_cast<double>(surface.color.a) < 0.998;
  pass->setSceneBlending(clear ? Ogre::SBT_TRANSPARENT_ALPHA : Ogre::SBT_REPLACE);
  pass->setDepthWriteEnabled(!clear);
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
  const bool strained = look.by_strain && surface.strain.size() == vertices;
  Ogre::ColourValue colours[2] = {toColour(surface.color), toColour(surface.inside_color)};
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
    Ogre::ColourValue colour = colours[corner.cut];
    if (strained) {
      colour = heatColour(surface.strain[corner.vertex] / look.full_strain);
      colour.a = static_cast<float>(look.opacity);
    }
    object_->colour(colour);
  }
  for (const std::uint32_t index : indices_) object_->index(index);
  object_->end();
}

}  // namespace meshless
