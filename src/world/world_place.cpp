// Bodies elsewhere, or as the scene began; and the gravity that they are in.
#include <algorithm>
#include <cmath>

#include "meshless_surgery/base/number_text.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/world/in_ground.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kFarthestBody = 1e6;  // [m]
constexpr double kUnitTurn = 1e-3;          // by which a rotation's norm may differ from 1

Status check(const Pose& pose) {
  if (!pose.translation.allFinite() || !pose.rotation.coeffs().allFinite()) return notFinite("pose");
  if (!(pose.translation.cwiseAbs().maxCoeff() <= kFarthestBody))
    return outOfRange("a coordinate of pose", pose.translation.cwiseAbs().maxCoeff(), "up to 1e6 m");
  if (!(std::abs(pose.rotation.norm() - 1.0) <= kUnitTurn))
    return outOfRange("the length of pose's rotation", pose.rotation.norm(), "1");
  return Done{};
}

Pose inverse(const Pose& pose) {
  return {pose.rotation.conjugate(), -(pose.rotation.conjugate() * pose.translation)};
}

Pose times(const Pose& a, const Pose& b) { return {(a.rotation * b.rotation).normalized(), a * b.translation}; }

}  // namespace

Result<Reply> World::Impl::apply(const SetGravityCommand& command) {
  if (!command.gravity.allFinite()) return notFinite("gravity");
  WorldSettings then = settings;
  then.gravity = command.gravity;
  if (Status valid = then.validate(); !valid) return valid.error();
  if (command.gravity == settings.gravity) return Reply(Done{});
  settings.gravity = command.gravity;
  for (const auto& body : bodies) wake(*body);
  say(EventType::kGravity, "", 0,
      "gravity is (" + numberText(command.gravity.x(), 4) + ", " + numberText(command.gravity.y(), 4) + ", " +
          numberText(command.gravity.z(), 4) + ") m/s^2");
  return Reply(Done{});
}

Result<Reply> World::Impl::apply(const PlaceBodyCommand& command) {
  if (Status status = check(command.pose); !status) return status.error();
  WorldBody* const body = find(command.body);
  if (!body) return Error{ErrorCode::kUnknownName, "there is no body '" + command.body + "'; " + knownBodies()};
  const BodyModel& model = *body->model;
  for (const Attachment& attachment : attachments)
    for (const Fibre& fibre : attachment.fibres)
      if (fibre.a != fibre.b && (fibre.a == body->id || fibre.b == body->id))
        return Error{ErrorCode::kInvalidArgument, "'" + body->name + "' is held by the attachment '" + attachment.name +
                                                      "'; accepted: bodies that nothing joins to others"};
  const Pose put{command.pose.rotation.normalized(), command.pose.translation};
  PreparedBody then;
  then.def.name = body->name;
  then.model = body->model;
  then.state = restState(model, times(put, model.own));
  if (Status apart = liesApart(then, {body->id}); !apart) return apart.error();

  // From here nothing fails. What it was at rest stays where it was put first, as what is measured there.
  const Pose placed = body->state.placed;
  BodyState& state = then.state;
  const Pose motion = times(state.placed, inverse(placed));
  state.placed = placed;
  state.cavities = std::move(body->state.cavities);
  for (FilledCavity& cavity : state.cavities) cavity.filled_for = cavity.acting = 0.0;
  if (model.any_fixed)
    for (const Vec3& rest : model.held_middles) {
      HeldMotion held;
      held.middle = placed * rest;
      held.now = held.target = {motion.rotation, motion * held.middle - held.middle};
      state.held.push_back(held);
    }
  wake(*body);
  for (const Pick& pick : picks)
    if (pick.body == body->id && !pick.latch)
      say(EventType::kReleased, body->name, pick.id, "released: its body was put elsewhere");
  picks.erase(std::remove_if(picks.begin(), picks.end(), [&](const Pick& pick) { return pick.body == body->id; }),
              picks.end());
  emptyJaws(*body, "it was put elsewhere");
  body->state = std::move(state);
  body->surface_current = true;
  body->bounds = boundsOf(body->state.surface);
  body->rest_from.clear();
  body->touched_by_push = false;
  body->stiffness_factor = 1.0;
  surface_contacts.forget(body->number);
  contacts_current = false;
  // Lumens are open at rest: clips close them anew, as slowly as at first.
  for (Attachment& attachment : attachments) {
    if (!attachment.clip || attachment.fibres.empty() || attachment.fibres.front().a != body->id) continue;
    double& jaws = attachment.clip->jaws;
    for (Fibre& fibre : attachment.fibres) {
      const Points ends = fibreEnds(fibre);
      fibre.force.setZero();
      fibre.tension = 0.0;
      fibre.rest = (ends[0] - ends[1]).norm();
      jaws = std::max(jaws, fibre.rest);
    }
  }
  say(EventType::kPlaced, body->name, 0, body->name + " was put elsewhere");
  return Reply(Done{});
}

