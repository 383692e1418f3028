#include "push_tool.h"

#include <algorithm>
#include <cmath>

#include <OgreSceneManager.h>
#include <OgreSceneNode.h>
#include <meshless_surgery/Push.h>
#include <pluginlib/class_list_macros.hpp>

#include "ogre_convert.h"

namespace meshless {
namespace {

constexpr double kRadiusFactor = 1.15;  // a notch
constexpr double kSmallest = 0.002;     // [m]
constexpr double kLargest = 0.2;        // [m]
constexpr double kLeastFacing = 0.3;    // cosine between the tissue's normal and the view
constexpr double kSpeed = 1.0;          // [m/s] where its size changes while it is solid

}  // namespace

PushTool::PushTool() : HandTool('h') {}

void PushTool::nodeChanged() {
  poses_ = link().handle().advertise<geometry_msgs::PoseStamped>(link().nameOf("push/servo_cp"), 10);
}

void PushTool::onActivate() {
  placed_ = false;
  depth_ = 0.0;
  ghost_ = std::make_unique<rviz::Shape>(rviz::Shape::Sphere, scene_manager_);
  ghost_->setColor(0.7f, 0.78f, 0.9f, 0.45f);
  ghost_->getRootNode()->setVisible(false);
}

void PushTool::onDeactivate() {
  if (dragging()) lift();
  drag_ = Drag::kNone;
  ghost_.reset();
}

Ogre::Vector3 PushTool::centre() const { return onPlane(plane_normal_, plane_point_) + grip_; }

bool PushTool::onMouse(rviz::ViewportMouseEvent& event) {
  const double notches = event.wheel_delta / kNotch;
  if (notches != 0.0 && event.control()) {
    radius_ = std::clamp(radius_ * std::pow(kRadiusFactor, notches), kSmallest, kLargest);
    if (drag_ == Drag::kSolid) place(kSpeed);
  } else if (notches != 0.0) {
    depth_ += notches * kWheelStep;
    plane_point_ += plane_normal_ * (notches * kWheelStep);
    if (drag_ == Drag::kSolid) move();
  }
  const bool wheel = event.wheel_delta != 0;
  switch (drag_) {
    case Drag::kNone:
      if (event.leftDown() && (placed_ || standing_)) {
        press();
        return true;
      }
      showGhost();
      return wheel;
    case Drag::kAsking:
    case Drag::kSolid:
      if (event.rightDown() && drag_ == Drag::kSolid) {
        leaveAt(centre());
        say("the sphere stays here");
      } else if (event.leftUp() || !event.left()) {
        lift();
        drag_ = event.right() ? Drag::kOver : Drag::kNone;
      } else if (drag_ == Drag::kSolid) {
        move();
      }
      return true;
    case Drag::kOver:
      if (!event.left() && !event.right()) drag_ = Drag::kNone;
      return true;
  }
  return true;
}

void PushTool::press() {
  plane_normal_ = viewDirection();
  grip_ = Ogre::Vector3::ZERO;
  double speed = 0.0;
  if (standing_ && ray().intersects(Ogre::Sphere(standing_at_, radius_)).first) {
    plane_point_ = standing_at_;
    grip_ = standing_at_ - onPlane(plane_normal_, standing_at_);
    speed = kSpeed;
  } else {
    standing_ = false;
  }
  drag_ = Drag::kAsking;
  ++attempt_;
  if (ghost_) ghost_->getRootNode()->setVisible(false);  // the solid one is shown by the node
  place(speed);
}

void PushTool::place(double speed) {
  const std::uint32_t attempt = attempt_;
  meshless_surgery::Push wish;
  wish.request.enable = true;
  wish.request.radius = radius_;
  wish.request.speed = speed;
  wish.request.pose = poseMessage(centre());
  link().call("push", wish, [this, attempt](const meshless_surgery::Push::Response& answer) {
    if (attempt != attempt_ || !dragging()) return;
    if (!answer.success) {
      end();
      say(QString::fromStdString(answer.message));
    } else if (drag_ == Drag::kAsking) {
      drag_ = Drag::kSolid;  // only now: a stream alone would bring a sphere of the node's default size
      move();
    }
  });
}

void PushTool::end() {
  ++attempt_;
  drag_ = Drag::kOver;
  stream().hush();
}

void PushTool::lift() {
  end();
  standing_ = false;
  meshless_surgery::Push wish;
  wish.request.enable = false;
  link().call("push", wish, {}, kAfterStream);
}

void PushTool::leaveAt(const Ogre::Vector3& place) {
  end();
  standing_ = true;
  standing_at_ = place;
  // By the service: what a stream has placed goes with its silence.
  meshless_surgery::Push wish;
  wish.request.enable = true;
  wish.request.radius = radius_;
  wish.request.speed = kSpeed;
  wish.request.pose = poseMessage(place);
  link().call("push", wish, {}, kAfterStream);
}

void PushTool::move() {
  stream().say([poses = poses_, pose = poseMessage(centre(), instrumentTurn())] { poses.publish(pose); });
}

void PushTool::onUpdate(double) {
  if (drag_ == Drag::kNone) showGhost();
}

void PushTool::showGhost() {
  if (!ghost_) return;
  if (seen() && hover().over) {
    // In front of the tissue, touching it where that is even; at its rim not farther than a few radii.
    placed_ = true;
    plane_normal_ = viewDirection();
    const double facing = std::max(kLeastFacing, -static_cast<double>(hover().normal.dotProduct(plane_normal_)));
    plane_point_ = hover().position + plane_normal_ * (depth_ - radius_ / facing);
  }
  grip_ = Ogre::Vector3::ZERO;
  ghost_->getRootNode()->setVisible(placed_ && seen());
  ghost_->setScale(Ogre::Vector3(2.0 * radius_));
  ghost_->setPosition(centre());
}

void PushTool::undoDrag() {
  if (standing_) {
    leaveAt(standing_at_);
    say("undone: the sphere is where it was");
    return;
  }
  lift();
  say("undone: the sphere is lifted off");
}

QString PushTool::help() const {
  const QString size = QString::number(1e3 * radius_, 'f', 1) + " mm";
  if (dragging())
    return "<b>Move:</b> push in the plane of the view.  <b>Wheel:</b> away, towards.  <b>Ctrl+wheel:</b> radius (" +
           size + ").  <b>Release left:</b> lift off.  <b>Right:</b> leave it here.  <b>Esc:</b> undo.";
  return "<b>Left drag:</b> push.  <b>Wheel:</b> away, towards.  <b>Ctrl+wheel:</b> radius (" + size +
         ").  <b>Middle, right:</b> view.  <b>R:</b> clear all springs.";
}

}  // namespace meshless

PLUGINLIB_EXPORT_CLASS(meshless::PushTool, rviz::Tool)
