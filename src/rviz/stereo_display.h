// The view for two eyes, side by side: the left half of the window is as before, the right half is seen by a second
// camera.
#pragma once

#include <rviz/display.h>

#ifndef Q_MOC_RUN
#include <OgreRenderTargetListener.h>
#endif

namespace Ogre {
class Camera;
class RenderWindow;
class SceneNode;
class Viewport;
}  // namespace Ogre
namespace rviz {
class FloatProperty;
}

namespace meshless {

class StereoDisplay : public rviz::Display, public Ogre::RenderTargetListener {
  Q_OBJECT

 public:
  StereoDisplay();
  ~StereoDisplay() override;

  void update(float wall_dt, float ros_dt) override;
  /// The second eye follows the first.
  void preRenderTargetUpdate(const Ogre::RenderTargetEvent& event) override;

 protected:
  void onEnable() override;
  void onDisable() override;

 private:
  Ogre::Viewport* leftViewport() const;

  rviz::FloatProperty* eyes_;
  rviz::FloatProperty* focus_;
  Ogre::RenderWindow* window_ = nullptr;  // while it is split
  Ogre::Viewport* right_viewport_ = nullptr;
  Ogre::Camera* right_ = nullptr;
  Ogre::SceneNode* right_node_ = nullptr;
};

}  // namespace meshless
