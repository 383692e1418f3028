// Forces that are applied to patches of tissue for a while.
#include <algorithm>
#include <cmath>
#include <set>

#include "meshless_surgery/base/number_text.h"
#include "meshless_surgery/geometry/query/region.h"
#include "surface_parts.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kSamples = 0.125;  // of a sphere's radius: its patch is looked for so finely

Status check(const ApplyForceCommand& command) {
  if (!command.force.allFinite()) return notFinite("force");
  if (!(command.force.norm() <= kMostForce))
    return outOfRange("the length of force", command.force.norm(), "up to " + numberText(kMostForce) + " N");
  const bool ends = command.force.isZero(0.0);
  if (!ends && !(command.time > 0.0 && command.time <= kLongestForce))
    return outOfRange("time", command.time, "above 0 to " + numberText(kLongestForce) + " s");
  return Done{};
}

}  // namespace

Result<Reply> World::Impl::apply(const ApplyForceCommand& command) {
  if (Status status = check(command); !status) return status.error();
  if (Status region = checkRegion(command.region); !region) return region.error();
  WorldBody* const body = find(command.body);
  if (!body) return Error{ErrorCode::kUnknownName, "there is no body '" + command.body + "'; " + knownBodies()};
  if (command.force.isZero(0.0)) {
    if (!isForced(body->id))
      return Error{ErrorCode::kMissed, "no force acts on '" + body->name + "'; accepted: a force above 0 N"};
    forgetForces([&](const AppliedForce::Point& point) { return point.body == body->id; });
    return Reply(ApplyForceReply{});
  }
  if (forces.size() >= kMostForces)
    return Error{ErrorCode::kFailed, "there are " + std::to_string(forces.size()) +
                                         " forces; accepted: up to " + std::to_string(kMostForces) +
                                         " at once: wait until one has ended, or end those of a body"};
  const ShownSurface shown = shownNow(*body);
  if (shown.surface->triangles.empty())
    return Error{ErrorCode::kUnsuitableShape, "'" + body->name + "' has no surface that a force could act on"};
  double away = std::numeric_limits<double>::infinity();  // [m] from the region
  const auto inPatch = [&](const Vec3& p, Index, const Vec3&) {
    const double height = command.region ? command.region->height(p) : 0.0;
    away = std::min(away, height);
    return height <= 0.0;
  };
  const bool sphere = command.region && command.region->kind == Region::Kind::kSphere;
  const auto piecesOf = [&](Index face, double longest) {  // finer where the sphere is small
    if (!sphere || command.region->height(shown.at(face, Vec3::Constant(1.0 / 3.0))) > 2.0 / 3.0 * longest)
      return longest / (kLongFace * body->edge_length);
    return longest / std::min(kLongFace * body->edge_length, kSamples * command.region->radius);
  };
  auto parts = surfaceParts(shown, body->edge_length, piecesOf, inPatch);
  if (parts.empty() && !command.region)
    return Error{ErrorCode::kUnsuitableShape, "'" + body->name + "' has no surface that a force could act on"};
  if (parts.empty())
    return Error{ErrorCode::kMissed, "no surface of '" + body->name + "' lies in " + command.region->text() +
                                         "; the nearest is " + numberText(away, 3) + " m beside it"};
  ApplyForceReply reply;
  AppliedForce made{command.force, command.time, {}};
  for (auto& [cube, part] : parts) {
    made.points.push_back({body->id, pointOf(part, shown), part.area});
    reply.area += part.area;
    reply.middle += part.area * part.middle;
  }
  reply.middle /= reply.area;
  for (AppliedForce::Point& point : made.points) point.share /= reply.area;
  forces.push_back(std::move(made));
  wake(*body);
  say(EventType::kForce, body->name, 0,
      "a force of " + numberText(command.force.norm(), 3) + " N acts on " + body->name);
  events.back().force = command.force.norm();
  return Reply(reply);
}

bool World::Impl::isForced(const BodyId& body) const {
  return std::any_of(forces.begin(), forces.end(), [&](const AppliedForce& force) {
    return std::any_of(force.points.begin(), force.points.end(),
                       [&](const AppliedForce::Point& point) { return point.body == body; });
  });
}

