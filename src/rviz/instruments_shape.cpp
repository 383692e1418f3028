#include "instruments_shape.h"

#include <OgreEntity.h>
#include <OgreMaterialManager.h>
#include <OgreResourceGroupManager.h>
#include <OgreSceneManager.h>
#include <OgreSceneNode.h>
#include <OgreTechnique.h>
#include <rviz/mesh_loader.h>

#include "ogre_convert.h"

namespace meshless {
namespace {

constexpr float kToGrip = 0.015f;  // [m] from the joint of a grasper to what its jaws hold

meshless_surgery::InstrumentPart partOf(const std::string& mesh, const Ogre::Vector3& position,
                                        const Ogre::Quaternion& turn, float grey) {
  meshless_surgery::InstrumentPart part;
  part.mesh = "package://meshless_surgery/media/instruments/" + mesh + ".obj";
  part.pose.position = toPoint(position);
  part.pose.orientation = toQuaternion(turn);
  part.scale = 1.0;
  part.color.r = part.color.g = part.color.b = grey;
  part.color.a = 1.0f;
  return part;
}

}  // namespace

InstrumentsShape::InstrumentsShape(Ogre::SceneManager* scene_manager, Ogre::SceneNode* parent)
    : scene_manager_(scene_manager), node_(parent->createChildSceneNode()) {}

InstrumentsShape::~InstrumentsShape() {
  for (Shown& shown : parts_) clear(shown);
  scene_manager_->destroySceneNode(node_);
}

void InstrumentsShape::clear(Shown& shown) {
  if (shown.entity) {
    scene_manager_->destroyEntity(shown.entity);
    Ogre::MaterialManager::getSingleton().remove(shown.steel);
  }
  if (shown.node) scene_manager_->destroySceneNode(shown.node);
  shown = Shown();
}

void InstrumentsShape::load(Shown& shown, const std::string& mesh) {
  clear(shown);
  shown.mesh = mesh;
  if (!rviz::loadMeshFromResource(mesh)) return;
  static int count = 0;
  const std::string name = "meshless_instrument_" + std::to_string(count++);
  shown.steel =
      Ogre::MaterialManager::getSingleton().create(name, Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME);
  shown.entity = scene_manager_->createEntity(name, mesh);
  shown.entity->setMaterial(shown.steel);
  shown.node = node_->createChildSceneNode();
  shown.node->attachObject(shown.entity);
}

void InstrumentsShape::show(const std::vector<meshless_surgery::InstrumentPart>& parts) {
  while (parts_.size() > parts.size()) {
    clear(parts_.back());
    parts_.pop_back();
  }
  parts_.resize(parts.size());
  for (std::size_t k = 0; k < parts.size(); ++k) {
    Shown& shown = parts_[k];
    if (shown.mesh != parts[k].mesh) load(shown, parts[k].mesh);
    if (!shown.entity) continue;
    shown.node->setPosition(toOgre(parts[k].pose.position));
    shown.node->setOrientation(toOgre(parts[k].pose.orientation));
    shown.node->setScale(Ogre::Vector3(static_cast<float>(parts[k].scale)));
    const Ogre::ColourValue colour(parts[k].color.r, parts[k].color.g, parts[k].color.b);
    Ogre::Pass* pass = shown.steel->getTechnique(0)->getPass(0);
    pass->setAmbient(0.4f * colour);
    pass->setDiffuse(colour);
    pass->setSelfIllumination(0.25f * colour);
    pass->setSpecular(0.8f, 0.8f, 0.8f, 1.0f);
    pass->setShininess(50.0f);
  }
}

std::vector<meshless_surgery::InstrumentPart> grasperParts(const Ogre::Vector3& grip, const Ogre::Quaternion& turn,
                                                           float angle) {
  const Ogre::Vector3 joint = grip - turn * (kToGrip * Ogre::Vector3::UNIT_X);
  const auto by = [&](float open) { return turn * Ogre::Quaternion(Ogre::Radian(open), Ogre::Vector3::UNIT_Z); };
  const Ogre::Quaternion other(Ogre::Radian(Ogre::Math::PI), Ogre::Vector3::UNIT_X);
  return {partOf("shaft", joint, turn, 0.32f), partOf("grasping_jaw", joint, by(0.5f * angle), 0.78f),
          partOf("grasping_jaw", joint, by(-0.5f * angle) * other, 0.78f)};
}

std::vector<meshless_surgery::InstrumentPart> scalpelParts(const Ogre::Vector3& tip, const Ogre::Quaternion& turn) {
  return {partOf("scalpel", tip, turn, 0.78f)};
}

}  // namespace meshless
