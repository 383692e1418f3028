#include "meshless_surgery/ros/tool_motion.h"

#include <algorithm>
#include <sstream>

namespace meshless {
namespace {

constexpr double kLongestTick = 0.05;  // [s] that one call makes up for: who comes late does not jump

}  // namespace

Status ToolMotion::hear(const Pose& wanted, double stamp, double now) {
  if (alive_ && stamp > 0.0 && stamp < stamp_ && stamp_ - stamp <= kRestart) {
    std::ostringstream text;
    text << "header.stamp is " << stamp_ - stamp
         << " s older than that of the message before; accepted: stamps that grow";
    return Error{ErrorCode::kInvalidArgument, text.str()};
  }
  wanted_ = wanted;
  if (stamp > 0.0) stamp_ = stamp;
  heard_ = now;
  arrived_ = false;
  if (!alive_) {
    alive_ = true;
    arrived_ = true;
    pose_ = wanted_;
    advanced_ = now;
  }
  return Done{};
}

bool ToolMotion::fellSilent(double now) {
  if (!alive_ || !(limits_.silence > 0.0) || !(now - heard_ > limits_.silence)) return false;
  alive_ = false;
  stamp_ = 0.0;
  return true;
}

void ToolMotion::advance(double now) {
  const double dt = std::clamp(now - advanced_, 0.0, kLongestTick);
  advanced_ = now;
  const Vec3 way = wanted_.translation - pose_.translation;
  const double angle = pose_.rotation.angularDistance(wanted_.rotation);
  // Both at once, so that it arrives turned as it should be.
  double share = 1.0;
  if (way.norm() > limits_.speed * dt) share = limits_.speed * dt / way.norm();
  if (angle > limits_.turn_speed * dt) share = std::min(share, limits_.turn_speed * dt / angle);
  arrived_ = !(share < 1.0);
  if (arrived_) {
    pose_ = wanted_;
    return;
  }
  pose_.translation += share * way;
  pose_.rotation = pose_.rotation.slerp(share, wanted_.rotation);
}

void ToolMotion::putAt(const Vec3& place) {
  pose_.translation = place;
  arrived_ = false;
}

}  // namespace meshless
