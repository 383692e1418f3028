// What users do, besides cutting (world_cut.cpp). Everything is checked before anything changes.
#include <algorithm>
#include <limits>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/tools/grasp.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kEntryTime = 0.1;   // [s] for a radius, in which the push sphere goes into tissue where it is placed
constexpr double kEntrySpeed = 5.0;  // [m/s] at most: no hand is faster
constexpr double kTouches = 1e-3;    // radii: so deep it does not need a way in
constexpr int kMostWays = 20;        // between folds
constexpr double kFarthestTarget = 1e6;  // [m] along each axis

struct Grabbed {
  WorldBody* body = nullptr;
  Index particle = 0;
  Vec3 point = Vec3::Zero();
  TissuePlace place;
};

// What is at `point` of a triangle now: in the cell of the nearest corner.
TissuePlace placeAt(const WorldBody& body, Index triangle, const Vec3& point) {
  if (!body.model->lattice) return {};
  const Triangle& t = body.model->surface.triangles[triangle];
  const Points &now = body.state.surface, &rest = body.model->surface.vertices;
  const Vec3 normal = (now[t[1]] - now[t[0]]).cross(now[t[2]] - now[t[0]]);
  Vec3 sum = Vec3::Zero();
  double all = 0.0;
  Index nearest = t[0];
  for (int k = 0; k < 3; ++k) {
    const double area = std::max(0.0, normal.dot((now[t[(k + 1) % 3]] - point).cross(now[t[(k + 2) % 3]] - point)));
    sum += area * rest[t[k]];
    all += area;
    if ((now[t[k]] - point).squaredNorm() < (now[nearest] - point).squaredNorm()) nearest = t[k];
  }
  const Index cell = body.model->binding.cells[nearest];
  return {cell, body.model->lattice->placeIn(body.model->lattice->cells[cell], all > 0.0 ? sum / all : rest[nearest])};
}

double distanceToRay(const Vec3& p, const Vec3& origin, const Vec3& unit) {
  const double along = std::max(0.0, unit.dot(p - origin));
  return (p - origin - along * unit).norm();
}

Status checkTarget(const Vec3& target) {
  if (!target.allFinite()) return notFinite("target");
  const double farthest = target.cwiseAbs().maxCoeff();
  if (!(farthest <= kFarthestTarget)) return outOfRange("a coordinate of target", farthest, "up to 1e6 m");
  return Done{};
}

Error noPick(PickId id, const std::vector<Pick>& picks) {
  const std::string text = "there is no pick " + std::to_string(id);
  std::string known;
  std::size_t shown = 0;
  for (const Pick& pick : picks)
    if (!pick.latch && shown++ < 20) known += " " + std::to_string(pick.id);
  return {ErrorCode::kUnknownName, text + (known.empty() ? "; no spring is set" : "; springs are:" + known)};
}

}  // namespace

