#include "lead_tool.h"

#include <cmath>

#include <rviz/properties/float_property.h>
#include <sensor_msgs/JointState.h>
#include <pluginlib/class_list_macros.hpp>

#include "ogre_convert.h"

namespace meshless {
namespace {

constexpr float kOpen = 0.3f, kWidest = 1.6f;      // [rad] between jaws
constexpr double kTurnStep = 10.0 / 180.0 * M_PI;  // [rad] a notch
constexpr double kFineStep = 0.001;                // [m] a notch, with Shift
constexpr double kTilt = 0.005;                    // [rad] a pixel

bool hasJaws(const std::string& type) { return type == "grasper" || type == "scissors" || type == "clip_applier"; }

}  // namespace

LeadTool::LeadTool() : HandTool('j') {}

void LeadTool::onInitialize() {
  HandTool::onInitialize();
  opening_ =
      new rviz::FloatProperty("Opening", kOpen, "[rad] between the jaws where they are open.", getPropertyContainer());
  opening_->setMin(0.0f);
  opening_->setMax(kWidest);
}

void LeadTool::nodeChanged() {
  instruments_.clear();
  choose("");
}

void LeadTool::onActivate() {
  drag_ = Drag::kNone;
  leads_ = false;
}

void LeadTool::onDeactivate() {
  drag_ = Drag::kNone;
  leads_ = false;
}

void LeadTool::choose(const std::string& name) {
  if (name == name_) return;
  stream().hush();
  leads_ = false;
  drag_ = Drag::kNone;
  name_ = name;
  poses_ = ros::Publisher();
  jaws_ = ros::Publisher();
  if (name.empty()) return;
  poses_ = link().handle().advertise<geometry_msgs::PoseStamped>(link().nameOf(name + "/servo_cp"), 10);
  if (hasJaws(chosen()->type))
    jaws_ = link().handle().advertise<sensor_msgs::JointState>(link().nameOf(name + "/jaw/servo_jp"), 10);
}

const meshless_surgery::InstrumentState* LeadTool::chosen() const {
  for (const auto& instrument : instruments_)
    if (instrument.name == name_) return &instrument;
  return nullptr;
}

void LeadTool::stateCame(const meshless_surgery::State& state) {
  instruments_ = state.instruments;
  if (!chosen()) choose(instruments_.empty() ? "" : instruments_.front().name);
}

void LeadTool::eventCame(const meshless_surgery::Event& event) {
  using meshless_surgery::Event;
  if (event.type != Event::RESET && event.type != Event::LOADED && event.type != Event::INSTRUMENT) return;
  // It is elsewhere now: it is taken up where that is.
  stream().hush();
  leads_ = false;
  if (dragging()) drag_ = Drag::kOver;
}

bool LeadTool::takeUp() {
  const auto* instrument = chosen();
  if (!instrument) {
    say("the scene has no instrument");
    return false;
  }
  if (leads_) return true;
  Ogre::Vector3 origin;
  Ogre::Quaternion turn;
  worldPose(origin, turn);
  hand_ = {toFixed(instrument->pose.position), turn * toOgre(instrument->pose.orientation)};
  closed_ = instrument->jaw < 0.5 * opening_->getFloat();
  moves_jaws_ = false;
  leads_ = true;
  return true;
}

void LeadTool::lead() {
  sensor_msgs::JointState jaws;
  if (moves_jaws_) jaws.position = {closed_ ? 0.0 : opening_->getFloat()};
  // Nothing is repeated while it stands: what comes just after a reset would lead it away.
  stream().say([poses = poses_, pose = poseMessage(hand_.at, hand_.turn), to_jaws = jaws_, jaws] {
    poses.publish(pose);
    if (!jaws.position.empty()) to_jaws.publish(jaws);
  });
  if (!dragging()) stream().hush();
}

void LeadTool::moveJaws() {
  closed_ = !closed_;
  moves_jaws_ = true;
  lead();
}

bool LeadTool::onMouse(rviz::ViewportMouseEvent& event) {
  const double notches = event.wheel_delta / kNotch;
  if (notches != 0.0 && takeUp()) {
    if (event.control())
      hand_.turn = hand_.turn * Ogre::Quaternion(Ogre::Radian(notches * kTurnStep), Ogre::Vector3::UNIT_X);
    else
      hand_.at += viewDirection() * (notches * (event.shift() ? kFineStep : kWheelStep));
    lead();
  }
  switch (drag_) {
    case Drag::kNone:
      if (!event.leftDown()) return notches != 0.0;
      if (takeUp()) {
        before_ = hand_;
        drag_ = Drag::kMoves;
        lead();
      }
      return true;
    case Drag::kMoves:
      if (event.leftUp() || !event.left()) {
        drag_ = Drag::kNone;
        lead();  // it stays there
      } else if (event.rightDown() && jaws_) {
        moveJaws();
      } else if (event.control()) {
        const Ogre::Quaternion view = viewOrientation();
        hand_.turn = Ogre::Quaternion(Ogre::Radian(kTilt * pixelsRight()), view * Ogre::Vector3::UNIT_Y) *
                     Ogre::Quaternion(Ogre::Radian(kTilt * pixelsDown()), view * Ogre::Vector3::UNIT_X) * hand_.turn;
        lead();
      } else {
        hand_.at += cursorWay(hand_.at);
        lead();
      }
      return true;
    case Drag::kOver:
      if (!event.left() && !event.right()) drag_ = Drag::kNone;
      return true;
  }
  return true;
}

bool LeadTool::onKey(int key) {
  if (key == Qt::Key_Space && takeUp()) {
    if (jaws_)
      moveJaws();
    else
      say(QString::fromStdString(name_) + " has no jaws");
    return true;
  }
  const int number = key - Qt::Key_1;
  if (number < 0 || number > 8) return false;
  if (number < static_cast<int>(instruments_.size()))
    choose(instruments_[static_cast<std::size_t>(number)].name);
  else
    say("the scene has " + QString::number(instruments_.size()) + " instruments");
  return true;
}

void LeadTool::undoDrag() {
  hand_ = before_;
  drag_ = Drag::kOver;
  lead();
  say("undone: it goes back to where it was");
}

QString LeadTool::help() const {
  const auto* instrument = chosen();
  if (!instrument) return "There is no instrument.  <b>Middle, right:</b> view.";
  QString which;
  if (instruments_.size() > 1)
    for (std::size_t k = 0; k < instruments_.size() && k < 9; ++k)
      which += "<b>" + QString::number(k + 1) + ":</b> " + QString::fromStdString(instruments_[k].name) + ".  ";
  const QString name =
      "<b>" + QString::fromStdString(name_) + "</b> (" + QString::fromStdString(instrument->type) + "):  ";
  const QString wheel =
      "<b>Wheel:</b> away, towards; finer with <b>Shift</b>.  <b>Ctrl+wheel:</b> turn about its shaft.  ";
  const QString jaws = closed_ ? "open" : "close";
  if (dragging())
    return name + "<b>Move:</b> it follows; with <b>Ctrl</b> it tilts.  " + wheel +
           (jaws_ ? "<b>Right:</b> " + jaws + " the jaws.  " : "") + "<b>Esc:</b> back.";
  return name + "<b>Left drag:</b> lead it.  " + wheel + (jaws_ ? "<b>Space:</b> " + jaws + " the jaws.  " : "") +
         which + "<b>Middle, right:</b> view.";
}

}  // namespace meshless

PLUGINLIB_EXPORT_CLASS(meshless::LeadTool, rviz::Tool)
