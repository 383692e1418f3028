#include "between_states.h"

#include <algorithm>

#include "ogre_convert.h"

namespace meshless {
namespace {

constexpr double kLongestInterval = 0.15;  // [s]: after a pause, what is new is shown at once

void move(const geometry_msgs::Point& from, const geometry_msgs::Point& to, double share, geometry_msgs::Point& now) {
  now.x = from.x + share * (to.x - from.x);
  now.y = from.y + share * (to.y - from.y);
  now.z = from.z + share * (to.z - from.z);
}

void move(const std::vector<geometry_msgs::Point>& from, const std::vector<geometry_msgs::Point>& to, double share,
          std::vector<geometry_msgs::Point>& now) {
  if (from.size() != to.size()) return;
  for (std::size_t k = 0; k < to.size(); ++k) move(from[k], to[k], share, now[k]);
}

void move(const geometry_msgs::Quaternion& from, const geometry_msgs::Quaternion& to, float share,
          geometry_msgs::Quaternion& now) {
  now = toQuaternion(Ogre::Quaternion::nlerp(share, toOgre(from), toOgre(to), true));
}

// They are listed tool by tool: where tools came or went, all are where the later message has them.
void move(const std::vector<meshless_surgery::InstrumentPart>& from,
          const std::vector<meshless_surgery::InstrumentPart>& to, float share,
          std::vector<meshless_surgery::InstrumentPart>& now) {
  const auto same_mesh = [](const auto& a, const auto& b) { return a.mesh == b.mesh; };
  if (!std::equal(from.begin(), from.end(), to.begin(), to.end(), same_mesh)) return;
  for (std::size_t k = 0; k < to.size(); ++k) {
    move(from[k].pose.position, to[k].pose.position, share, now[k].pose.position);
    move(from[k].pose.orientation, to[k].pose.orientation, share, now[k].pose.orientation);
  }
}

}  // namespace

void moveTools(const meshless_surgery::Surfaces& from, const meshless_surgery::Surfaces& to, float share,
               meshless_surgery::Surfaces& between) {
  for (std::size_t k = 0; k < to.picks.size(); ++k) {
    const auto before = std::find_if(from.picks.begin(), from.picks.end(),
                                     [&](const auto& pick) { return pick.pick_id == to.picks[k].pick_id; });
    if (before == from.picks.end()) continue;
    move(before->position, to.picks[k].position, share, between.picks[k].position);
    move(before->target, to.picks[k].target, share, between.picks[k].target);
  }
  if (from.push_shown && to.push_shown) move(from.push_position, to.push_position, share, between.push_position);
  if (from.scissors_shown && to.scissors_shown) {
    move(from.scissors.position, to.scissors.position, share, between.scissors.position);
    move(from.scissors.orientation, to.scissors.orientation, share, between.scissors.orientation);
    between.scissors_angle = from.scissors_angle + share * (to.scissors_angle - from.scissors_angle);
  }
  move(from.fibres, to.fibres, share, between.fibres);
  move(from.clips, to.clips, share, between.clips);
  move(from.instruments, to.instruments, share, between.instruments);
}

bool Pace::next(double interval) {
  const bool follows = interval > 0.0 && interval <= kLongestInterval;
  interval_ = follows ? interval : 0.0;
  passed_ = 0.0;
  return follows;
}

float Pace::go(double seconds) {
  passed_ += seconds;
  const float share = moving() ? static_cast<float>(passed_ / interval_) : 1.0f;
  if (share == 1.0f) passed_ = interval_;
  return share;
}

}  // namespace meshless
