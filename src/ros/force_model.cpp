#include "force_model.h"

#include <algorithm>
#include <cmath>

namespace meshless {
namespace {

constexpr double kSmoothing = 0.003;    // [s] streams come in jumps: 200 Hz are as many
constexpr double kPayBackSteps = 2.0;   // of slower motion the force is the steps'; of faster one it comes at once
constexpr double kFarthest = 0.02;      // [m] before the tool
constexpr double kMemory = 0.75;        // of what was learned, kept a step
constexpr double kShortWay = 1e-4;      // [m] ways below it teach little
constexpr double kFadeSteps = 4.0;      // after a spring is let go, for what is to be paid back
constexpr double kMoreShare = 0.5;      // of the force that a tool without a spring has anyway ...
constexpr double kLessShare = 0.9;      // ... and what may be taken from it
constexpr double kLateSteps = 3.0;      // without a step for so many, the world stands still or is too slow to foresee
constexpr double kShortestStep = 1e-3;  // [s] to divide by
constexpr double kLongestTick = 0.05;   // [s]

Vec3 withinLength(const Vec3& v, double length) {
  const double norm = v.norm();
  return norm > length ? Vec3(v * (length / norm)) : v;
}

}  // namespace

void ForceModel::stepped(const Step& step, double dt, double now) {
  const bool came = step.there && (!step_.there || step.id != step_.id);
  const bool went = !step.there && step_.there;
  if (!(dt > 0.0) && !came && !went) return;
  if (!step.there && !step_.there) return;  // it fades, or has done so
  if (dt > 0.0) dt_ = dt;
  const Step before = step_;
  step_ = step;
  if (!step.there) {
    step_.pulls = before.pulls;
    // Gone between two steps: the force of the last one goes on until the next is due.
    leaves_ = dt > 0.0 ? now : std::max(now, stepped_at_ + dt_);
    return;
  }
  leaves_.reset();
  if (came) {
    place_.set(step.place);
    work_ = way_squared_ = 0.0;
    learned_ = false;
  } else {
    learn(step.force - before.force, step.place - before.place);
  }
  // The stiffness of a spring is known before it is measured; that of what is pushed is not.
  const double known = step.pulls ? step.stiffest : 0.0;
  const double measured = std::clamp(work_ / (way_squared_ + kShortWay * kShortWay), 0.0, step.stiffest);
  force_.stepped(step.force, dt_, now);
  place_.stepped(step.place, dt_, now);
  stiffness_.stepped(learned_ ? measured : known, dt_, now);
  share_.stepped(1.0, dt_, now);
  stepped_at_ = now;
}

void ForceModel::fade(double since) {
  leaves_.reset();
  fades_from_ = kMoreShare * force_.at(since).norm();
  force_.stepped(Vec3::Zero(), dt_, since);
  stiffness_.stepped(0.0, dt_, since);
  share_.stepped(0.0, step_.pulls ? kFadeSteps * dt_ : dt_, since);
}

void ForceModel::learn(const Vec3& force_change, const Vec3& way) {
  work_ = kMemory * work_ - force_change.dot(way);
  way_squared_ = kMemory * way_squared_ + way.squaredNorm();
  learned_ = learned_ || way_squared_ > kShortWay * kShortWay;
}

Vec3 ForceModel::at(double now, const std::optional<Vec3>& hand) {
  const double tick = std::clamp(now - asked_at_, 0.0, kLongestTick);
  asked_at_ = std::max(asked_at_, now);
  if (leaves_ && now >= *leaves_) fade(*leaves_);
  const Vec3 force = force_.at(now);
  const double share = share_.at(now);
  if (share == 0.0 || (!step_.pulls && force.isZero(0.0))) {
    // What a sphere has reported ahead in one touch is taken off in the next.
    offset_.setZero();
    if (share == 0.0) ahead_.setZero();
    return force;
  }
  Vec3 offset = Vec3::Zero();
  const double since = now - stepped_at_;
  if (hand && step_.there && step_.speed > 0.0 && dt_ > 0.0 && since < kLateSteps * dt_) {
    const Vec3 foreseen = step_.place + withinLength(*hand - step_.place, step_.speed * std::clamp(since, 0.0, dt_));
    offset = withinLength(foreseen - place_.at(now), kFarthest);
  }
  offset_ += (1.0 - std::exp(-tick / kSmoothing)) * (offset - offset_);
  Vec3 more = -stiffness_.at(now) * offset_;
  const double pay_back = 1.0 / (kPayBackSteps * std::max(dt_, kShortestStep));  // [1/s]
  if (step_.pulls) {
    more -= share * pay_back * ahead_;
    if (!step_.there && !leaves_) more = withinLength(more, share * fades_from_);
  } else {
    const Vec3 along = force.normalized();
    const double size = force.norm();
    more = std::clamp(along.dot(more - pay_back * ahead_), -kLessShare * size, kMoreShare * size) * along;
  }
  ahead_ += tick * more;
  return force + more;
}

bool ForceModel::isZero(double now) const {
  return !leaves_ && force_.at(now).isZero(0.0) && force_.last().isZero(0.0) &&
         ((share_.at(now) == 0.0 && share_.last() == 0.0) || !step_.pulls);
}

}  // namespace meshless
