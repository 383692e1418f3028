// Topics of the instruments of a scene, by their names (CRTK): what says where each is wanted, and what says where it
// is and what it feels. They come and go with the instruments.
#pragma once

#include <map>
#include <mutex>

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>

#include "crtk_messages.h"
#include "frames.h"
#include "rejections.h"
#include "runner.h"
#include "settings.h"
#include "stamp_order.h"
#include "streamed_tools.h"

namespace meshless {

class NamedInstruments {
 public:
  NamedInstruments(const ros::NodeHandle& private_handle, const NodeSettings& settings, const Clock& clock,
                   WorldRunner& runner, Frames& frames, Rejections& rejections, StreamedTools& tools);

  ~NamedInstruments();
  /// To be called at the rate at which tools are published, by one thread.
  void publish(const WorldSnapshot& snapshot, const ros::Time& stamp,
               std::vector<geometry_msgs::TransformStamped>& transforms);

 private:
  struct Topics {
    bool has_jaws = false;
    void close();  // no callback runs after it
    ros::Subscriber servo, jaw, command;
    ros::Publisher measured, setpoint, velocity, jaw_state, force, state;
    std::mutex mutex;  // of what follows
    StampOrder order;
    Operating operating = Operating::kEnabled;
    double heard = 0.0;  // [s]
    bool alive = false;  // its stream speaks
    std::string said_state;
    bool said_busy = false;
  };

  void open(const std::string& name, bool has_jaws);
  void onServo(const std::string& name, Topics& topics, const geometry_msgs::PoseStamped& message);
  void onJaw(const std::string& name, Topics& topics, const sensor_msgs::JointState& message);
  void onCommand(const std::string& name, Topics& topics, const std::string& word);
  /// Whether the instrument hears its stream, and that it does.
  bool hears(const std::string& topic, Topics& topics);
  void lead(const std::string& topic, LeadInstrumentCommand command);
  void reject(const std::string& topic, const Error& error);

  ros::NodeHandle handle_;
  const NodeSettings settings_;
  const Clock& clock_;
  WorldRunner& runner_;
  Frames& frames_;
  Rejections& rejections_;
  StreamedTools& tools_;
  std::map<std::string, std::shared_ptr<Topics>> topics_;  // of the publishing thread
};

}  // namespace meshless
