#include "cut_tool.h"

#include <algorithm>
#include <cmath>

#include <OgreSceneManager.h>
#include <meshless_surgery/Cut.h>
#include <rviz/properties/float_property.h>
#include <sensor_msgs/JointState.h>
#include <std_srvs/Trigger.h>
#include <QKeyEvent>
#include <pluginlib/class_list_macros.hpp>

#include "ogre_convert.h"

namespace meshless {
namespace {

constexpr double kOpen = 0.5;         // [rad]
constexpr double kLeastSaid = 0.05;   // [rad] below 0.02 the node would cut by the stream, which gets no answer
constexpr double kFirstYaw = 0.3;     // [rad] seen along themselves the blades would be two lines
constexpr double kPush = 1.0 / 12.0;  // lengths a notch
constexpr float kPreview = 0.025f;    // lengths: width of the line
constexpr double kRadiansPerPixel = 0.008;
constexpr double kRoll = 0.13;         // [rad] a notch
constexpr double kDepthFactor = 1.15;  // a notch
constexpr double kShallowest = 0.001;  // [m]
constexpr double kDeepest = 0.2;       // [m]
constexpr double kShortest = 0.002;    // [m] of an incision; below it, the mouse only clicked
constexpr double kMargin = 0.002;      // [m] of the scalpel above the tissue
constexpr float kLineOver = 0.002f;    // [m] above the tissue

Ogre::Quaternion firstTurn() {
  // In the camera's frame (x right, y up, z back): the blades reach away, open up and down, and are seen from the side.
  const Ogre::Vector3 reach(-std::sin(kFirstYaw), 0.0f, -std::cos(kFirstYaw));
  const Ogre::Vector3 open = Ogre::Vector3::UNIT_Y;
  return Ogre::Quaternion(reach, open, reach.crossProduct(open));
}

}  // namespace

CutTool::CutTool() : HandTool('x'), angle_(kOpen), turn_(firstTurn()) {}

void CutTool::onInitialize() {
  HandTool::onInitialize();
  close_time_ = new rviz::FloatProperty(
      "Close time", 0.6f, "Seconds that the left button is held until the blades meet.", getPropertyContainer());
  close_time_->setMin(0.1f);
  close_time_->setMax(10.0f);
}

void CutTool::nodeChanged() {
  poses_ = link().handle().advertise<geometry_msgs::PoseStamped>(link().nameOf("scissors/servo_cp"), 10);
  jaws_ = link().handle().advertise<sensor_msgs::JointState>(link().nameOf("scissors/jaw/servo_js"), 10);
}

void CutTool::onActivate() {
  act_ = Act::kNone;
  angle_ = kOpen;
  length_ = pushed_ = 0.0;
  turn_ = firstTurn();
  placed_ = false;
  surfaces_topic_ = link().handle().subscribe<meshless_surgery::Surfaces>(
      link().nameOf("surfaces"), 1, [this](const meshless_surgery::Surfaces::ConstPtr& surfaces) {
        surfaces_ = surfaces;
        if (surfaces->scissors_shown) length_ = surfaces->scissors_length;
      });
}

void CutTool::onDeactivate() {
  act_ = Act::kNone;
  shown_line_.reset();
  scalpel_.reset();
  preview_.reset();
  surfaces_topic_.shutdown();
  surfaces_.reset();
  putAway();
}

void CutTool::putAway() {
  if (lifted_) return;
  lifted_ = true;
  stream().hush();
  link().call("lift_scissors", std_srvs::Trigger(), {}, kAfterStream);
}

bool CutTool::onMouse(rviz::ViewportMouseEvent& event) {
  const double notches = event.wheel_delta / kNotch;
  if (notches != 0.0) {
    if (act_ == Act::kDrawing || event.control()) {
      depth_ = std::clamp(depth_ * std::pow(kDepthFactor, notches), kShallowest, kDeepest);
    } else if (event.shift()) {
      turn_ = Ogre::Quaternion(Ogre::Radian(static_cast<float>(kRoll * notches)), Ogre::Vector3::UNIT_Z) * turn_;
    } else {
      pushed_ += notches * kPush;
    }
    follow();
    return true;
  }
  switch (act_) {
    case Act::kNone:
      if (event.leftDown() && event.control()) {
        if (!hover().over) {
          say("an incision begins on tissue");
          return true;
        }
        act_ = Act::kDrawing;
        putAway();  // one blade in the hand
        line_.assign(1, {hover().position, hover().normal});
      } else if (event.leftDown() && event.shift()) {
        act_ = Act::kTurning;
      } else if (event.leftDown()) {
        act_ = placed_ ? Act::kClosing : Act::kOver;
        pressed_ = ros::WallTime::now();
      } else if (event.middle() || event.right()) {
        return false;
      } else {
        follow();
      }
      return true;
    case Act::kClosing:
    case Act::kOver:
      if (!event.left()) act_ = Act::kNone;
      return true;
    case Act::kTurning:
      turn(event.x - event.last_x, event.y - event.last_y);
      if (!event.left()) act_ = Act::kNone;
      return true;
    case Act::kDrawing:
      draw();
      if (!event.left()) finishLine();
      return true;
  }
  return true;
}

bool CutTool::onKey(int key) {
  if (key != Qt::Key_Z) return false;
  link().call("undo_cut", std_srvs::Trigger(),
              [this](const std_srvs::Trigger::Response& answer) { say(QString::fromStdString(answer.message)); });
  return true;
}

void CutTool::turn(int dx, int dy) {
  const Ogre::Quaternion yaw(Ogre::Radian(static_cast<float>(kRadiansPerPixel * dx)), Ogre::Vector3::UNIT_Y);
  const Ogre::Quaternion pitch(Ogre::Radian(static_cast<float>(kRadiansPerPixel * dy)), Ogre::Vector3::UNIT_X);
  turn_ = yaw * pitch * turn_;
  turn_.normalise();
  orientation_ = viewOrientation() * turn_;
}

void CutTool::follow() {
  if (!seen()) return;
  if (hover().over) {
    placed_ = true;
    plane_point_ = hover().position;
  }
  place_ = onPlane(viewDirection(), plane_point_);
  orientation_ = viewOrientation() * turn_;
}

Ogre::Vector3 CutTool::pivot() const {
  return place_ + orientation_ * Ogre::Vector3::UNIT_X * ((pushed_ - 0.5) * length_);
}

void CutTool::onUpdate(double dt) {
  const double speed = kOpen / std::max(0.1f, close_time_->getFloat());
  const bool open = angle_ > 0.0;
  // Of the time since the last picture, only what has passed since the button was pressed.
  angle_ = act_ == Act::kClosing
               ? std::max(0.0, angle_ - std::min(dt, (ros::WallTime::now() - pressed_).toSec()) * speed)
               : std::min(kOpen, angle_ + 2.0 * dt * speed);
  if (open && !(angle_ > 0.0)) cut();
  if (act_ == Act::kNone) follow();
  if (act_ == Act::kDrawing) draw();
  if (placed_ && act_ != Act::kDrawing) sayBlades();
  showPreview();
}

void CutTool::showPreview() {
  const auto shown = act_ == Act::kDrawing ? std::nullopt : blades();
  if (!shown) return preview_.reset();
  Ogre::Vector3 origin;
  Ogre::Quaternion turn;
  worldPose(origin, turn);
  if (!preview_) preview_ = std::make_unique<CutPreview>(scene_manager_);
  // As fine as the blades are, and above the tissue by no more.
  const float width = kPreview * static_cast<float>(length_);
  preview_->show(linesOfCut(*surfaces_, *shown), width, origin - viewDirection() * width, turn);
}

std::optional<PreviewBlades> CutTool::blades() const {
  if (!placed_ || !surfaces_ || !surfaces_->scissors_shown) return std::nullopt;
  Ogre::Vector3 origin;
  Ogre::Quaternion turn;
  worldPose(origin, turn);
  const Ogre::Quaternion back = turn.Inverse();
  PreviewBlades blades;
  blades.pivot = back * (pivot() - origin);
  blades.reach = back * (orientation_ * Ogre::Vector3::UNIT_X);
  blades.open = back * (orientation_ * Ogre::Vector3::UNIT_Y);
  blades.length = surfaces_->scissors_length;
  blades.width = surfaces_->scissors_width;
  return blades;
}

void CutTool::sayBlades() {
  lifted_ = false;
  sensor_msgs::JointState jaw;
  jaw.header.stamp = ros::Time::now();
  jaw.name = {"jaw"};
  jaw.position = {std::max(kLeastSaid, angle_)};
  stream().say([poses = poses_, jaws = jaws_, pose = poseMessage(pivot(), orientation_), jaw] {
    poses.publish(pose);
    jaws.publish(jaw);
  });
}

void CutTool::cut() {
  const auto closed = blades();
  if (!closed) return say("the node has no scissors");
  meshless_surgery::Cut wish;
  wish.request.blades = poseMessage(pivot(), orientation_);
  wish.request.length = closed->length;
  wish.request.width = closed->width;
  link().call("cut", wish, [this](const meshless_surgery::Cut::Response& answer) {
    if (!answer.success) say(QString::fromStdString(answer.message));
  });
}

void CutTool::draw() {
  if (hover().over && (hover().position - line_.back().position).length() > 0.5 * kShortest)
    line_.push_back({hover().position, hover().normal});
  showLine();
}

void CutTool::showLine() {
  if (!shown_line_) {
    shown_line_ = std::make_unique<rviz::BillboardLine>(scene_manager_);
    shown_line_->setLineWidth(kLineWidth);
    shown_line_->setColor(0.95f, 0.95f, 0.2f, 1.0f);
  }
  const Ogre::Vector3 over = viewDirection() * -kLineOver;
  shown_line_->clear();
  shown_line_->setMaxPointsPerLine(static_cast<uint32_t>(line_.size()) + 1);
  for (const Touch& touch : line_) shown_line_->addPoint(touch.position + over);
  if (!scalpel_) scalpel_ = std::make_unique<InstrumentsShape>(scene_manager_, scene_manager_->getRootSceneNode());
  scalpel_->show(scalpelParts(line_.back().position, instrumentTurn()));
}

void CutTool::finishLine() {
  act_ = Act::kNone;
  shown_line_.reset();
  scalpel_.reset();
  // Where exactly the tissue ends under the cursor is asked once more: what is known is some frames old.
  meshless_surgery::Probe question;
  question.request.header = header();
  question.request.point = toPoint(ray().getOrigin());
  question.request.direction = toVector(ray().getDirection());
  link().call("probe", question, [this](const meshless_surgery::Probe::Response& met) {
    incise(met.success ? Touch{toFixed(met.position), toFixed(met.normal)} : line_.back());
  });
}

void CutTool::incise(const Touch& end) {
  const Touch& start = line_.front();
  const Ogre::Vector3 along = end.position - start.position;
  const double length = along.length();
  if (!(length > kShortest)) {
    say("too short for an incision: hold Ctrl and draw along the tissue");
    return;
  }
  const Ogre::Vector3 x = along.normalisedCopy();
  Ogre::Vector3 up = start.normal + end.normal;
  for (const Touch& touch : line_) up += touch.normal;
  up -= x * x.dotProduct(up);
  if (!(up.length() > 1e-6f)) up = -viewDirection() - x * x.dotProduct(-viewDirection());
  if (!(up.length() > 1e-6f)) {
    say("the line goes straight away from the viewer: turn the view");
    return;
  }
  up.normalise();
  // The blade's back is above all tissue that the line went over.
  double rise = 0.0;
  for (const Touch& touch : line_)
    rise = std::max(rise, static_cast<double>((touch.position - start.position).dotProduct(up)));
  const double margin = rise + kMargin;
  meshless_surgery::Incise wish;
  wish.request.blade = poseMessage(start.position + up * margin, Ogre::Quaternion(x, up, x.crossProduct(up)));
  wish.request.length = length;
  wish.request.depth = depth_ + margin;
  link().call("incise", wish, [this](const meshless_surgery::Incise::Response& answer) {
    say(QString::fromStdString(answer.message));
  });
}

void CutTool::eventCame(const meshless_surgery::Event& event) {
  if (event.type == "cut" || event.type == "undone") say(QString::fromStdString(event.body + ": " + event.text));
}

void CutTool::undoDrag() {
  say(act_ == Act::kDrawing ? "undone: no incision" : "undone: the blades open again");
  shown_line_.reset();
  scalpel_.reset();
  act_ = Act::kOver;
}

QString CutTool::help() const {
  const QString depth = QString::number(1e3 * depth_, 'f', 1) + " mm";
  switch (act_) {
    case Act::kClosing:
      return angle_ > 0.0
                 ? "<b>Keep holding:</b> the blades close.  <b>Release left</b> or <b>Esc:</b> they open again."
                 : "<b>The blades have met.</b>  <b>Release left:</b> they open again.";
    case Act::kTurning:
      return "<b>Move:</b> turns the blades.  <b>Release left:</b> done.";
    case Act::kDrawing:
      return "<b>Move:</b> the incision ends here, " + depth +
             " deep.  <b>Wheel:</b> deeper, shallower.  <b>Release left:</b> open it.  <b>Esc:</b> undo.";
    default:
      return "<b>Hold left:</b> close the blades.  <b>Wheel:</b> deeper, back.  <b>Shift+drag, shift+wheel:</b> turn. "
             " "
             "<b>Ctrl+drag:</b> incision, " +
             depth + " (Ctrl+wheel).  <b>Z:</b> undo cut.  <b>R:</b> clear springs.";
  }
}

}  // namespace meshless

PLUGINLIB_EXPORT_CLASS(meshless::CutTool, rviz::Tool)
