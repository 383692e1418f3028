#include "pick_tool.h"

#include <OgreSceneManager.h>
#include <OgreSceneNode.h>
#include <meshless_surgery/Lock.h>
#include <meshless_surgery/MovePick.h>
#include <meshless_surgery/Pick.h>
#include <meshless_surgery/Release.h>
#include <rviz/view_controller.h>
#include <pluginlib/class_list_macros.hpp>

#include "ogre_convert.h"

namespace meshless {
namespace {

constexpr double kReach = 0.002;   // [m] beside the surface that still grabs
constexpr double kSphere = 0.009;  // [m] diameter: a little more than the end of a spring in the markers
constexpr double kNear = 14.0;     // [px] from the middle of a locked sphere
constexpr float kOpenJaws = 0.8f;  // [rad] before they close on tissue; the node shows those that hold

}  // namespace

PickTool::PickTool() : HandTool('k') {}

void PickTool::nodeChanged() {
  poses_ = link().handle().advertise<geometry_msgs::PoseStamped>(link().nameOf("pick/servo_cp"), 10);
}

void PickTool::onDeactivate() {
  if (dragging()) letGo();
  drag_ = Drag::kNone;
  sphere_.reset();
  grasper_.reset();
  locked_.clear();
}

void PickTool::stateCame(const meshless_surgery::State& state) {
  locked_.clear();
  bool held = false;
  for (const auto& pick : state.picks) {
    if (pick.locked) locked_.push_back({pick.pick_id, toFixed(pick.target)});
    held = held || pick.pick_id == pick_id_;
  }
  if (drag_ == Drag::kHolding && !held && state.header.stamp > held_since_) {
    end();
    say("the spring is gone");
  }
}

const PickTool::Locked* PickTool::lockedUnderCursor() const {
  const Locked* nearest = nullptr;
  double best = kNear;
  for (const Locked& locked : locked_) {
    const double pixels = pixelsTo(locked.target);
    if (pixels > best) continue;
    best = pixels;
    nearest = &locked;
  }
  return nearest;
}

bool PickTool::onMouse(rviz::ViewportMouseEvent& event) {
  const bool any_button = event.left() || event.right();
  switch (drag_) {
    case Drag::kNone:
      if (!event.leftDown()) return false;
      if (const Locked* locked = lockedUnderCursor()) {
        takeUp(*locked);
      } else {
        grab();
      }
      return true;
    case Drag::kAsking:
    case Drag::kHolding:
      if (event.rightDown() && drag_ == Drag::kHolding) {
        move();
        end();
        lock(target_);
        say("locked");
      } else if (event.leftUp() || !event.left()) {
        if (drag_ == Drag::kHolding) move();
        letGo();
        drag_ = event.right() ? Drag::kOver : Drag::kNone;
      } else if (drag_ == Drag::kHolding) {
        if (event.wheel_delta != 0) plane_point_ += plane_normal_ * (event.wheel_delta / kNotch * kWheelStep);
        move();
      }
      return true;
    case Drag::kCamera:
      if (!camera_pressed_) pressCamera(event);
      if (!event.left()) drag_ = Drag::kNone;
      return false;
    case Drag::kOver:
      if (!any_button) drag_ = Drag::kNone;
      return true;
  }
  return true;
}

void PickTool::grab() {
  drag_ = Drag::kAsking;
  taken_up_ = false;
  plane_normal_ = viewDirection();
  const std::uint32_t attempt = ++attempt_;
  meshless_surgery::Pick question;
  question.request.header = header();
  question.request.point = toPoint(ray().getOrigin());
  question.request.direction = toVector(ray().getDirection());
  question.request.max_distance = kReach;
  link().call("pick", question, [this, attempt](const meshless_surgery::Pick::Response& picked) {
    const bool wanted = attempt == attempt_ && drag_ == Drag::kAsking;
    if (!picked.success) {
      if (!wanted) return;
      drag_ = Drag::kCamera;
      camera_pressed_ = false;
      say("no tissue there; the drag turns the view");
      return;
    }
    if (!wanted) {
      release(picked.pick_id);
      return;
    }
    grip_ = Ogre::Vector3::ZERO;
    hold(picked.pick_id, toFixed(picked.position));
    move();
    showStatus();
  });
}

void PickTool::pressCamera(const rviz::ViewportMouseEvent& event) {
  // The camera drags from the press on that it has not seen.
  camera_pressed_ = true;
  rviz::ViewportMouseEvent press = event;
  press.type = QEvent::MouseButtonPress;
  press.acting_button = Qt::LeftButton;
  press.buttons_down = Qt::LeftButton;
  press.x = event.last_x;
  press.y = event.last_y;
  if (press.panel->getViewController()) press.panel->getViewController()->handleMouseEvent(press);
}

void PickTool::takeUp(const Locked& locked) {
  ++attempt_;
  taken_up_ = true;
  plane_normal_ = viewDirection();
  grip_ = locked.target - onPlane(plane_normal_, locked.target);  // it does not jump under the cursor
  hold(locked.pick_id, locked.target);
  meshless_surgery::MovePick wish;
  wish.request.header = header();
  wish.request.pick_id = pick_id_;
  wish.request.target = toPoint(start_);
  link().call("move_pick", wish, [this](const meshless_surgery::MovePick::Response& answer) {
    if (!answer.success) say(QString::fromStdString(answer.message));
  });
}

void PickTool::hold(std::uint32_t pick_id, const Ogre::Vector3& point) {
  drag_ = Drag::kHolding;
  held_since_ = ros::Time::now();
  pick_id_ = pick_id;
  plane_point_ = start_ = target_ = point;
  if (!sphere_) {
    sphere_ = std::make_unique<rviz::Shape>(rviz::Shape::Sphere, scene_manager_);
    sphere_->setColor(0.9f, 0.1f, 0.1f, 1.0f);
    sphere_->setScale(Ogre::Vector3(kSphere));
  }
  sphere_->setPosition(point);
}

void PickTool::move() {
  target_ = onPlane(plane_normal_, plane_point_) + grip_;
  if (sphere_) sphere_->setPosition(target_);
  stream().say([poses = poses_, pose = poseMessage(target_, instrumentTurn())] { poses.publish(pose); });
}

void PickTool::onUpdate(double) {
  if (drag_ != Drag::kNone || !seen() || !hover().over) return grasper_.reset();
  if (!grasper_) grasper_ = std::make_unique<InstrumentsShape>(scene_manager_, scene_manager_->getRootSceneNode());
  grasper_->show(grasperParts(hover().position, instrumentTurn(), kOpenJaws));
}

void PickTool::lock(const Ogre::Vector3& target) {
  meshless_surgery::Lock wish;
  wish.request.pick_id = pick_id_;
  wish.request.at_target = true;
  wish.request.header = header();
  wish.request.target = toPoint(target);
  link().call("lock", wish, [this](const meshless_surgery::Lock::Response& answer) {
    if (!answer.success) say(QString::fromStdString(answer.message));
  });
}

void PickTool::release(std::uint32_t pick_id) {
  meshless_surgery::Release wish;
  wish.request.pick_id = pick_id;
  link().call("release", wish);
}

void PickTool::letGo() {
  ++attempt_;  // an answer that is still under way is released when it comes
  const bool held = drag_ == Drag::kHolding;
  end();
  if (held) release(pick_id_);
}

void PickTool::end() {
  drag_ = Drag::kOver;
  stream().hush();
  sphere_.reset();
}

void PickTool::undoDrag() {
  if (drag_ == Drag::kHolding && taken_up_) {
    end();
    lock(start_);
    say("undone: locked where it was");
    return;
  }
  letGo();
  say("undone: let go");
}

QString PickTool::help() const {
  switch (drag_) {
    case Drag::kAsking:
    case Drag::kHolding:
      return "<b>Move:</b> pull in the plane of the view.  <b>Wheel:</b> away, towards.  <b>Release left:</b> let go.  "
             "<b>Right:</b> lock here.  <b>Esc:</b> undo.  <b>R:</b> clear all springs.";
    case Drag::kCamera:
      return "<b>Left:</b> turns the view.";
    default:
      return "<b>Left drag:</b> grab tissue, or a locked sphere; beside it, turn the view.  <b>Middle, right, "
             "wheel:</b> "
             "view.  <b>R:</b> clear all springs.";
  }
}

}  // namespace meshless

PLUGINLIB_EXPORT_CLASS(meshless::PickTool, rviz::Tool)
