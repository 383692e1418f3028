#include "force_stream.h"

#include <algorithm>
#include <cmath>

namespace meshless {
namespace {

constexpr double kHole = 2.0;             // more ticks than that due at once are a hole ...
constexpr double kLateStep = 3.0;         // ... and so many steps without one
constexpr double kStiffestPush = 5000.0;  // [N/m] of tissue under the sphere

}  // namespace

PerTool<ForceModel::Step> forceSteps(const World& world, const NodeSettings& settings) {
  ForceModel::Step pick;
  pick.pulls = true;
  if (const auto held = world.heldPick()) {
    pick.there = true;
    pick.id = held->id;
    pick.force = -held->force;
    pick.place = held->target;
    pick.stiffest = world.heldStiffness();
    pick.speed = settings.pick_max_speed;
  }
  ForceModel::Step push;
  push.there = world.push().enabled;
  push.force = world.push().force;
  push.place = world.push().position;
  push.stiffest = kStiffestPush;
  push.speed = world.push().streamed ? settings.push_max_speed : 0.0;
  // The blades part the tissue without resistance.
  ForceModel::Step scissors;
  scissors.there = world.scissors().shown;
  return {pick, push, scissors};
}

void ForceStream::stepped(const PerTool<ForceModel::Step>& steps, double dt, double now) {
  if (dt > 0.0) {
    if (now - stepped_at_ > kLateStep * dt) bridge(now, now - stepped_at_);
    stepped_at_ = now;
  }
  for (std::size_t t = 0; t < tools_.size(); ++t) {
    tools_[t].there = steps[t].there;
    tools_[t].force.stepped(steps[t], dt, now);
  }
}

void ForceStream::bridge(double from, double length) {
  for (Tool& tool : tools_) tool.bridge.open(from, std::min(length, kMostLate));
}

std::optional<ForceStream::Tick> ForceStream::next(double now, const PerTool<std::optional<Vec3>>& hands) {
  if (now < next_) return std::nullopt;
  next_ = std::max(next_, now - kMostLate);
  // The last of those that are due is the first that is not bridged: a clock may be told in steps of many ticks.
  const double said = next_ - period_, due = std::floor((now - said) / period_);
  if (due > kHole) bridge(said, (due - 0.5) * period_);
  Tick tick;
  tick.time = next_;
  for (std::size_t t = 0; t < tools_.size(); ++t) {
    Tool& tool = tools_[t];
    // A tool that is gone is heard until its force has gone too.
    if (!tool.there && !hands[t] && tool.force.isZero(next_) && !tool.bridge.isOpen(next_)) continue;
    tick.forces[t] = tool.bridge.across(next_, tool.force.at(next_, hands[t]));
  }
  next_ += period_;
  return tick;
}

}  // namespace meshless
