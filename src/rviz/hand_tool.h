// What the tools share: the ray under the cursor, what tissue it meets, planes that face the camera, keys, the
// status line. Positions are in rviz's fixed frame.
#pragma once

#include <meshless_surgery/Event.h>
#include <meshless_surgery/State.h>
#include <rviz/tool.h>
#include <QPointer>

#ifndef Q_MOC_RUN
#include <OgrePlane.h>
#include <OgreRay.h>
#include <geometry_msgs/PoseStamped.h>
#include <rviz/render_panel.h>
#include <rviz/viewport_mouse_event.h>

#include "hand_stream.h"
#include "node_link.h"
#endif

namespace rviz {
class StringProperty;
}

namespace meshless {

constexpr double kWheelStep = 0.005;   // [m] a notch
constexpr double kNotch = 120.0;       // Qt's unit of a notch
constexpr double kAfterStream = 0.15;  // [s] a message of the stream that comes after a lifting brings the tool back

class HandTool : public rviz::Tool {
  Q_OBJECT

 public:
  explicit HandTool(char shortcut_key);
  ~HandTool() override;

  void onInitialize() override;
  void activate() override;
  void deactivate() override;
  void update(float wall_dt, float ros_dt) override;
  int processMouseEvent(rviz::ViewportMouseEvent& event) override;
  int processKeyEvent(QKeyEvent* event, rviz::RenderPanel* panel) override;
  /// Escape undoes the present drag; without a drag rviz has it. The tool's own key keeps it: rviz would put it away.
  bool eventFilter(QObject* object, QEvent* event) override;

 protected:
  struct Hover {
    bool over = false;  // tissue
    QString body;
    Ogre::Vector3 position = Ogre::Vector3::ZERO;
    Ogre::Vector3 normal = Ogre::Vector3::UNIT_Z;
  };

  // --- of each tool
  /// False: the camera has the event.
  virtual bool onMouse(rviz::ViewportMouseEvent& event) = 0;
  virtual bool onKey(int key);
  virtual void onActivate() {}
  virtual void onDeactivate() {}
  virtual void onUpdate(double dt) { (void)dt; }
  virtual bool dragging() const = 0;
  virtual void undoDrag() = 0;
  /// Whether it matters now what tissue is under the cursor.
  virtual bool looksForTissue() const { return !dragging(); }
  /// What the buttons do now.
  virtual QString help() const = 0;
  virtual void nodeChanged() {}
  virtual void stateCame(const meshless_surgery::State& state) { (void)state; }
  virtual void eventCame(const meshless_surgery::Event& event) { (void)event; }

  // --- for each tool
  NodeLink& link() { return *link_; }
  /// Hushed when the tool is put away.
  HandStream& stream() { return stream_; }
  const Ogre::Ray& ray() const { return ray_; }
  const Hover& hover() const { return hover_; }
  bool seen() const { return seen_; }
  bool isActive() const { return active_; }
  /// Where the camera looks, and which way it is turned.
  Ogre::Vector3 viewDirection() const;
  Ogre::Quaternion viewOrientation() const;
  /// An instrument in the hand reaches along its x, from the lower right into the view; its jaws open in the picture.
  Ogre::Quaternion instrumentTurn() const;
  /// The cursor's ray and the plane through `point` that faces along `normal`; `point` where they do not meet.
  Ogre::Vector3 onPlane(const Ogre::Vector3& normal, const Ogre::Vector3& point) const;
  /// Of the cursor since the event before [px].
  int pixelsRight() const { return x_ - last_x_; }
  int pixelsDown() const { return y_ - last_y_; }
  /// The same in the plane through a place that faces the camera as it is now; in one before the camera where the
  /// place is at it, as it is where the camera goes along.
  Ogre::Vector3 cursorWay(const Ogre::Vector3& place) const;
  /// Distance on the screen between the cursor and a point; infinite where it is behind the camera.
  double pixelsTo(const Ogre::Vector3& point) const;
  geometry_msgs::PoseStamped poseMessage(const Ogre::Vector3& position,
                                         const Ogre::Quaternion& orientation = Ogre::Quaternion::IDENTITY) const;
  std_msgs::Header header() const;
  /// The node's world frame in the fixed one; the same where it is not known (yet).
  void worldPose(Ogre::Vector3& origin, Ogre::Quaternion& turn) const;
  /// From the node's world frame.
  Ogre::Vector3 toFixed(const geometry_msgs::Point& point) const;
  Ogre::Vector3 toFixed(const geometry_msgs::Vector3& direction) const;
  /// Shown in the status line for some seconds, before the help.
  void say(const QString& note);
  void showStatus();
  void clearSprings();

 private Q_SLOTS:
  void updateNode();

 private:
  void listenTo(rviz::RenderPanel* panel);
  Ogre::Ray rayThrough(int x, int y) const;
  void probe();
  void showCursor();

  NodeLink* link_ = nullptr;
  HandStream stream_;
  rviz::StringProperty* node_property_ = nullptr;
  QPointer<rviz::RenderPanel> panel_;  // whose keys come here first
  ros::Subscriber state_, events_;
  std::string world_frame_;  // of the node; empty until it is known
  Ogre::Ray ray_;
  Ogre::Viewport* viewport_ = nullptr;
  int x_ = 0, y_ = 0, last_x_ = 0, last_y_ = 0;  // of the cursor [px], and of the event before
  bool active_ = false;
  bool seen_ = false;         // the cursor is in the view, so that there is a ray
  bool probing_ = false;      // one question at a time
  double since_probe_ = 1.0;  // [s]
  bool moved_ = false;
  Hover hover_;
  QString note_;
  double note_left_ = 0.0;  // [s]
};

}  // namespace meshless
