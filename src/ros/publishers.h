// Everything that the node says by itself: topics, tf and diagnostics, on a thread of its own. A snapshot is asked for
// only where someone listens, and made into messages outside of the runner's thread.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>

#include <diagnostic_updater/diagnostic_updater.h>
#include <geometry_msgs/PoseStamped.h>
#include <meshless_surgery/Info.h>
#include <ros/node_handle.h>
#include <tf2_ros/transform_broadcaster.h>

#include "force_stream.h"
#include "instruments.h"
#include "markers.h"
#include "moving_surfaces.h"
#include "named_instruments.h"
#include "rejections.h"
#include "runner.h"
#include "settings.h"
#include "stillness.h"
#include "streamed_tools.h"

namespace meshless {

/// Level and message of the diagnostics: an error where a step has failed, a warning where time falls behind.
void summarize(const RunnerStatus& runner, std::uint64_t overruns_before,
               diagnostic_updater::DiagnosticStatusWrapper& status);

class Publishers {
 public:
  Publishers(const ros::NodeHandle& private_handle, const NodeSettings& settings, WorldRunner& runner,
             const StreamedTools& tools, NamedInstruments* named, const Rejections& rejections);
  ~Publishers();
  void start();
  void stop();

  /// The runner's event sink.
  void queueEvents(std::vector<Event> events);

 private:
  using Clock = std::chrono::steady_clock;
  struct Cadence {  // when something is due
    Clock::duration period{};
    Clock::time_point next{};
    bool due(Clock::time_point now);
  };

  void loop();
  void publishEvents();
  void publishTick(Clock::time_point now);
  void publishInfo(const WorldSnapshot& snapshot, const std_msgs::Header& header);
  void publishTopology(const WorldSnapshot& snapshot, const std_msgs::Header& header);
  void publishSurfaces(const WorldSnapshot& snapshot, const std_msgs::Header& header,
                       const std::vector<meshless_surgery::InstrumentPart>& instruments);
  void publishTools(const WorldSnapshot& snapshot, const ros::Time& stamp);
  struct Shown {  // where a tool is, and where it was told to go
    Pose measured, setpoint;
  };
  void publishTool(ToolKind tool, const std::optional<Shown>& shown, const ros::Time& stamp,
                   std::vector<geometry_msgs::TransformStamped>& transforms);
  void publishJaw(const Scissors& scissors, const ros::Time& stamp);
  void publishConditions(const WorldSnapshot& snapshot, const ros::Time& stamp);
  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& status);

  NodeSettings settings_;
  WorldRunner& runner_;
  const StreamedTools& tools_;
  NamedInstruments* const named_;  // null: they have no topics
  const Rejections& rejections_;
  MarkerBuilder markers_;
  MovingSurfaces moving_;
  Instruments instruments_;
  Stillness markers_still_, surfaces_still_, points_still_;

  ros::Publisher topology_topic_, images_topic_, vertices_topic_;
  ros::Publisher clusters_topic_, collision_topic_, contacts_topic_, contact_forces_topic_, surfaces_topic_, strained_surfaces_topic_;
  ros::Publisher markers_topic_, obstacles_topic_, points_topic_, state_topic_, events_topic_, info_topic_;
  struct ToolTopics {
    ros::Publisher measured, setpoint, state;
    bool there = false;      // as was said last
    std::string said_state;  // empty: not yet
    bool said_busy = false;
  };
  PerTool<ToolTopics> tool_topics_;
  ros::Publisher jaw_topic_;
  bool jaw_there_ = false;
  tf2_ros::TransformBroadcaster broadcaster_;
  diagnostic_updater::Updater updater_;

  Cadence vertices_due_, complete_due_;
  std::atomic<bool> vertices_newcomer_{false};
  std::uint64_t vertices_revision_ = 0, vertices_built_ = 0;
  Cadence surfaces_due_, clusters_due_, collision_due_, contacts_due_;
  std::atomic<bool> surfaces_newcomer_{false}, clusters_newcomer_{false}, collision_newcomer_{false},
      contacts_newcomer_{false}, contact_forces_newcomer_{false};
  std::uint64_t clusters_revision_ = 0, clusters_built_ = 0;
  std::uint64_t collision_revision_ = 0, collision_built_ = 0;
  std::uint64_t contacts_revision_ = 0, contact_forces_revision_ = 0, contacts_built_ = 0;
  std::uint64_t surfaces_revision_ = 0, surfaces_built_ = 0;
  meshless_surgery::Info info_;                                // as it was said last
  std::vector<std::shared_ptr<const ObstacleDef>> obstacles_;  // likewise
  std::uint64_t info_revision_ = 0;
  Cadence info_due_, markers_due_, points_due_, state_due_, tools_due_, diagnostics_due_;
  std::atomic<bool> markers_newcomer_{false}, points_newcomer_{false};
  std::uint64_t markers_revision_ = 0, points_revision_ = 0;
  ros::Time last_transforms_;
  std::uint64_t diagnosed_overruns_ = 0;
  std::uint64_t markers_built_ = 0, points_built_ = 0, states_built_ = 0;  // stay at 0 while nobody listens

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Event> events_;
  std::uint64_t lost_events_ = 0;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace meshless
