#include "tools_shape.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>
#include <utility>

#include <OgreManualObject.h>
#include <OgreMaterialManager.h>
#include <OgreResourceGroupManager.h>
#include <OgreSceneManager.h>
#include <OgreSceneNode.h>
#include <OgreTechnique.h>

#include "body_shape.h"
#include "ogre_convert.h"

namespace meshless {
namespace {

constexpr float kSpringWidth = 0.0015f;                   // [m]
constexpr float kFibreWidth = 0.0005f;                    // [m]
constexpr float kJawWidth = 0.0015f;                      // [m] of a line on a clip
constexpr float kSpringEnd = 0.007f;                      // [m] diameter
constexpr double kShownReach = 0.1;                       // [m] of blades without an end
constexpr double kBladeWidth = 0.12;                      // of the blade's length
constexpr float kBladeThickness = 0.012f;                 // likewise: of its back, half of it
constexpr float kShaftRadius = 0.035f;                    // likewise
constexpr float kShaftStart = -0.08f, kShaftEnd = -0.6f;  // likewise, along the blades
constexpr double kThinnest = 0.001;                       // [m] of a sphere

void addTriangle(Ogre::ManualObject* object, const Ogre::Vector3 (&corners)[3], const Ogre::Vector3& inside,
                 const Ogre::ColourValue& colour) {
  Ogre::Vector3 normal = (corners[1] - corners[0]).crossProduct(corners[2] - corners[0]).normalisedCopy();
  if (normal.dotProduct(corners[0] - inside) < 0.0f) normal = -normal;
  const auto first = static_cast<Ogre::uint32>(object->getCurrentVertexCount());
  for (const Ogre::Vector3& corner : corners) {
    object->position(corner);
    object->normal(normal);
    object->colour(colour);
  }
  object->triangle(first, first + 1, first + 2);
}

/// One blade from the pivot: sharp along the straight edge where it cuts, thick at its back.
void addBlade(Ogre::ManualObject* object, double angle, double side, double length, const Ogre::ColourValue& colour) {
  const Ogre::Quaternion turn(Ogre::Radian(static_cast<float>(angle)), Ogre::Vector3::UNIT_Z);
  const auto l = static_cast<float>(length);
  const auto w = static_cast<float>(side * kBladeWidth * length);
  const Ogre::Vector3 pivot = Ogre::Vector3::ZERO, tip = turn * Ogre::Vector3(l, 0, 0), up(0, 0, kBladeThickness * l),
                      inside = turn * Ogre::Vector3(0.3f * l, 0.4f * w, 0);
  const Ogre::Vector3 back[] = {tip, turn * Ogre::Vector3(0.65f * l, 0.6f * w, 0), turn * Ogre::Vector3(0.2f * l, w, 0),
                                turn * Ogre::Vector3(-0.12f * l, 0.5f * w, 0), pivot};
  for (std::size_t k = 0; k + 1 < std::size(back); ++k) {
    const Ogre::Vector3 from = k > 0 ? up : Ogre::Vector3::ZERO,
                        to = k + 2 < std::size(back) ? up : Ogre::Vector3::ZERO;
    for (const float face : {-1.0f, 1.0f})
      addTriangle(object, {pivot, back[k] + face * from, back[k + 1] + face * to}, inside, colour);
    addTriangle(object, {back[k] - from, back[k] + from, back[k + 1] + to}, inside, colour);
    addTriangle(object, {back[k] - from, back[k + 1] + to, back[k + 1] - to}, inside, colour);
  }
}

/// The shaft behind the pivot.
void addShaft(Ogre::ManualObject* object, double length, const Ogre::ColourValue& colour) {
  constexpr int kSides = 12;
  const auto l = static_cast<float>(length);
  const auto rim = [&](int k, float x) {
    const auto angle = static_cast<float>(2.0 * M_PI * k / kSides);
    return Ogre::Vector3(x * l, kShaftRadius * l * std::cos(angle), kShaftRadius * l * std::sin(angle));
  };
  for (int k = 0; k < kSides; ++k) {
    const auto first = static_cast<Ogre::uint32>(object->getCurrentVertexCount());
    for (const auto& [side, x] :
         {std::pair<int, float>{k, kShaftEnd}, {k, kShaftStart}, {k + 1, kShaftStart}, {k + 1, kShaftEnd}}) {
      object->position(rim(side, x));
      object->normal((rim(side, 0.0f)).normalisedCopy());
      object->colour(colour);
    }
    object->quad(first, first + 1, first + 2, first + 3);
    for (const float end : {kShaftStart, kShaftEnd})
      addTriangle(object, {Ogre::Vector3(end * l, 0, 0), rim(k, end), rim(k + 1, end)},
                  Ogre::Vector3(0.5f * (kShaftStart + kShaftEnd) * l, 0, 0), colour);
  }
}

}  // namespace

ToolsShape::ToolsShape(Ogre::SceneManager* scene_manager, Ogre::SceneNode* parent)
    : scene_manager_(scene_manager), node_(parent->createChildSceneNode()) {
  static int count = 0;
  const std::string name = "meshless_scissors_" + std::to_string(count++);
  springs_ = std::make_unique<rviz::BillboardLine>(scene_manager_, node_);
  springs_->setLineWidth(kSpringWidth);
  fibres_ = std::make_unique<rviz::BillboardLine>(scene_manager_, node_);
  fibres_->setLineWidth(kFibreWidth);
  clips_ = std::make_unique<rviz::BillboardLine>(scene_manager_, node_);
  clips_->setLineWidth(kJawWidth);
  push_ = std::make_unique<rviz::Shape>(rviz::Shape::Sphere, scene_manager_, node_);
  push_->getRootNode()->setVisible(false);
  scissors_material_ =
      Ogre::MaterialManager::getSingleton().create(name, Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME);
  Ogre::Pass* pass = scissors_material_->getTechnique(0)->getPass(0);
  pass->setCullingMode(Ogre::CULL_NONE);
  pass->setVertexColourTracking(Ogre::TVC_AMBIENT | Ogre::TVC_DIFFUSE);
  pass->setSelfIllumination(0.22f, 0.23f, 0.25f);
  pass->setSpecular(0.8f, 0.8f, 0.8f, 1.0f);  // steel
  pass->setShininess(50.0f);
  scissors_ = scene_manager_->createManualObject(name);
  scissors_->setDynamic(true);
  node_->createChildSceneNode()->attachObject(scissors_);
}

ToolsShape::~ToolsShape() {
  Ogre::SceneNode* scissors_node = scissors_->getParentSceneNode();
  scene_manager_->destroyManualObject(scissors_);
  scene_manager_->destroySceneNode(scissors_node);
  Ogre::MaterialManager::getSingleton().remove(scissors_material_);
  springs_.reset();
  fibres_.reset();
  clips_.reset();
  ends_.clear();
  push_.reset();
  scene_manager_->destroySceneNode(node_);
}

void ToolsShape::show(const meshless_surgery::Surfaces& surfaces, double full_force) {
  showSprings(surfaces.picks, full_force);
  push_->getRootNode()->setVisible(surfaces.push_shown);
  if (surfaces.push_shown) {
    push_->setPosition(toOgre(surfaces.push_position));
    push_->setScale(Ogre::Vector3(static_cast<float>(2.0 * std::max(surfaces.push_radius, kThinnest))));
    surfaces.push_touching ? push_->setColor(0.95f, 0.75f, 0.3f, 0.85f) : push_->setColor(0.7f, 0.75f, 0.8f, 0.85f);
  }
  showScissors(surfaces);
  showLines(*fibres_, surfaces.fibres, Ogre::ColourValue(0.95f, 0.9f, 0.75f));
  showLines(*clips_, surfaces.clips, Ogre::ColourValue(0.78f, 0.82f, 0.88f));
}

void ToolsShape::showLines(rviz::BillboardLine& shape, const std::vector<geometry_msgs::Point>& ends,
                           const Ogre::ColourValue& color) {
  shape.clear();
  const std::size_t lines = ends.size() / 2;
  shape.setNumLines(std::max<std::uint32_t>(1, static_cast<std::uint32_t>(lines)));
  shape.setMaxPointsPerLine(2);
  for (std::size_t i = 0; i < lines; ++i) {
    if (i > 0) shape.newLine();
    for (std::size_t k = 2 * i; k < 2 * i + 2; ++k) shape.addPoint(toOgre(ends[k]), color);
  }
}

void ToolsShape::showSprings(const std::vector<meshless_surgery::PickState>& picks, double full_force) {
  springs_->clear();
  springs_->setNumLines(std::max<std::uint32_t>(1, static_cast<std::uint32_t>(picks.size())));
  springs_->setMaxPointsPerLine(2);
  while (ends_.size() < picks.size())
    ends_.push_back(std::make_unique<rviz::Shape>(rviz::Shape::Sphere, scene_manager_, node_));
  ends_.resize(picks.size());
  for (std::size_t i = 0; i < picks.size(); ++i) {
    const auto& pick = picks[i];
    if (i > 0) springs_->newLine();
    const double force =
        std::sqrt(pick.force.x * pick.force.x + pick.force.y * pick.force.y + pick.force.z * pick.force.z);
    const Ogre::ColourValue colour = heatColour(0.5 + 0.5 * std::min(1.0, force / full_force));
    springs_->addPoint(toOgre(pick.position), colour);
    springs_->addPoint(toOgre(pick.target), colour);
    ends_[i]->setPosition(toOgre(pick.target));
    ends_[i]->setScale(Ogre::Vector3(kSpringEnd));
    pick.locked ? ends_[i]->setColor(1.0f, 0.8f, 0.1f, 1.0f) : ends_[i]->setColor(0.2f, 0.9f, 0.3f, 1.0f);
  }
}

void ToolsShape::showScissors(const meshless_surgery::Surfaces& surfaces) {
  Ogre::SceneNode* node = scissors_->getParentSceneNode();
  node->setVisible(surfaces.scissors_shown);
  if (!surfaces.scissors_shown) return;
  node->setPosition(toOgre(surfaces.scissors.position));
  node->setOrientation(toOgre(surfaces.scissors.orientation));
  const double length = surfaces.scissors_length > 0.0 ? surfaces.scissors_length : kShownReach;
  const double half = 0.5 * std::max(0.0, surfaces.scissors_angle);
  if (!begun_) {
    begun_ = true;
    scissors_->begin(scissors_material_->getName(), Ogre::RenderOperation::OT_TRIANGLE_LIST,
                     Ogre::ResourceGroupManager::DEFAULT_RESOURCE_GROUP_NAME);
  } else {
    scissors_->beginUpdate(0);
  }
  addBlade(scissors_, half, 1.0, length, Ogre::ColourValue(0.75f, 0.78f, 0.82f));
  addBlade(scissors_, -half, -1.0, length, Ogre::ColourValue(0.62f, 0.66f, 0.72f));
  addShaft(scissors_, length, Ogre::ColourValue(0.30f, 0.32f, 0.36f));
  scissors_->end();
}

}  // namespace meshless
