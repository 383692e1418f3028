// Shows a node's world: smooth bodies with cut faces in their inside colour, springs by force, sphere and scissors.
#pragma once

#include <rviz/display.h>

#ifndef Q_MOC_RUN
#include <map>
#include <memory>
#include <string>
#include <unordered_map>

#include <meshless_surgery/Surfaces.h>
#include <meshless_surgery/TissueImages.h>
#include <meshless_surgery/Topology.h>
#include <ros/ros.h>

#include "between_states.h"
#include "body_shape.h"
#include "tissue_textures.h"
#include "tools_shape.h"
#endif

namespace rviz {
class BoolProperty;
class EnumProperty;
class FloatProperty;
class StringProperty;
}  // namespace rviz

namespace meshless {

/// What a display has heard last on the topic; null where none listens to it. A tool that begins to listen where a
/// display does shares its connection, and would hear nothing of a world that stands still.
meshless_surgery::Surfaces::ConstPtr shownSurfaces(const std::string& topic);

class TissueDisplay : public rviz::Display {
  Q_OBJECT

 public:
  TissueDisplay();
  ~TissueDisplay() override;

  void update(float wall_dt, float ros_dt) override;
  void reset() override;

 protected:
  void onEnable() override;
  void onDisable() override;

 private Q_SLOTS:
  void listen();
  void changeLook();

 private:
  void draw();
  void move(float wall_dt);
  void showTools();
  /// Of the bodies that are shown, by their ids; empty where it has not come.
  bool findPatterns();
  void warnOfSize();
  ShadowTips shadowTips() const;

  rviz::StringProperty* node_;
  rviz::EnumProperty* colour_;
  rviz::FloatProperty* full_strain_;
  rviz::FloatProperty* opacity_;
  rviz::BoolProperty* wire_;
  rviz::BoolProperty* shine_;
  rviz::BoolProperty* smooth_;
  rviz::BoolProperty* tools_shown_;
  rviz::FloatProperty* full_force_;
  rviz::BoolProperty* shadows_;
  ros::Subscriber subscriber_, topology_subscriber_, images_subscriber_;
  std::string topic_;
  meshless_surgery::Surfaces::ConstPtr surfaces_;
  meshless_surgery::Topology::ConstPtr topology_, next_topology_;  // of what is shown, and the last that has come
  std::unordered_map<std::uint32_t, const meshless_surgery::BodyTopology*> patterns_;  // of topology_, by the body's id
  TissueTextures textures_;
  std::uint32_t images_taken_ = 0;
  float waited_ = 0.0f;  // [s] for the topology of surfaces_
  bool fresh_ = false;
  meshless_surgery::Surfaces::ConstPtr drawn_;                        // the last message that was
  meshless_surgery::Surfaces tools_from_, tools_to_, tools_between_;  // without bodies
  Pace pace_;
  std::map<std::uint32_t, std::unique_ptr<BodyShape>> bodies_;
  std::unique_ptr<ToolsShape> tools_;
};

}  // namespace meshless
