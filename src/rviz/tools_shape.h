// Springs, the push sphere, attachments and instruments.
#pragma once

#include <memory>
#include <vector>

#include <meshless_surgery/Surfaces.h>
#include <rviz/ogre_helpers/billboard_line.h>
#include <rviz/ogre_helpers/shape.h>

#include "instruments_shape.h"

namespace meshless {

class ToolsShape {
 public:
  ToolsShape(Ogre::SceneManager* scene_manager, Ogre::SceneNode* parent);
  ~ToolsShape();
  ToolsShape(const ToolsShape&) = delete;
  ToolsShape& operator=(const ToolsShape&) = delete;

  /// Springs are green without a force, red from `full_force` [N] on.
  void show(const meshless_surgery::Surfaces& surfaces, double full_force);

 private:
  void showSprings(const std::vector<meshless_surgery::PickState>& picks, double full_force);
  static void showLines(rviz::BillboardLine& shape, const std::vector<geometry_msgs::Point>& ends,
                        const Ogre::ColourValue& color);

  Ogre::SceneManager* scene_manager_;
  Ogre::SceneNode* node_;
  std::unique_ptr<rviz::BillboardLine> springs_, fibres_, clips_;
  std::vector<std::unique_ptr<rviz::Shape>> ends_;
  std::unique_ptr<rviz::Shape> push_;
  InstrumentsShape instruments_;
};

}  // namespace meshless
