#include "tool_motion.h"

#include <algorithm>
#include <sstream>

namespace meshless {

Status ToolMotion::hear(const Pose& wanted, double stamp, double now) {
  keepAlive(now);
  if (stamp > 0.0 && order_.hear(stamp, now) == StampOrder::Is::kLate) {
    std::ostringstream text;
    text << "header.stamp is " << order_.newest() - stamp
         << " s older than that of the newest message, which came less than " << StampOrder::kLongestLate
         << " s ago; accepted: stamps that grow";
    return Error{ErrorCode::kInvalidArgument, text.str()};
  }
  way_ = Way();
  if (alive_) {
    way_.length = (wanted.translation - wanted_.translation).norm();
    way_.time = stamp > 0.0 && stamp_ > 0.0 && stamp >= stamp_ ? stamp - stamp_ : now - heard_;
  }
  wanted_ = wanted;
  stamp_ = stamp;
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

void ToolMotion::keepAlive(double now) {
  looked_ = now;
  silent_ = 0.0;
}

bool ToolMotion::fellSilent(double now) {
  silent_ += std::min(now - looked_, kLongestTick);
  looked_ = now;
  if (!alive_ || !(limits_.silence > 0.0) || !(silent_ > limits_.silence)) return false;
  end();
  return true;
}

void ToolMotion::advance(double now) {
  const double dt = std::min(now - advanced_, kLongestTick);
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

void ToolMotion::halt(const Vec3& place) {
  pose_.translation = place;
  wanted_ = pose_;
  arrived_ = true;
}

void ToolMotion::end() {
  alive_ = false;
  order_ = StampOrder();
}

void ToolMotion::putAt(const Vec3& place) {
  pose_.translation = place;
  arrived_ = false;
}

}  // namespace meshless
