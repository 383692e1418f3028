// What holds bodies, and how it is moved.
#include <algorithm>
#include <cmath>

#include "meshless_surgery/base/number_text.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kFarthest = 1e3;  // [m]
constexpr double kUnit = 1e-6;     // by which a turn's norm may differ from 1

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

}  // namespace

Result<Reply> World::Impl::apply(const MoveClampCommand& command) {
  if (const Status status = check(command); !status) return status.error();
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
  std::vector<HeldMotion>& held = body->state.held;
  for (std::size_t r = held.size(); r <= command.clamp; ++r) {
    held.emplace_back();
    held.back().middle = body->state.placed * model.held_middles[r];
  }
  HeldMotion& motion = held[command.clamp];
  motion.target = {command.turn.normalized(), command.shift};
  motion.left = std::max(command.time, 1.0 / settings.step_rate);
  wake(*body);
  say(EventType::kClampMoved, body->name, 0, "what holds " + body->name + " moves");
  return Reply(MoveClampReply{motion.middle + command.shift});
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
