#include "hand_tool.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <OgreCamera.h>
#include <OgreViewport.h>
#include <meshless_surgery/Probe.h>
#include <rviz/display_context.h>
#include <rviz/frame_manager.h>
#include <rviz/properties/string_property.h>
#include <rviz/view_controller.h>
#include <rviz/view_manager.h>
#include <std_srvs/Trigger.h>
#include <QKeyEvent>

#include "ogre_convert.h"

namespace meshless {
namespace {

constexpr double kProbeEvery = 0.2;     // [s] under a cursor that stands still: the tissue moves
constexpr double kNoteTime = 4.0;       // [s]
constexpr double kNearestPlane = 0.05;  // [m] before the camera
constexpr char kClearKey = 'R';

}  // namespace

HandTool::HandTool(char shortcut_key) { shortcut_key_ = shortcut_key; }

HandTool::~HandTool() = default;

void HandTool::onInitialize() {
  link_ = new NodeLink(this);
  node_property_ = new rviz::StringProperty("Node", "/deformer", "The deformer node that this tool acts on.",
                                            getPropertyContainer(), SLOT(updateNode()), this);
  updateNode();
  setCursor(Qt::CrossCursor);
}

void HandTool::updateNode() {
  link_->setNode(node_property_->getStdString());
  nodeChanged();
  if (active_) {
    deactivate();
    activate();
  }
}

void HandTool::activate() {
  active_ = true;
  hover_ = Hover();
  listenTo(context_->getViewManager()->getRenderPanel());
  state_ = link_->handle().subscribe<meshless_surgery::State>(link_->nameOf("state"), 1,
                                                              [this](const meshless_surgery::State::ConstPtr& state) {
                                                                world_frame_ = state->header.frame_id;
                                                                stateCame(*state);
                                                              });
  events_ = link_->handle().subscribe<meshless_surgery::Event>(
      link_->nameOf("events"), 100, [this](const meshless_surgery::Event::ConstPtr& event) { eventCame(*event); });
  onActivate();
}

void HandTool::deactivate() {
  if (!active_) return;
  active_ = false;
  state_.shutdown();
  events_.shutdown();
  stream_.hush();
  onDeactivate();
  listenTo(nullptr);
  viewport_ = nullptr;
  seen_ = false;
}

void HandTool::update(float wall_dt, float) {
  if (!active_) return;
  since_probe_ += wall_dt;
  if (seen_ && !probing_ && looksForTissue() && (moved_ || since_probe_ > kProbeEvery)) probe();
  if (note_left_ > 0.0) {
    note_left_ -= wall_dt;
    if (note_left_ <= 0.0 && seen_) showStatus();
  }
  onUpdate(wall_dt);
}

int HandTool::processMouseEvent(rviz::ViewportMouseEvent& event) {
  if (panel_ != event.panel) listenTo(event.panel);
  viewport_ = event.viewport;
  last_x_ = seen_ ? x_ : event.x;
  last_y_ = seen_ ? y_ : event.y;
  x_ = event.x;
  y_ = event.y;
  seen_ = true;
  moved_ = true;
  ray_ = rayThrough(x_, y_);
  if (!onMouse(event) && panel_->getViewController()) panel_->getViewController()->handleMouseEvent(event);
  showCursor();
  showStatus();
  return Render;
}

int HandTool::processKeyEvent(QKeyEvent* event, rviz::RenderPanel* panel) {
  if (event->key() == kClearKey) {
    clearSprings();
  } else if (!onKey(event->key()) && panel->getViewController()) {
    panel->getViewController()->handleKeyEvent(event, panel);
  }
  showStatus();
  return Render;
}

bool HandTool::onKey(int) { return false; }

bool HandTool::eventFilter(QObject* object, QEvent* event) {
  if (event->type() == QEvent::Leave && !dragging()) seen_ = false;
  if (event->type() != QEvent::KeyPress) return rviz::Tool::eventFilter(object, event);
  const int key = static_cast<QKeyEvent*>(event)->key();
  if (key == Qt::Key_Escape && dragging()) {
    undoDrag();
    showStatus();
    context_->queueRender();
    return true;
  }
  if (key == QChar(shortcut_key_).toUpper().unicode()) return true;
  return rviz::Tool::eventFilter(object, event);
}

void HandTool::listenTo(rviz::RenderPanel* panel) {
  if (panel_) panel_->removeEventFilter(this);
  panel_ = panel;
  if (panel_) panel_->installEventFilter(this);
}

void HandTool::probe() {
  meshless_surgery::Probe question;
  question.request.header = header();
  question.request.point = toPoint(ray_.getOrigin());
  question.request.direction = toVector(ray_.getDirection());
  probing_ = true;
  moved_ = false;
  since_probe_ = 0.0;
  link_->call("probe", question, [this](const meshless_surgery::Probe::Response& met) {
    probing_ = false;
    hover_.over = met.success;
    if (met.success) {
      hover_.body = QString::fromStdString(met.body);
      hover_.position = toFixed(met.position);
      hover_.normal = toFixed(met.normal);
    }
    if (!active_ || !seen_) return;
    showCursor();
    showStatus();
  });
}

void HandTool::showCursor() {
  const Qt::CursorShape shape = dragging()    ? Qt::ClosedHandCursor
                                : hover_.over ? Qt::PointingHandCursor
                                              : Qt::CrossCursor;
  if (getCursor().shape() == shape) return;
  setCursor(shape);
  if (panel_) panel_->setCursor(getCursor());  // rviz does so only with the next event
}

void HandTool::say(const QString& note) {
  note_ = note;
  note_left_ = kNoteTime;
  if (active_ && seen_) showStatus();
}

void HandTool::showStatus() {
  QString text = help();
  if (hover_.over && !dragging()) text = "<b>" + hover_.body.toHtmlEscaped() + "</b>: " + text;
  if (note_left_ > 0.0) text = "<b>" + note_.toHtmlEscaped() + "</b> &nbsp; " + text;
  setStatus(text);
}

void HandTool::clearSprings() {
  if (dragging()) undoDrag();
  link_->call("clear_picks", std_srvs::Trigger(),
              [this](const std_srvs::Trigger::Response& answer) { say(QString::fromStdString(answer.message)); });
}

Ogre::Vector3 HandTool::viewDirection() const {
  return viewport_ ? viewport_->getCamera()->getDerivedDirection() : Ogre::Vector3(Ogre::Vector3::UNIT_X);
}

Ogre::Quaternion HandTool::viewOrientation() const {
  return viewport_ ? viewport_->getCamera()->getDerivedOrientation() : Ogre::Quaternion(Ogre::Quaternion::IDENTITY);
}

Ogre::Quaternion HandTool::instrumentTurn() const {
  // In the camera's frame: x right, y up, z back.
  static const Ogre::Vector3 reach = Ogre::Vector3(-0.5f, 0.35f, -0.8f).normalisedCopy(),
                             open = Ogre::Vector3::UNIT_Z.crossProduct(reach).normalisedCopy();
  return viewOrientation() * Ogre::Quaternion(reach, open, reach.crossProduct(open));
}

Ogre::Vector3 HandTool::onPlane(const Ogre::Vector3& normal, const Ogre::Vector3& point) const {
  const auto met = ray_.intersects(Ogre::Plane(normal, point));
  return met.first ? ray_.getPoint(met.second) : point;
}

Ogre::Ray HandTool::rayThrough(int x, int y) const {
  return viewport_->getCamera()->getCameraToViewportRay(
      static_cast<float>(x) / static_cast<float>(viewport_->getActualWidth()),
      static_cast<float>(y) / static_cast<float>(viewport_->getActualHeight()));
}

Ogre::Vector3 HandTool::cursorWay(const Ogre::Vector3& place) const {
  if (!viewport_) return Ogre::Vector3::ZERO;
  const Ogre::Vector3 eye = viewport_->getCamera()->getDerivedPosition(), ahead = viewDirection();
  const double away = std::max(kNearestPlane, static_cast<double>((place - eye).dotProduct(ahead)));
  const Ogre::Plane plane(ahead, eye + ahead * static_cast<float>(away));
  const Ogre::Ray from = rayThrough(last_x_, last_y_), to = rayThrough(x_, y_);
  const auto was = from.intersects(plane), is = to.intersects(plane);
  return was.first && is.first ? to.getPoint(is.second) - from.getPoint(was.second)
                               : Ogre::Vector3(Ogre::Vector3::ZERO);
}

double HandTool::pixelsTo(const Ogre::Vector3& point) const {
  if (!viewport_) return std::numeric_limits<double>::infinity();
  const Ogre::Camera* camera = viewport_->getCamera();
  if ((point - camera->getDerivedPosition()).dotProduct(camera->getDerivedDirection()) <= 0.0)
    return std::numeric_limits<double>::infinity();
  const Ogre::Vector3 seen = camera->getProjectionMatrix() * (camera->getViewMatrix() * point);
  const double x = 0.5 * (seen.x + 1.0) * viewport_->getActualWidth();
  const double y = 0.5 * (1.0 - seen.y) * viewport_->getActualHeight();
  return std::hypot(x - x_, y - y_);
}

std_msgs::Header HandTool::header() const {
  std_msgs::Header header;  // stamp 0: the latest transform
  header.frame_id = context_->getFixedFrame().toStdString();
  return header;
}

geometry_msgs::PoseStamped HandTool::poseMessage(const Ogre::Vector3& position,
                                                 const Ogre::Quaternion& orientation) const {
  geometry_msgs::PoseStamped message;
  message.header = header();
  message.pose.position = toPoint(position);
  message.pose.orientation = toQuaternion(orientation);
  return message;
}

void HandTool::worldPose(Ogre::Vector3& origin, Ogre::Quaternion& turn) const {
  origin = Ogre::Vector3::ZERO;
  turn = Ogre::Quaternion::IDENTITY;
  if (!world_frame_.empty()) context_->getFrameManager()->getTransform(world_frame_, ros::Time(), origin, turn);
}

Ogre::Vector3 HandTool::toFixed(const geometry_msgs::Point& point) const {
  Ogre::Vector3 origin;
  Ogre::Quaternion turn;
  worldPose(origin, turn);
  return origin + turn * toOgre(point);
}

Ogre::Vector3 HandTool::toFixed(const geometry_msgs::Vector3& direction) const {
  Ogre::Vector3 origin;
  Ogre::Quaternion turn;
  worldPose(origin, turn);
  return turn * toOgre(direction);
}

}  // namespace meshless
