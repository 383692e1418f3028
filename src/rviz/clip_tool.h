// Clips on vessels: shows where the jaws would close, puts a clip on with a click and takes one off with Shift.
#pragma once

#include "hand_tool.h"

#ifndef Q_MOC_RUN
#include <memory>
#include <optional>
#include <vector>

#include <meshless_surgery/Surfaces.h>
#include <rviz/ogre_helpers/billboard_line.h>
#endif

namespace rviz {
class FloatProperty;
}

namespace meshless {

class ClipTool : public HandTool {
  Q_OBJECT

 public:
  ClipTool();

  void onInitialize() override;

 protected:
  bool onMouse(rviz::ViewportMouseEvent& event) override;
  void onActivate() override;
  void onDeactivate() override;
  void onUpdate(double dt) override;
  bool dragging() const override { return false; }
  void undoDrag() override {}
  QString help() const override;
  void stateCame(const meshless_surgery::State& state) override;

 private:
  /// What the jaws would close on, in the node's world frame.
  struct Jaws {
    Ogre::Vector3 middle = Ogre::Vector3::ZERO;
    Ogre::Vector3 along = Ogre::Vector3::UNIT_X;   // the vessel
    Ogre::Vector3 across = Ogre::Vector3::UNIT_Y;  // in which they close, in the picture
    Ogre::Vector3 half = Ogre::Vector3::ZERO;  // [m] of what is between them: along, across, and away from the viewer
  };
  struct Clip {
    std::string name;
    Ogre::Vector3 middle = Ogre::Vector3::ZERO;  // in the fixed frame
  };

  std::optional<Jaws> jawsUnderCursor() const;
  const Clip* clipUnderCursor() const;
  void showJaws(const std::optional<Jaws>& jaws);
  void putOn();
  void takeOff();

  bool asking_ = false;    // one clip at a time
  bool removing_ = false;  // Shift is down
  std::vector<Clip> clips_;
  rviz::FloatProperty* width_ = nullptr;
  rviz::FloatProperty* opening_ = nullptr;
  ros::Subscriber surfaces_topic_;  // while the tool is in hand
  meshless_surgery::Surfaces::ConstPtr surfaces_;
  std::unique_ptr<rviz::BillboardLine> shown_;
};

}  // namespace meshless
