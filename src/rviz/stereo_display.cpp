#include "stereo_display.h"

#include <OgreCamera.h>
#include <OgreRenderWindow.h>
#include <OgreSceneManager.h>
#include <OgreSceneNode.h>
#include <OgreViewport.h>
#include <rviz/display_context.h>
#include <rviz/properties/float_property.h>
#include <rviz/render_panel.h>
#include <rviz/view_manager.h>
#include <pluginlib/class_list_macros.hpp>

namespace meshless {
namespace {

constexpr int kOverTheFirst = 1;  // order of the second viewport

void keepShape(Ogre::Viewport* viewport) {
  viewport->getCamera()->setAspectRatio(static_cast<float>(viewport->getActualWidth()) /
                                        static_cast<float>(viewport->getActualHeight()));
}

}  // namespace

StereoDisplay::StereoDisplay() {
  eyes_ = new rviz::FloatProperty("Eye distance", 0.008f, "[m] between the cameras of both eyes.", this);
  eyes_->setMin(0.0f);
  eyes_->setMax(1.0f);
  focus_ = new rviz::FloatProperty("Focal distance", 0.3f,
                                   "[m] from the cameras: what is there is at the same place for both eyes.", this);
  focus_->setMin(0.001f);
}

StereoDisplay::~StereoDisplay() { onDisable(); }

Ogre::Viewport* StereoDisplay::leftViewport() const {
  return context_->getViewManager()->getRenderPanel()->getViewport();
}

void StereoDisplay::onEnable() {
  static int count = 0;
  window_ = context_->getViewManager()->getRenderPanel()->getRenderWindow();
  right_ = scene_manager_->createCamera("meshless_right_eye_" + std::to_string(count++));
  right_node_ = scene_manager_->getRootSceneNode()->createChildSceneNode();
  right_node_->attachObject(right_);
  Ogre::Viewport* left = leftViewport();
  left->setDimensions(0.0f, 0.0f, 0.5f, 1.0f);
  right_viewport_ = window_->addViewport(right_, kOverTheFirst, 0.5f, 0.0f, 0.5f, 1.0f);
  right_viewport_->setOverlaysEnabled(false);
  right_viewport_->setVisibilityMask(left->getVisibilityMask());
  window_->addListener(this);
}

void StereoDisplay::onDisable() {
  if (!window_) return;
  window_->removeListener(this);
  window_->removeViewport(kOverTheFirst);
  leftViewport()->setDimensions(0.0f, 0.0f, 1.0f, 1.0f);
  keepShape(leftViewport());
  right_node_->detachObject(right_);
  scene_manager_->destroyCamera(right_);
  scene_manager_->destroySceneNode(right_node_);
  window_ = nullptr;
}

void StereoDisplay::update(float, float) { context_->queueRender(); }

void StereoDisplay::preRenderTargetUpdate(const Ogre::RenderTargetEvent&) {
  Ogre::Viewport* viewport = leftViewport();
  const Ogre::Camera* left = viewport->getCamera();
  keepShape(viewport);
  right_->setProjectionType(left->getProjectionType());
  right_->setNearClipDistance(left->getNearClipDistance());
  right_->setFarClipDistance(left->getFarClipDistance());
  right_->setFOVy(left->getFOVy());
  keepShape(right_viewport_);
  right_viewport_->setBackgroundColour(viewport->getBackgroundColour());
  const float eyes = eyes_->getFloat();
  right_node_->setOrientation(left->getDerivedOrientation());
  right_node_->setPosition(left->getDerivedPosition() + eyes * left->getDerivedRight());
  // Both look through the same window, which is at the focal distance.
  right_->setFocalLength(focus_->getFloat());
  right_->setFrustumOffset(-eyes, 0.0f);
}

}  // namespace meshless

PLUGINLIB_EXPORT_CLASS(meshless::StereoDisplay, rviz::Display)