Result<Reply> World::Impl::apply(const PickCommand& command) {
  if (!command.point.allFinite()) return notFinite("point");
  if (!command.direction.allFinite()) return notFinite("direction");
  if (!(command.max_distance >= 0.0 && command.max_distance <= 1e9))
    return outOfRange("max_distance", command.max_distance, "0 (the default) to 1e9 m");
  if (!(command.stiffness >= 0.0 && command.stiffness <= 1e12))
    return outOfRange("stiffness", command.stiffness, "0 (the default) to 1e12 N/m");
  if (!command.body.empty() && !find(command.body))
    return Error{ErrorCode::kUnknownName, "there is no body '" + command.body + "'; " + knownBodies()};
  if (bodies.empty()) return Error{ErrorCode::kMissed, "there are no bodies to pick"};

  const double reach = command.max_distance > 0.0 ? command.max_distance : settings.pick_max_distance;
  const bool ray = command.direction.norm() > 0.0;
  Grabbed grabbed;
  if (ray) {  // the surface in front; what lies behind it cannot be grabbed
    double nearest = std::numeric_limits<double>::infinity();
    for (auto& body : bodies) {
      if (!command.body.empty() && body->name != command.body) continue;
      refreshSurface(*body);
      const RayHit hit = castRay(body->state.surface, body->model->surface.triangles, command.point, command.direction);
      if (!hit.hit || !(hit.distance < nearest)) continue;
      nearest = hit.distance;
      grabbed.body = body.get();
      grabbed.point = hit.point;
      grabbed.place = placeAt(*body, hit.triangle, hit.point);
    }
    if (grabbed.body) {
      const Points& p = grabbed.body->state.positions;
      const BodyModel& model = *grabbed.body->model;
      double closest = std::numeric_limits<double>::infinity();
      // Beside a wound the nearest particle may be of the other lip: of cells, one of the tissue that was hit.
      if (grabbed.place.cell != kNoIndex)
        for (const Index i : model.lattice->cells[grabbed.place.cell].corners)
          if (model.isTissue(i) && (p[i] - grabbed.point).squaredNorm() < closest) {
            closest = (p[i] - grabbed.point).squaredNorm();
            grabbed.particle = i;
          }
      const bool found = std::isfinite(closest);
      for (Index i = 0; i < p.size() && !found; ++i) {
        if (!model.isTissue(i) || !((p[i] - grabbed.point).squaredNorm() < closest)) continue;
        closest = (p[i] - grabbed.point).squaredNorm();
        grabbed.particle = i;
      }
    }
  }
  if (!grabbed.body) {
    double nearest = std::numeric_limits<double>::infinity();
    const Vec3 unit = ray ? Vec3(command.direction.normalized()) : Vec3::Zero();
    for (auto& body : bodies) {
      if (!command.body.empty() && body->name != command.body) continue;
      const Points& p = body->state.positions;
      for (Index i = 0; i < p.size(); ++i) {
        if (!body->model->isTissue(i)) continue;
        const double d = ray ? distanceToRay(p[i], command.point, unit) : (p[i] - command.point).norm();
        if (!(d < nearest)) continue;
        nearest = d;
        grabbed = {body.get(), i, p[i], {}};
      }
    }
    if (!(nearest <= reach))
      return Error{ErrorCode::kMissed, "no tissue within " + std::to_string(reach) + " m of the " +
                                           (ray ? "ray" : "point") + "; the nearest is " + std::to_string(nearest) +
                                           " m away"};
  }

  Pick pick;
  pick.id = next_pick++;
  pick.body = grabbed.body->id;
  pick.stiffness = command.stiffness > 0.0 ? command.stiffness : settings.pick_stiffness;
  const BodyModel& model = *grabbed.body->model;
  makeGrasp(model, grabbed.body->state.positions, grabbed.particle, graspRadius(model), grabbed.point, pick);
  const bool moved = pick.particle != grabbed.particle;
  pick.place = grabbed.place.cell == kNoIndex || moved ? placeOf(model, pick.particle) : grabbed.place;
  pick.target = pick.reached = pick.position;
  picks.push_back(pick);
  wake(*grabbed.body);
  say(EventType::kPicked, grabbed.body->name, pick.id, "picked " + grabbed.body->name);
  return Reply(PickReply{pick.id, grabbed.body->name, pick.particle, pick.position});
}

Result<Reply> World::Impl::apply(const MovePickCommand& command) {
  if (const Status there = checkTarget(command.target); !there) return there.error();
  Pick* pick = findPick(command.pick);
  if (!pick) return noPick(command.pick, picks);
  const bool there = pick->target == command.target;  // a stream says over and over where it is
  pick->target = command.target;
  pick->locked = false;
  if (WorldBody* body = find(pick->body); body && !there) wake(*body);
  return Reply(Done{});
}

Result<Reply> World::Impl::apply(const LockCommand& command) {
  if (command.target)
    if (const Status there = checkTarget(*command.target); !there) return there.error();
  Pick* pick = findPick(command.pick);
  if (!pick) return noPick(command.pick, picks);
  const bool moved = command.target && *command.target != pick->target;
  if (command.target) pick->target = *command.target;
  pick->locked = true;
  WorldBody* body = find(pick->body);
  if (body && moved) wake(*body);
  say(EventType::kLocked, body ? body->name : "", pick->id, "locked");
  return Reply(Done{});
}

Result<Reply> World::Impl::apply(const ReleaseCommand& command) {
  const Pick* pick = findPick(command.pick);
  if (!pick) return noPick(command.pick, picks);
  letGo(*pick);
  return Reply(Done{});
}

