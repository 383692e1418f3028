// ~T/measured_cf at a rate of its own: for haptic devices. Sleeps while nobody listens.
#pragma once

#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

#include <ros/node_handle.h>

#include "force_stream.h"
#include "streamed_tools.h"

namespace meshless {

class ForcePublisher {
 public:
  ForcePublisher(const ros::NodeHandle& private_handle, const NodeSettings& settings, const Clock& clock,
                 const StreamedTools& tools);
  ~ForcePublisher();
  void start();
  void stop();

  /// The runner's step sink: puts the forces aside. `dt` [s] is what the step simulated; 0 where the world changed
  /// without one.
  void changed(const World& world, double dt);

 private:
  void loop();
  bool listened() const;

  const NodeSettings settings_;
  const Clock& clock_;
  const StreamedTools& tools_;
  PerTool<ros::Publisher> topics_;
  std::mutex mutex_;
  std::condition_variable woken_;
  ForceStream stream_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace meshless
