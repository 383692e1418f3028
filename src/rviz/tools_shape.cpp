#include "tools_shape.h"

#include <algorithm>
#include <cmath>

#include <OgreSceneManager.h>
#include <OgreSceneNode.h>

#include "body_shape.h"
#include "ogre_convert.h"

namespace meshless {
namespace {

constexpr float kSpringWidth = 0.0015f;  // [m]
constexpr float kFibreWidth = 0.0005f;   // [m]
constexpr float kJawWidth = 0.0015f;     // [m] of a line on a clip
constexpr float kSpringEnd = 0.007f;     // [m] diameter
constexpr double kThinnest = 0.001;      // [m] of a sphere

}  // namespace

ToolsShape::ToolsShape(Ogre::SceneManager* scene_manager, Ogre::SceneNode* parent)
    : scene_manager_(scene_manager), node_(parent->createChildSceneNode()), instruments_(scene_manager, parent) {
  springs_ = std::make_unique<rviz::BillboardLine>(scene_manager_, node_);
  springs_->setLineWidth(kSpringWidth);
  fibres_ = std::make_unique<rviz::BillboardLine>(scene_manager_, node_);
  fibres_->setLineWidth(kFibreWidth);
  clips_ = std::make_unique<rviz::BillboardLine>(scene_manager_, node_);
  clips_->setLineWidth(kJawWidth);
  push_ = std::make_unique<rviz::Shape>(rviz::Shape::Sphere, scene_manager_, node_);
  push_->getRootNode()->setVisible(false);
}

ToolsShape::~ToolsShape() {
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
  instruments_.show(surfaces.instruments);
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

}  // namespace meshless
