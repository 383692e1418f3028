// A solid sphere under the cursor: shown as a ghost before the tissue, solid while the left button is down.
#pragma once

#include "hand_tool.h"

#ifndef Q_MOC_RUN
#include <memory>

#include <rviz/ogre_helpers/shape.h>
#endif

namespace meshless {

class PushTool : public HandTool {
  Q_OBJECT

 public:
  PushTool();

 protected:
  bool onMouse(rviz::ViewportMouseEvent& event) override;
  void onActivate() override;
  void onDeactivate() override;
  void onUpdate(double dt) override;
  bool dragging() const override { return drag_ == Drag::kAsking || drag_ == Drag::kSolid; }
  void undoDrag() override;
  QString help() const override;
  void nodeChanged() override;

 private:
  enum class Drag {
    kNone,
    kAsking,  // the node has not yet said that the sphere is there
    kSolid,
    kOver  // locked or undone, the button still down
  };

  Ogre::Vector3 centre() const;
  void press();
  void place(double speed);
  void end();
  void lift();
  void leaveAt(const Ogre::Vector3& place);
  void move();
  void showGhost();

  Drag drag_ = Drag::kNone;
  std::uint32_t attempt_ = 0;
  bool standing_ = false;  // left in place by a right click
  Ogre::Vector3 standing_at_ = Ogre::Vector3::ZERO;
  bool placed_ = false;                              // the cursor has been over tissue, so that there is a plane
  double radius_ = 0.02;                             // [m]
  double depth_ = 0.0;                               // [m] that the wheel has moved it away
  Ogre::Vector3 plane_point_ = Ogre::Vector3::ZERO;  // the centre lies in the plane through it that faces the camera
  Ogre::Vector3 plane_normal_ = Ogre::Vector3::UNIT_X;
  Ogre::Vector3 grip_ = Ogre::Vector3::ZERO;
  ros::Publisher poses_;
  std::unique_ptr<rviz::Shape> ghost_;
};

}  // namespace meshless
