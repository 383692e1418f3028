// What holds bodies, and how it is moved.
#include <algorithm>
#include <cmath>

#include "meshless_surgery/base/number_text.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kFarthest = 1e3;  // [m]
constexpr double kUnit = 1e-6;     // by which a turn's norm may differ from 1
constexpr double kStill = 1e-6;    // [m], and rad: a frame that moves by less stands still

std::string heldText(const BodyModel& model) {
  std::string text;
  for (std::uint32_t clamp = 0; clamp < model.held_middles.size(); ++clamp)
    if (model.isHeldBy(clamp)) text += (text.empty() ? "" : ", ") + std::to_string(clamp);
  return text;
}

Status check(const MoveClampCommand& command) {
  if (!command.shift.allFinite()) return notFinite("shift");
  if (!command.turn.coeffs().allFinite()) return notFinite("turn");
  const auto invalid = [](const std::string& text) { return Error{ErrorCode::kInvalidArgument, text}; };
  if (!(command.shift.norm() <= kFarthest))
    return invalid("shift is " + numberText(command.shift.norm(), 4) + " m; accepted: up to " +
                   numberText(kFarthest, 4) + " m");
  if (!(std::abs(command.turn.norm() - 1.0) <= kUnit))
    return invalid("turn has a norm of " + numberText(command.turn.norm(), 3) + "; accepted: 1");
  if (!(command.time >= 0.0 && command.time <= kMaxClampTime))
    return invalid("time is " + numberText(command.time, 3) + " s; accepted: 0 to " + numberText(kMaxClampTime, 4) +
                   " s");
  return Done{};
}

HeldMotion& motionOf(WorldBody& body, std::uint32_t clamp) {
  std::vector<HeldMotion>& held = body.state.held;
  for (std::size_t r = held.size(); r <= clamp; ++r) {
    held.emplace_back();
    held.back().middle = body.state.placed * body.model->held_middles[r];
  }
  return held[clamp];
}

}  // namespace

// Where nothing is new nobody wakes.
void World::Impl::followClamps(const MoveClampCommand& command) {
  for (const auto& body : bodies) {
    if (body->root != command.body || !body->model->isHeldBy(command.clamp)) continue;
    HeldMotion& motion = motionOf(*body, command.clamp);
    const Quat turn = command.turn.normalized();
    const Pose target = {turn, turn * motion.middle + command.shift - motion.middle};
    if ((target.translation - motion.target.translation).norm() < kStill &&
        target.rotation.angularDistance(motion.target.rotation) < kStill)
      continue;
    motion.target = target;
    const double way = (target.translation - motion.now.translation).norm();
    const double angle = target.rotation.angularDistance(motion.now.rotation);
    motion.left = std::max({command.time, 1.0 / settings.step_rate, way / kFollowSpeed, angle / kFollowTurn});
    wake(*body);
  }
}

Result<Reply> World::Impl::apply(const MoveClampCommand& command) {
  if (const Status status = check(command); !status) return status.error();
  if (command.streamed) {
    followClamps(command);
    return Reply(MoveClampReply{});
  }
  WorldBody* const body = find(command.body);
  if (!body) return Error{ErrorCode::kUnknownName, "there is no body '" + command.body + "'; " + knownBodies()};
  const BodyModel& model = *body->model;
  if (!model.isHeldBy(command.clamp)) {
    const std::string held = heldText(model);
    return Error{ErrorCode::kMissed,
                 held.empty() ? "nothing holds '" + command.body + "'; accepted: bodies with an entry of `fixed`"
                              : "entry " + std::to_string(command.clamp) + " of `fixed` holds nothing of '" +
                                    command.body + "'; accepted: " + held};
  }
  HeldMotion& motion = motionOf(*body, command.clamp);
  motion.target = {command.turn.normalized(), command.shift};
  motion.left = std::max(command.time, 1.0 / settings.step_rate);
  wake(*body);
  say(EventType::kClampMoved, body->name, 0, "what holds " + body->name + " moves");
  return Reply(MoveClampReply{motion.middle + command.shift});
}

Pose World::clampMotion(const std::string& root, std::uint32_t clamp) const {
  for (const auto& body : impl_->bodies) {
    if (body->root != root || clamp >= body->state.held.size()) continue;
    const HeldMotion& motion = body->state.held[clamp];
    const Quat& turn = motion.target.rotation;
    return {turn, motion.middle + motion.target.translation - turn * motion.middle};
  }
  return {};
}

// Contact sees the way of what is led before the first substep of it.
void World::Impl::leadClamps(double h_frame) {
  for (WorldBody* body : awake) {
    BodyState& state = body->state;
    if (std::none_of(state.held.begin(), state.held.end(), [](const HeldMotion& m) { return m.left > 0.0; })) continue;
    std::vector<HeldMotion> then = state.held;
    for (HeldMotion& motion : then) motion.advance(h_frame);
    const BodyModel& model = *body->model;
    for (Index i = 0; i < model.fixed.size(); ++i)
      if (const std::uint32_t by = model.holderOf(i); model.fixed[i] && by < then.size())
        state.velocities[i] = (then[by](state.placed * model.rest[i]) - state.positions[i]) / h_frame;
  }
}

}  // namespace meshless
