// The node's parameters, all private to it.
#pragma once

#include <ros/node_handle.h>

#include "runner.h"

namespace meshless {

struct ToolSettings {
  std::string follow_frame;  // tools/T/follow_frame: a tf frame that the tool follows; empty: the topic ~T/servo_cp
};

struct NodeSettings {
  std::string world_frame = "world";
  std::string tf_prefix;                   // before the published frames' names, with a slash between
  std::string scene = "liver";             // a name in config/scenes, a path or package://
  std::string task;                        // a name in config/tasks or a path; then the scene is the task's; empty: none
  std::string trainee;                     // for its report
  std::vector<std::string> data_folders;   // below which mesh files may be read, besides the package and the scene
  std::string session_directory;           // files are written below it; empty: meshless_surgery below ROS's own folder
  std::string command_log;                 // a file's name there; empty: no log
  double autosave_period = 0.0;            // [s] of simulated time, 0 (none) or 0.05..3600
  bool paused = false;                     // start paused
  bool publish_clock = false;              // the simulated time is /clock; /use_sim_time has to be set
  double max_backlog = 0.1;                // [s] 0..10
  double markers_rate = 30.0;              // [Hz] 0.1..30
  double surfaces_rate = 60.0;             // [Hz] 0.1..120: ~surfaces and ~strained_surfaces
  double vertices_rate = 30.0;             // [Hz] 0.1..120: ~vertices
  double points_rate = 30.0;               // [Hz] 0.1..120
  double state_rate = 30.0;                // [Hz] 0.1..1000
  double tools_rate = 60.0;                // [Hz] 0.1..1000: ~T/measured_cp and tf
  double force_rate = 500.0;               // [Hz] 1..2000: ~T/measured_cf
  ToolSettings pick, push, scissors;
  std::optional<double> pick_max_distance; // tools/pick/max_distance [m]; absent: the scene's
  std::optional<double> pick_stiffness;    // tools/pick/stiffness [N/m]; absent: the scene's
  std::optional<double> push_radius;       // tools/push/radius [m]; absent: the scene's
  double push_max_speed = 1.0;             // tools/push/max_speed [m/s] at which the sphere follows a stream
  double pick_max_speed = 5.0;             // tools/pick/max_speed [m/s] at which the hand follows a stream
  double scissors_max_speed = 5.0;         // tools/scissors/max_speed [m/s]
  double tools_silence = 0.5;              // tools/silence [s] without a message after which a tool is lifted; 0: never
  std::optional<double> scissors_length;   // tools/scissors/length [m] of tracked blades; absent: what fits the scene
  std::optional<double> scissors_width;    // tools/scissors/width [m] of their opening; likewise
};

/// Refuses kInvalidArgument: a wrong type or a value out of range. Parameters that the node does not know are named in
/// `unknown`: they are probably misspelt.
Result<NodeSettings> readNodeSettings(const ros::NodeHandle& private_handle, std::vector<std::string>& unknown);
/// The same of a review node, whose ~log is the command_log.
Result<NodeSettings> readReviewSettings(const ros::NodeHandle& private_handle, std::vector<std::string>& unknown);

}  // namespace meshless
