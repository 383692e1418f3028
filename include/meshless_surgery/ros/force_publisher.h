// ~T/measured_cf at a rate of its own, whatever the step rate: for hands that feel. Sleeps while nobody listens.
#pragma once

#include <array>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

#include <ros/node_handle.h>

#include "meshless_surgery/ros/force_model.h"
#include "meshless_surgery/ros/hole_bridge.h"
#include "meshless_surgery/ros/settings.h"
#include "meshless_surgery/ros/tool_inputs.h"

namespace meshless {

class ForcePublisher {
 public:
  ForcePublisher(const ros::NodeHandle& private_handle, const NodeSettings& settings, const ToolInputs& inputs);
  ~ForcePublisher();
  void start();
  void stop();

  /// The runner's step sink: puts the forces aside. `dt` [s] is what the step simulated; 0 where the world changed
  /// without one.
  void changed(const World& world, double dt);

 private:
  struct Tool {
    ros::Publisher topic;
    bool there = false;
    ForceModel force;  // on the tool
    HoleBridge<Vec3> bridge{Vec3::Zero()};
  };

  void loop();
  void bridge(double from, double length);
  bool listened() const;
  void publish(Tool& tool, const std::optional<Pose>& hand, double now, const ros::Time& stamp);

  const std::string world_frame_;
  const double period_;                           // [s]
  const double pick_max_speed_, push_max_speed_;  // [m/s]
  const ToolInputs& inputs_;
  mutable std::mutex mutex_;
  std::condition_variable woken_;
  std::array<Tool, 3> tools_;  // pick, push, scissors
  double stepped_at_ = 0.0;    // [s]
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace meshless