Result<Reply> World::Impl::apply(const ClearPicksCommand&) {
  for (std::size_t n = 0; n < picks.size();)
    if (picks[n].latch)
      ++n;
    else
      letGo(picks[n]);
  return Reply(Done{});
}

std::string World::Impl::letGo(const Pick& pick) {
  WorldBody* body = find(pick.body);
  if (body) wake(*body);
  const std::string name = body ? body->name : "";
  say(EventType::kReleased, name, pick.id, "released");
  picks.erase(picks.begin() + (&pick - picks.data()));
  return name;
}

void World::Impl::wakeAtSphere() {
  if (!push.enabled) return;
  Box box;
  box.extend(push.position.array() - push.radius);
  box.extend(push.position.array() + push.radius);
  wakeWithin(box);
}

void World::Impl::liftSphere() {
  wakeAtSphere();
  push = PushSphere();
  for (auto& body : bodies) body->touched_by_push = false;
}

Result<Reply> World::Impl::apply(const PushCommand& command) {
  if (!command.enable) {
    liftSphere();
    return Reply(Done{});
  }
  if (!command.position.allFinite()) return notFinite("position");
  if (!(command.radius >= 0.0 && command.radius <= 1e6))
    return outOfRange("radius", command.radius, "0 (the default) to 1e6 m");
  if (!(command.speed >= 0.0 && command.speed <= 1e6))
    return outOfRange("speed", command.speed, "0 (at once) to 1e6 m/s");
  const double radius = command.radius > 0.0 ? command.radius : settings.push_radius;
  const bool from_nowhere = !push.enabled;
  push.speed = command.speed;
  push.streamed = command.streamed;
  if (!from_nowhere && radius == push.radius && command.position == push.target && push.position == push.target)
    return Reply(Done{});
  wakeAtSphere();
  const bool placed = from_nowhere || command.speed == 0.0, larger = from_nowhere || radius > push.radius;
  if (placed || larger) {
    // Tissue that is inside of it all at once would not be pushed as it is on the way there. From where it is the way
    // may be shorter, and it presses on.
    const Vec3 place = placed ? command.position : push.position, beside = placeBeside(place, radius);
    if (larger || (beside - place).norm() < (push.position - place).norm()) push.position = beside;
    if (placed) push.speed = std::min(radius / kEntryTime, kEntrySpeed);
  }
  push.enabled = true;
  push.radius = radius;
  push.target = command.position;
  wakeAtSphere();
  return Reply(Done{});
}

Vec3 World::Impl::placeBeside(const Vec3& centre, double radius) {
  struct Near {
    ShownSurface shown;
    SolidQuery query;
    bool solid;
  };
  std::vector<Near> all;
  Box sphere;
  sphere.extend(centre.array() - radius);
  sphere.extend(centre.array() + radius);
  for (auto& body : bodies) {
    if (body->model->surface.triangles.empty()) continue;
    const ShownSurface shown = shownNow(*body);
    if (!boundsOf(shown.vertices).overlaps(sphere)) continue;
    all.push_back({shown, SolidQuery({shown.vertices, shown.surface->triangles, {}}), body->model->solid});
  }
  Vec3 place = centre;
  for (int step = 0; step < kMostWays; ++step) {
    double deepest = kTouches * radius;  // [m]
    Vec3 out = Vec3::Zero();
    for (const Near& near : all) {
      const bool inside = near.solid && near.query.contains(place);
      Vec3 way = (inside ? -1.0 : 1.0) * (place - near.query.nearest(place));
      const double depth = inside ? radius + way.norm() : radius - way.norm();
      if (!(depth > deepest)) continue;
      deepest = depth;
      if (!(way.norm() > kTouches * radius)) way = near.shown.areaOf(near.query.nearestTriangle(place));
      out = depth * way.normalized();
    }
    if (out.isZero(0.0)) break;
    place += out;
  }
  return place;
}

