// Grabs tissue under the cursor with a spring and pulls it in a plane that faces the camera.
#pragma once

#include "hand_tool.h"

#ifndef Q_MOC_RUN
#include <memory>
#include <vector>

#include <meshless_surgery/PickState.h>
#include <rviz/ogre_helpers/shape.h>

#include "instruments_shape.h"
#endif

namespace meshless {

class PickTool : public HandTool {
  Q_OBJECT

 public:
  PickTool();

 protected:
  bool onMouse(rviz::ViewportMouseEvent& event) override;
  void onDeactivate() override;
  void onUpdate(double dt) override;
  bool dragging() const override { return drag_ == Drag::kAsking || drag_ == Drag::kHolding; }
  void undoDrag() override;
  QString help() const override;
  void nodeChanged() override;
  void stateCame(const meshless_surgery::State& state) override;

 private:
  enum class Drag {
    kNone,
    kAsking,   // the node looks for tissue under the ray
    kHolding,  // the cursor moves the spring's free end
    kCamera,   // no tissue there: the drag turns the view
    kOver      // locked or undone, the button still down
  };
  struct Locked {
    std::uint32_t pick_id = 0;
    Ogre::Vector3 target = Ogre::Vector3::ZERO;
  };

  void grab();
  void pressCamera(const rviz::ViewportMouseEvent& event);
  void takeUp(const Locked& locked);
  void hold(std::uint32_t pick_id, const Ogre::Vector3& point);
  void move();
  void lock(const Ogre::Vector3& target);
  void release(std::uint32_t pick_id);
  void letGo();
  void end();
  const Locked* lockedUnderCursor() const;

  Drag drag_ = Drag::kNone;
  std::uint32_t attempt_ = 0;  // answers to older ones are let go of
  std::uint32_t pick_id_ = 0;
  ros::Time held_since_;
  bool camera_pressed_ = false;
  bool taken_up_ = false;  // was locked before
  Ogre::Vector3 plane_point_ = Ogre::Vector3::ZERO;
  Ogre::Vector3 plane_normal_ = Ogre::Vector3::UNIT_X;  // away from the camera
  Ogre::Vector3 grip_ = Ogre::Vector3::ZERO;            // from the cursor's point to the free end
  Ogre::Vector3 start_ = Ogre::Vector3::ZERO;           // of the free end
  Ogre::Vector3 target_ = Ogre::Vector3::ZERO;
  std::vector<Locked> locked_;
  ros::Publisher poses_;
  std::unique_ptr<rviz::Shape> sphere_;
  std::unique_ptr<InstrumentsShape> grasper_;  // over tissue that it could grab
};

}  // namespace meshless