void World::Impl::sayForceEnds(const Vec3& force, const std::set<BodyId>& on) {
  for (const BodyId& id : on) {
    WorldBody* const body = find(id);
    if (!body) continue;
    wake(*body);
    say(EventType::kForce, body->name, 0,
        "a force of " + numberText(force.norm(), 3) + " N has ended on " + body->name);
  }
}

void World::Impl::forgetForces(const std::function<bool(const AppliedForce::Point&)>& gone) {
  for (AppliedForce& force : forces) {
    std::set<BodyId> on;
    for (const AppliedForce::Point& point : force.points)
      if (gone(point)) on.insert(point.body);
    sayForceEnds(force.force, on);
    force.points.erase(std::remove_if(force.points.begin(), force.points.end(), gone), force.points.end());
  }
  forces.erase(std::remove_if(forces.begin(), forces.end(), [](const AppliedForce& of) { return of.points.empty(); }),
               forces.end());
}

void World::Impl::listForces() {
  forced.clear();
  for (const AppliedForce& force : forces) {
    const double part = std::min(1.0, force.left * settings.step_rate);  // of the step, in which it still acts
    for (const AppliedForce::Point& point : force.points)
      if (const WorldBody* const body = find(point.body))
        forced[body].push_back({part * point.share * force.force, &point.at});
  }
}

double World::Impl::forcedAcceleration(const std::vector<WorldBody*>& some, std::size_t begin, std::size_t end) const {
  double most = 0.0;
  if (forced.empty()) return most;
  for (std::size_t b = begin; b < end; ++b) {
    const WorldBody* const body = some[b];
    const auto found = forced.find(body);
    if (found == forced.end()) continue;
    Vec3 sum = Vec3::Zero();
    for (const ForcedPoint& point : found->second) sum += point.force;
    most = std::max(most, sum.norm() / body->model->mass);
  }
  return most;
}

// A body that deforms more slowly than its material is deformed by as much less, and moved as a whole by the rest.
void World::Impl::applyForces(const std::vector<WorldBody*>& some, double h) const {
  if (forced.empty()) return;
  for (WorldBody* const body : some) {
    const auto found = forced.find(body);
    if (found == forced.end()) continue;
    const BodyModel& model = *body->model;
    Points& positions = body->state.positions;
    const double yields = model.isHeld() ? 1.0 : yieldsOf(*body), share = body->scratch.factor * yields * yields;
    const bool whole = share < 1.0 && !model.isHeld();
    Vec3 shift = Vec3::Zero(), turn = Vec3::Zero(), centre = Vec3::Zero();
    if (whole) {
      centre = rigidMotionOf(model, positions, body->state.velocities).centre;
      for (const ForcedPoint& point : found->second) {
        shift += point.force;
        turn += (point.at->of(positions) - centre).cross(point.force);
      }
      shift *= (1.0 - share) * h * h / model.mass;
      turn = spinWith(model, positions, (1.0 - share) * h * h * turn);
    }
    for (const auto& [force, at] : found->second)
      for (std::size_t k = 0; k < at->particles.size(); ++k) {
        const Index i = at->particles[k];
        if (!model.fixed[i]) positions[i] += share * at->weights[k] * h * h / model.masses[i] * force;
      }
    if (whole)
      for (Vec3& p : positions) p += shift + turn.cross(p - centre);
  }
}

void World::Impl::endForces(double h_frame) {
  for (std::size_t n = 0; n < forces.size();) {
    forces[n].left -= h_frame;
    if (forces[n].left > 1e-9 * h_frame) {
      ++n;
      continue;
    }
    const AppliedForce ended = std::move(forces[n]);
    forces.erase(forces.begin() + static_cast<std::ptrdiff_t>(n));
    std::set<BodyId> on;
    for (const AppliedForce::Point& point : ended.points) on.insert(point.body);
    sayForceEnds(ended.force, on);
  }
}

}  // namespace meshless
