#include "frames.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <map>
#include <stdexcept>
#include <thread>

#include <ros/callback_queue.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <tf2/buffer_core.h>
#include <tf2/exceptions.h>
#include <tf2_eigen/tf2_eigen.h>
#include <tf2_msgs/TFMessage.h>

#include "border_check.h"
#include "meshless_surgery/base/number_text.h"
#include "stamp_order.h"

namespace meshless {
namespace {

using SteadyClock = std::chrono::steady_clock;
constexpr std::chrono::milliseconds kWait(200);
constexpr std::chrono::milliseconds kFirstWait(500);  // static transforms come with the connection
constexpr std::chrono::milliseconds kPoll(5);
constexpr double kWarnEvery = 5.0;  // [s]

Pose toPose(const geometry_msgs::TransformStamped& transform) {
  Pose pose;
  tf2::fromMsg(transform.transform.translation, pose.translation);
  tf2::fromMsg(transform.transform.rotation, pose.rotation);
  pose.rotation.normalize();
  return pose;
}

}  // namespace

std::string prefixed(const std::string& prefix, const std::string& frame) {
  if (prefix.empty()) return frame;
  return prefix.back() == '/' ? prefix + frame : prefix + "/" + frame;
}

std::string withoutSlash(const std::string& frame) {
  const std::size_t first = frame.find_first_not_of('/');
  return first == std::string::npos ? std::string() : frame.substr(first);
}

/// As tf2_ros::TransformListener. But tf2 takes the newest stamp for the latest, and what is 10 s older it does not
/// take at all: a frame whose sender's clock is set back, or was wrong once, would stand still for as long.
struct Frames::Listener {
  explicit Listener(const Clock& clock_in) : clock(clock_in) {
    handle.setCallbackQueue(&queue);
    subscribers = {handle.subscribe("/tf", kQueue, &Listener::hear, this),
                   handle.subscribe("/tf_static", kQueue, &Listener::hearStatic, this)};
    spinner.start();
  }

  using Heard = ros::MessageEvent<const tf2_msgs::TFMessage>;
  void hear(const Heard& heard) {
    for (const geometry_msgs::TransformStamped& transform : heard.getMessage()->transforms) {
      Frame& frame = frames[withoutSlash(transform.child_frame_id)];
      const double before = frame.order.newest(), stamp = transform.header.stamp.toSec();
      if (stamp > 0.0 && frame.order.hear(stamp, clock.now()) == StampOrder::Is::kAnew) {
        ROS_WARN_STREAM_THROTTLE(kWarnEvery, "tf: the stamps of '" << printable(transform.child_frame_id)
                                                                   << "' went back by " << before - stamp
                                                                   << " s; those before are forgotten");
        forget(frame);
      }
      frame.last = transform;
      buffer.setTransform(transform, heard.getPublisherName(), false);
    }
  }
  void hearStatic(const Heard& heard) {
    for (const geometry_msgs::TransformStamped& transform : heard.getMessage()->transforms)
      buffer.setTransform(transform, heard.getPublisherName(), true);
  }

  struct Frame {
    StampOrder order;
    geometry_msgs::TransformStamped last;  // as it came
  };
  /// tf2 can only forget all that moves: the others are said again.
  void forget(const Frame& gone) {
    buffer.clear();
    for (const auto& [name, frame] : frames)
      if (&frame != &gone) buffer.setTransform(frame.last, "", false);
  }

