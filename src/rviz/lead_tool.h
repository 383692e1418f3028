// The mouse leads an instrument of the scene; the others stay where they are.
#pragma once

#include "hand_tool.h"

#ifndef Q_MOC_RUN
#include <vector>

#include <meshless_surgery/InstrumentState.h>
#endif

namespace rviz {
class FloatProperty;
}

namespace meshless {

class LeadTool : public HandTool {
  Q_OBJECT

 public:
  LeadTool();

  void onInitialize() override;

 protected:
  bool onMouse(rviz::ViewportMouseEvent& event) override;
  bool onKey(int key) override;
  void onActivate() override;
  void onDeactivate() override;
  bool dragging() const override { return drag_ == Drag::kMoves; }
  bool looksForTissue() const override { return false; }
  void undoDrag() override;
  QString help() const override;
  void nodeChanged() override;
  void stateCame(const meshless_surgery::State& state) override;
  void eventCame(const meshless_surgery::Event& event) override;

 private:
  enum class Drag {
    kNone,
    kMoves,
    kOver  // undone, the button still down
  };
  struct Hand {
    Ogre::Vector3 at = Ogre::Vector3::ZERO;  // of the tip
    Ogre::Quaternion turn = Ogre::Quaternion::IDENTITY;
  };

  const meshless_surgery::InstrumentState* chosen() const;
  void choose(const std::string& name);
  /// From where the instrument is, unless it is led already. False: there is none.
  bool takeUp();
  void lead();
  void moveJaws();

  rviz::FloatProperty* opening_ = nullptr;
  std::vector<meshless_surgery::InstrumentState> instruments_;
  std::string name_;
  bool leads_ = false;
  bool closed_ = false;      // its jaws
  bool moves_jaws_ = false;  // else they stay as they are wanted, so that they keep what they hold
  Drag drag_ = Drag::kNone;
  Hand hand_, before_;  // now, and when the drag began
  ros::Publisher poses_, jaws_;
};

}  // namespace meshless