Result<Reply> World::Impl::apply(const LiftCommand& command) {
  std::string body;
  PickId id = 0;
  switch (command.tool) {
    case ToolKind::kPick: {
      const auto held = std::find_if(picks.rbegin(), picks.rend(), [](const Pick& pick) { return !pick.locked; });
      if (held == picks.rend()) return Error{ErrorCode::kMissed, "no pick is in the hand"};
      id = held->id;
      body = letGo(*held);
      break;
    }
    case ToolKind::kPush:
      if (!push.enabled || (command.streamed_only && !push.streamed))
        return Error{ErrorCode::kMissed, "there is no push sphere to lift"};
      liftSphere();
      break;
    case ToolKind::kScissors:
      if (command.streamed_only && !closing.empty()) return Error{ErrorCode::kMissed, "a service closes the scissors"};
      scissors.shown = false;
      break;
    case ToolKind::kInstrument:
      return Error{ErrorCode::kInvalidArgument, "an instrument is put away by its name"};
  }
  if (!command.why.empty()) say(EventType::kLifted, body, id, command.why);
  return Reply(Done{});
}

Result<std::vector<MaterialChange>> World::Impl::changesOf(const SetMaterialCommand& command) const {
  std::vector<MaterialChange> changes;
  for (auto& body : bodies) {
    if (!command.body.empty() && body->name != command.body) continue;
    Result<Material> changed = command.change(body->material);
    if (!changed) return changed.error();
    if (Status status = changed->validate(); !status) return status.error();
    if (!body->model->regions.empty() && !changed->elastic())
      return Error{ErrorCode::kInvalidArgument, "body '" + body->name + "' has regions, and '" + changed->name +
                                                    "' is an appearance material; accepted: elastic materials"};
    changes.push_back({body->name, std::move(*changed)});
  }
  if (changes.empty() && !command.body.empty())
    return Error{ErrorCode::kUnknownName, "there is no body '" + command.body + "'; " + knownBodies()};
  return changes;
}

Result<Reply> World::Impl::apply(const SetMaterialCommand& command) {
  const Result<std::vector<MaterialChange>> changes = changesOf(command);
  if (!changes) return changes.error();
  for (const auto& [name, material] : *changes) {
    WorldBody* body = find(name);
    wake(*body);
    batches_current = contacts_current = false;
    const BodyModelPtr before = body->model;
    body->model = withMaterial(before, body->material, material);
    const double h = body->state.substep > 0.0 ? body->state.substep : substepNow();
    body->state.stiffened = stiffenedBy(*before, body->material, *body->model, material, h, body->state);
    fitPoses(*body->model, body->state);
    // Other masses move embedded vertices by a rounding. Whether the surface was read before must make no difference.
    body->surface_current = false;
    body->material = material;
    if (body->model != before) body->state.pace = 1.0;  // of another material no velocity is won back
    say(EventType::kMaterial, name, 0, name + " is of another material");
  }
  return Reply(Done{});
}

Result<Reply> World::Impl::apply(const SpawnCommand& command) {
  Result<SpawnReply> reply = spawn(*command.body);
  if (!reply) return reply.error();
  return Reply(*reply);
}

void World::Impl::letGoOf(const WorldBody& body, const std::string& why) {
  const BodyId id = body.id;
  for (const Pick& pick : picks)
    if (pick.body == id && !pick.latch) say(EventType::kReleased, body.name, pick.id, "released: " + why);
  picks.erase(std::remove_if(picks.begin(), picks.end(), [&](const Pick& p) { return p.body == id; }), picks.end());
  for (Attachment& attachment : attachments)
    loseFibres(attachment, EventType::kDetached, "went with " + body.name,
               [&](const Fibre& fibre) { return fibre.a == id || fibre.b == id; });
  attachments.erase(std::remove_if(attachments.begin(), attachments.end(),
                                   [](const Attachment& attachment) { return attachment.fibres.empty(); }),
                    attachments.end());
  forgetForces([&](const AppliedForce::Point& point) { return point.body == id; });
}

Result<Reply> World::Impl::apply(const RemoveCommand& command) {
  WorldBody* body = find(command.body);
  if (!body) return Error{ErrorCode::kUnknownName, "there is no body '" + command.body + "'; " + knownBodies()};
  const BodyId id = body->id;
  letGoOf(*body, "its body was removed");
  wake(*body);
  say(EventType::kRemoved, command.body, 0, "removed " + command.body);
  events.back().removed = body->model;
  events.back().placed = body->state.placed;
  retire(id);
  return Reply(Done{});
}

}  // namespace meshless