  static constexpr std::uint32_t kQueue = 100;  // messages
  const Clock& clock;
  tf2::BufferCore buffer;
  const SteadyClock::time_point since = SteadyClock::now();
  std::map<std::string, Frame> frames;  // of the spinner's thread, by child
  ros::NodeHandle handle;
  ros::CallbackQueue queue;
  std::array<ros::Subscriber, 2> subscribers;
  ros::AsyncSpinner spinner{1, &queue};
};

namespace {

// A frame that is known, but not at that stamp.
std::optional<Error> knownAtOtherTimes(const tf2::BufferCore& buffer, const std::string& world,
                                       const std::string& frame, const ros::Time& stamp) {
  if (stamp.isZero() || !buffer.canTransform(world, frame, ros::Time(0))) return std::nullopt;
  try {
    const double newest = buffer.lookupTransform(world, frame, ros::Time(0)).header.stamp.toSec();
    const double ahead = stamp.toSec() - newest;
    const std::string way = ahead > 0.0 ? numberText(ahead, 3) + " s ahead of" : numberText(-ahead, 3) + " s before";
    return Error{ErrorCode::kUnknownName,
                 "header.stamp is " + way + " the newest transform of '" + printable(frame) + "' to '" + world +
                     "', and tf2 knows none of that time; accepted: " + "a stamp that it knows, or 0 for the newest"};
  } catch (const tf2::TransformException&) {
    return std::nullopt;
  }
}

}  // namespace

Frames::Frames(std::string world_frame, const Clock& clock) : world_frame_(std::move(world_frame)), clock_(clock) {}
Frames::~Frames() = default;

bool Frames::isWorld(const std::string& frame) const { return frame.empty() || frame == world_frame_; }

bool Frames::listening() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return listener_ != nullptr;
}

Frames::Listener& Frames::listener() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!listener_) listener_ = std::make_unique<Listener>(clock_);
  return *listener_;
}

Result<Pose> Frames::lookUp(const std_msgs::Header& header) {
  const std::string frame = withoutSlash(header.frame_id);
  if (isWorld(frame)) return Pose{};
  Listener& tf = listener();
  std::string why;
  try {
    if (tf.buffer.canTransform(world_frame_, frame, header.stamp, &why)) {
      const Pose pose = toPose(tf.buffer.lookupTransform(world_frame_, frame, header.stamp));
      if (pose.translation.allFinite() && pose.rotation.coeffs().allFinite()) return pose;
      why = "its transform is not finite";
    }
  } catch (const std::runtime_error& e) {  // tf2's, and of a stamp that is decades away from what it knows
    why = e.what();
  }
  if (const std::optional<Error> other = knownAtOtherTimes(tf.buffer, world_frame_, frame, header.stamp)) return *other;
  return Error{ErrorCode::kUnknownName, "header.frame_id is '" + printable(header.frame_id) +
                                            "'; accepted: a frame that tf2 can bring to '" + world_frame_ +
                                            "', or empty for it" + (why.empty() ? "" : " (tf2: " + why + ")")};
}

SteadyClock::time_point Frames::waitEnd() const {
  const auto end = SteadyClock::now() + kWait;
  const std::lock_guard<std::mutex> lock(mutex_);
  return listener_ ? std::max(end, listener_->since + kFirstWait) : SteadyClock::now() + kFirstWait;
}

Result<Pose> Frames::toWorld(const std_msgs::Header& header) {
  // Each that waits holds a thread that others may need.
  struct Turn {
    std::atomic<int>& count;
    const bool may_wait = ++count <= kMostWaiting;
    ~Turn() { --count; }
  } turn{waiting_};
  const auto end = turn.may_wait ? waitEnd() : SteadyClock::now();
  // Waits on the wall clock: a simulated one may stand still.
  while (true) {
    const auto pose = lookUp(header);
    if (pose.ok() || SteadyClock::now() >= end || !ros::ok()) return pose;
    std::this_thread::sleep_for(kPoll);
  }
}

std::optional<Frames::Stamped> Frames::latest(const std::string& frame_id) {
  const std::string frame = withoutSlash(frame_id);
  if (isWorld(frame)) return Stamped{};
  Listener& tf = listener();
  try {
    const auto transform = tf.buffer.lookupTransform(world_frame_, frame, ros::Time(0));
    const Pose pose = toPose(transform);
    if (pose.translation.allFinite() && pose.rotation.coeffs().allFinite())
      return Stamped{pose, transform.header.stamp};
  } catch (const tf2::TransformException&) {  // not known yet
  }
  return std::nullopt;
}

}  // namespace meshless
