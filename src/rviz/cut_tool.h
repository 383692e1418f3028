// Scissors under the cursor, and with Ctrl a scalpel.
#pragma once

#include "hand_tool.h"

#ifndef Q_MOC_RUN
#include <memory>
#include <optional>
#include <vector>

#include <meshless_surgery/Incise.h>
#include <meshless_surgery/Probe.h>
#include <meshless_surgery/Surfaces.h>
#include <ros/time.h>
#include <rviz/ogre_helpers/billboard_line.h>

#include "cut_preview.h"
#include "instruments_shape.h"
#endif

namespace rviz {
class FloatProperty;
}

namespace meshless {

class CutTool : public HandTool {
  Q_OBJECT

 public:
  CutTool();

  void onInitialize() override;

 protected:
  bool onMouse(rviz::ViewportMouseEvent& event) override;
  bool onKey(int key) override;
  void onActivate() override;
  void onDeactivate() override;
  void onUpdate(double dt) override;
  bool dragging() const override { return act_ == Act::kClosing || act_ == Act::kTurning || act_ == Act::kDrawing; }
  bool looksForTissue() const override { return act_ == Act::kNone || act_ == Act::kDrawing; }
  void undoDrag() override;
  QString help() const override;
  void nodeChanged() override;
  void eventCame(const meshless_surgery::Event& event) override;

 private:
  enum class Act {
    kNone,
    kClosing,  // the left button holds the blades closing, or closed
    kTurning,  // shift and left
    kDrawing,  // control and left: an incision
    kOver      // undone, the button still down
  };
  /// Where the tissue was met along the scalpel's line.
  struct Touch {
    Ogre::Vector3 position = Ogre::Vector3::ZERO;
    Ogre::Vector3 normal = Ogre::Vector3::UNIT_Z;
  };

  void follow();
  Ogre::Vector3 pivot() const;
  /// In the node's world frame, of the node's size; none while the node has no scissors.
  std::optional<PreviewBlades> blades() const;
  void sayBlades();
  void cut();
  void showPreview();
  void putAway();
  void turn(int dx, int dy);
  void draw();
  void showLine();
  void finishLine();
  void incise(const Touch& end);

  Act act_ = Act::kNone;
  double angle_;           // [rad] between the blades
  bool lifted_ = true;     // the node has no scissors of ours
  bool placed_ = false;    // the cursor has been over tissue
  double length_ = 0.0;    // [m] of the node's blades, once it has taken them up
  double pushed_ = 0.0;    // lengths that the wheel has moved the blades along themselves
  double depth_ = 0.015;   // [m] of an incision
  Ogre::Quaternion turn_;  // of the blades, in the camera's frame
  Ogre::Vector3 plane_point_ = Ogre::Vector3::ZERO;
  Ogre::Vector3 place_ = Ogre::Vector3::ZERO;  // under the cursor, where their middle is
  Ogre::Quaternion orientation_;
  std::vector<Touch> line_;
  rviz::FloatProperty* close_time_ = nullptr;
  ros::WallTime pressed_;
  ros::Publisher poses_, jaws_;
  std::unique_ptr<rviz::BillboardLine> shown_line_;
  std::unique_ptr<InstrumentsShape> scalpel_;
  ros::Subscriber surfaces_topic_;  // while the tool is in hand
  meshless_surgery::Surfaces::ConstPtr surfaces_;
  std::unique_ptr<CutPreview> preview_;
};

}  // namespace meshless
