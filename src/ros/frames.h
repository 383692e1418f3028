// Poses of frames in the world frame. tf2 is listened to from the first time that another frame is asked for.
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>

#include <ros/time.h>
#include <std_msgs/Header.h>

#include "clock.h"
#include "meshless_surgery/tools/command.h"

namespace meshless {

/// tf2 knows no slash before a name, tf1 did: /world is world.
std::string withoutSlash(const std::string& frame);
/// PREFIX/frame; frame alone where there is no prefix.
std::string prefixed(const std::string& prefix, const std::string& frame);

class Frames {
 public:
  static constexpr int kMostWaiting = 12;  // callers at once

  /// `clock` outlives it: of the stamps of frames, see StampOrder.
  Frames(std::string world_frame, const Clock& clock);
  ~Frames();

  const std::string& worldFrame() const { return world_frame_; }

  /// Pose of the header's frame in the world frame; the identity for an empty frame_id. A stamp of 0 is the latest.
  /// Waits at most 0.2 s (0.5 s right after listening began) of wall time, and not at all where kMostWaiting others do.
  /// Refuses kUnknownName, naming the frame.
  Result<Pose> toWorld(const std_msgs::Header& header);

  /// The same without waiting, and until when one should wait where it is refused.
  Result<Pose> lookUp(const std_msgs::Header& header);
  std::chrono::steady_clock::time_point waitEnd() const;

  /// The latest pose, without waiting; nothing where tf2 does not know the frame (yet).
  struct Stamped {
    Pose pose;
    ros::Time stamp;  // 0 where nothing of it ever moves
  };
  std::optional<Stamped> latest(const std::string& frame);

  /// False until another frame was asked for: then no tf topic is subscribed to.
  bool listening() const;

 private:
  struct Listener;
  Listener& listener();
  bool isWorld(const std::string& frame) const;

  std::string world_frame_;
  const Clock& clock_;
  mutable std::mutex mutex_;  // for the creation alone: tf2's buffer has its own
  std::unique_ptr<Listener> listener_;
  std::atomic<int> waiting_{0};
};

}  // namespace meshless
