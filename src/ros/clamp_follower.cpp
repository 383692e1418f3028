#include "clamp_follower.h"

#include <ros/console.h>

#include "border_check.h"

namespace meshless {
namespace {

constexpr double kPeriod = 0.01;         // [s] between two looks at tf
constexpr double kTime = 0.03;           // [s] in which tissue goes where its frame is
constexpr double kMoved = 1e-6;          // [m], and rad: less is no motion
constexpr double kSayAgain = 1.0;        // [s] for bodies that were put back
constexpr double kPatience = 3.0;        // [s] for a frame to come
constexpr double kComplainEvery = 10.0;  // [s]

double now() { return ros::SteadyTime::now().toSec(); }

}  // namespace

ClampFollower::ClampFollower(const ros::NodeHandle& handle, std::vector<Followed> followed, WorldRunner& runner,
                             Frames& frames)
    : followed_(std::move(followed)), runner_(runner), frames_(frames), missing_since_(now()) {
  if (followed_.empty()) return;
  timer_ = handle.createSteadyTimer(ros::WallDuration(kPeriod), [this](const ros::SteadyTimerEvent&) { look(); });
}

void ClampFollower::stop() { timer_.stop(); }

void ClampFollower::look() {
  std::map<std::string, Pose> found;
  const Followed* missing = nullptr;
  for (const Followed& one : followed_) {
    if (found.count(one.frame)) continue;
    if (const auto pose = frames_.latest(one.frame))
      found[one.frame] = pose->pose;
    else
      missing = &one;
  }
  if (!missing) missing_since_ = now();
  if (now() - missing_since_ > kPatience)
    ROS_WARN_STREAM_THROTTLE(kComplainEvery, "body " << missing->body << ": entry " << missing->clamp
                                                     << " of `fixed` follows the frame '" << printable(missing->frame)
                                                     << "', which tf does not know; it stays where it is");
  if (!found.empty()) runner_.post([this, found = std::move(found)](World& world) { follow(world, found); });
}

void ClampFollower::follow(World& world, const std::map<std::string, Pose>& found) {
  if (clamps_.empty() || world.run() != run_) clamps_.assign(followed_.size(), std::nullopt);
  run_ = world.run();
  const double time = now();
  for (std::size_t n = 0; n < followed_.size(); ++n) {
    const Followed& one = followed_[n];
    const auto at = found.find(one.frame);
    if (at == found.end()) continue;
    const Pose& frame = at->second;
    if (!clamps_[n]) {
      clamps_[n] = Clamp{frame, world.clampMotion(one.body, one.clamp), frame};
      continue;
    }
    Clamp& clamp = *clamps_[n];
    const bool moved = (frame.translation - clamp.said.translation).norm() > kMoved ||
                       frame.rotation.angularDistance(clamp.said.rotation) > kMoved;
    if (!moved && time - clamp.said_at < kSayAgain) continue;
    clamp.said = frame;
    clamp.said_at = time;
    const Quat turn = (frame.rotation * clamp.frame.rotation.conjugate()).normalized();
    MoveClampCommand command;
    command.body = one.body;
    command.clamp = one.clamp;
    command.turn = (turn * clamp.motion.rotation).normalized();
    command.shift = frame.translation + turn * (clamp.motion.translation - clamp.frame.translation);
    command.time = kTime;
    command.streamed = true;
    if (const auto done = world.apply(command); !done.ok())
      ROS_WARN_STREAM_THROTTLE(kComplainEvery, "body " << one.body << ", which follows the frame '"
                                                       << printable(one.frame) << "': " << done.error().detail);
  }
}

}  // namespace meshless