Result<Reply> World::Impl::apply(const ResetBodiesCommand& command) {
  const auto isIn = [](const std::vector<std::string>& names, const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  std::vector<std::shared_ptr<const PreparedBody>> again;
  std::vector<std::string> names, known;
  for (const auto& body : scene) {
    known.push_back(body->def.name);
    if (!command.bodies.empty() && !isIn(command.bodies, body->def.name)) continue;
    again.push_back(body);
    names.push_back(body->def.name);
  }
  for (const std::string& name : command.bodies) {
    if (isIn(known, name)) continue;
    std::string list;
    for (std::size_t n = 0; n < known.size() && n < 20; ++n) list += (n ? ", " : "") + known[n];
    return Error{ErrorCode::kUnknownName, "the scene has no body '" + name + "'; " +
                                              (known.empty() ? "it has none" : "accepted, as they were before cuts: " + list)};
  }
  std::vector<BodyId> gone;
  for (const auto& body : bodies)
    if (isIn(names, body->root)) gone.push_back(body->id);
  for (const auto& body : again)
    if (Status apart = liesApart(*body, gone); !apart) return apart.error();
  for (const AttachCommand& attachment : scene_attachments) {
    const std::string ends[] = {attachment.body, attachment.other};
    if (!isIn(names, ends[0]) && !isIn(names, ends[1])) continue;
    for (const std::string& end : ends)
      if (isIn(known, end) && !isIn(names, end) && !find(end))
        return Error{ErrorCode::kInvalidArgument, "attachment '" + attachment.name + "' joins '" + ends[0] + "' and '" +
                                                      ends[1] + "', and '" + end +
                                                      "' was cut or removed; accepted: both of them at once"};
  }

  ResetBodiesReply reply{names, {}};
  // From here nothing fails. Each comes where the first of its pieces was.
  std::map<const WorldBody*, std::size_t> order;
  std::map<std::string, std::size_t> first;
  for (std::size_t n = 0; n < bodies.size(); ++n) {
    order[bodies[n].get()] = n;
    if (isIn(names, bodies[n]->root)) first.emplace(bodies[n]->root, n);
  }
  for (const BodyId& id : gone) {
    WorldBody& body = *find(id);
    letGoOf(body, "its body is as the scene began");
    emptyJaws(body, "it is as the scene began");
    wake(body);
    for (Instrument& instrument : instruments) {
      const auto isOf = [&](const BladeWound& wound) { return wound.body == body.name; };
      instrument.wounds.erase(std::remove_if(instrument.wounds.begin(), instrument.wounds.end(), isOf),
                              instrument.wounds.end());
    }
    order.erase(&body);
    retire(id);
  }
  undo.clear();
  for (const auto& from : again) {
    WorldBody& body = admit(from->def.name, from->def.material, from->model, from->state);
    const auto place = first.find(from->def.name);
    order[&body] = place == first.end() ? order.size() + gone.size() : place->second;
    say(EventType::kRestored, body.name, 0, body.name + " is as the scene began");
  }
  std::stable_sort(bodies.begin(), bodies.end(),
                   [&](const auto& a, const auto& b) { return order[a.get()] < order[b.get()]; });
  for (const AttachCommand& attachment : scene_attachments) {
    if (!isIn(names, attachment.body) && !isIn(names, attachment.other)) continue;
    if (const auto made = attach(attachment); !made)
      reply.notes.push_back("attachment '" + attachment.name + "' could not be made again: " + made.error().detail);
  }
  return Reply(reply);
}

}  // namespace meshless
