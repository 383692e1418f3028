// Many small bodies of one kind are matched side by side in float (dynamics/match_batch.h): several times as fast as
// one after another, by the same laws.
#include <algorithm>

#include "meshless_surgery/dynamics/extent.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr std::size_t kLeastBodies = 32;     // fewer are not worth going there and back
constexpr std::size_t kMostParticles = 256;  // larger ones fill the lanes by themselves
constexpr double kMostUneven = 1e4;  // longest over shortest axis of the rest shape, squared: float fits no more
constexpr double kFarthest = 200.0;  // radii of its rest shape that a body may reach in float, or go in a substep

// One particle a hundred sizes away leaves nothing of the others in a moment of floats.
bool fitsEvenly(const BodyModel& model) {
  const ClusterRest& rest = model.shape.clusters[0];
  return !rest.linear_rank || rest.moment_inverse.norm() * rest.mass * rest.radius * rest.radius < kMostUneven;
}

bool suits(const WorldBody& body) {
  const BodyModel& model = *body.model;
  return !body.material.elastic() && !body.material.plastic() && body.state.plastic.empty() &&
         body.state.eased.empty() && !model.any_fixed && body.state.swelling == 1.0 &&
         body.material.volume.points.empty() && body.material.area.points.empty() &&
         model.rest.size() <= kMostParticles && model.rest.size() >= 4 && body.material.alpha > 0.0 &&
         BodyBatch::holds(matchInput(model, body.state)) && fitsEvenly(model);
}

bool alike(const WorldBody& a, const WorldBody& b) {
  return a.model->rest.size() == b.model->rest.size() && a.material.mode == b.material.mode &&
         a.material.alpha == b.material.alpha && a.material.beta == b.material.beta &&
         a.material.damping == b.material.damping;
}

}  // namespace

// What is drawn out or thrown apart without measure is left to double: rounding to float would make it spin, and it
// would never be whole again. With contact bounds and spread are those of the frame's start, else they are found here.
bool fitsFloat(WorldBody& body, bool bounds_known, double h) {
  if (!bounds_known) {
    body.bounds = extentOf(body.state.positions);
    const Box velocities = extentOf(body.state.velocities);
    body.spread = 0.5 * velocities.diagonal();
  }
  const double most = kFarthest * body.model->shape.clusters[0].radius;
  return body.bounds.diagonal() <= most && h * body.spread <= most;
}

void World::Impl::groupBatches() {
  if (batches_current) return;
  batches_current = true;
  batches.clear();
  for (auto& body : bodies) body->batch = kNoIndex;
  if (bodies.size() < kLeastBodies) return;
  std::vector<std::vector<WorldBody*>> groups;
  for (auto& body : bodies) {
    if (!suits(*body)) continue;
    const auto group = std::find_if(groups.begin(), groups.end(),
                                    [&](const std::vector<WorldBody*>& g) { return alike(*g.front(), *body); });
    if (group != groups.end())
      group->push_back(body.get());
    else
      groups.push_back({body.get()});
  }
  for (std::vector<WorldBody*>& group : groups) {
    if (group.size() < kLeastBodies) continue;
    addBatch(std::move(group));
  }
}

void World::Impl::addBatch(std::vector<WorldBody*> group) {
  std::vector<MatchInput> inputs;
  for (WorldBody* body : group) {
    inputs.push_back(matchInput(*body->model, body->state));
    body->batch = static_cast<Index>(batches.size());
  }
  WorldBatch batch;
  batch.batch = std::make_unique<BodyBatch>(inputs, group.front()->material.mode == MatchMode::kQuadratic);
  batch.states.resize(group.size());
  batch.bodies = std::move(group);
  batches.push_back(std::move(batch));
}

void World::Impl::matchBatches(double h) {
  const bool bounds_known = contactMethod() == ContactMethod::kRestShape;
  for (WorldBatch& batch : batches) {
    const std::size_t count = batch.bodies.size();
    forNumbers(count, [&](std::size_t i) {
      WorldBody& body = *batch.bodies[i];
      batch.states[i] = {body.state.positions.data(), body.state.velocities.data(), &body.state.poses[0].rotation,
                         !body.asleep && fitsFloat(body, bounds_known, h)};
      if (batch.states[i].moves) body.scratch.previous = body.state.positions;
    });
    bool any = false;
    for (std::size_t i = 0; i < count; ++i) {
      WorldBody& body = *batch.bodies[i];
      any = any || batch.states[i].moves;
      if (!batch.states[i].moves && !body.asleep)
        matchAndMove(*body.model, body.material, settings.gravity, h, body.state, body.scratch, report.match_counters);
    }
    if (!any) continue;
    batch.step = batchStep(batch.bodies.front()->material, h);
    batch.step.gravity = settings.gravity;
    batch.batch->stepInPlace(batch.states, batch.step, report.match_counters, for_each);
  }
}

}  // namespace meshless
