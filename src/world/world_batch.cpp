// Many small bodies of one kind are matched side by side in float (dynamics/match_batch.h): several times as fast as
// one after another, by the same laws.
#include <algorithm>

#include "meshless_surgery/dynamics/extent.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr std::size_t kLanes = 64;           // side by side
constexpr std::size_t kLeastBodies = 32;     // fewer are not worth going there and back
constexpr std::size_t kMostParticles = 256;  // larger ones fill the lanes by themselves
constexpr double kMostUneven = 1e4;  // longest over shortest axis of the rest shape, squared: float fits no more
constexpr double kFarthestInFloat =
    200.0;  // radii of its rest shape that a body may reach in float, or go in a substep

// One particle a hundred sizes away leaves nothing of the others in a moment of floats.
bool fitsEvenly(const BodyModel& model) {
  const ClusterRest& rest = model.shape.clusters[0];
  return !rest.linear_rank || rest.moment_inverse.norm() * rest.mass * rest.radius * rest.radius < kMostUneven;
}

bool suits(const WorldBody& body) {
  const BodyModel& model = *body.model;
  return !body.material.elastic() && !body.material.plastic() && body.state.plastic.empty() &&
         !model.elastic_batch && body.state.cavities.empty() && !model.any_fixed && body.state.swelling == 1.0 &&
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
// would never be whole again. What becomes stiffer is of another stiffness in every substep.
bool fitsFloat(const WorldBody& body, double h) {
  const double most = kFarthestInFloat * body.model->shape.clusters[0].radius;
  return body.state.stiffened == 1.0 && extentOf(body.state.positions).diagonal() <= most &&
         0.5 * h * extentOf(body.state.velocities).diagonal() <= most;
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
  for (WorldBody* body : group) body->batch = static_cast<Index>(batches.size());
  WorldBatch batch;
  batch.bodies = std::move(group);
  batches.push_back(std::move(batch));
}

// Lanes of the last islands. No more are made in all than there are threads.
std::unique_ptr<BatchLanes> World::Impl::borrowLanes(WorldBatch& batch) {
  {
    const std::lock_guard<std::mutex> lock(lanes_mutex);
    if (!batch.spare.empty()) {
      std::unique_ptr<BatchLanes> lanes = std::move(batch.spare.back());
      batch.spare.pop_back();
      return lanes;
    }
  }
  const WorldBody& any = *batch.bodies.front();
  const MatchInput input = matchInput(*any.model, any.state);
  const bool quadratic = any.material.mode == MatchMode::kQuadratic;
  return std::make_unique<BatchLanes>(BatchLanes{BodyBatch(std::vector<MatchInput>(kLanes, input), quadratic),
                                                 std::vector<const BodyModel*>(kLanes, any.model.get()),
                                                 {}});
}

void World::Impl::giveBackLanes(WorldBatch& batch, std::unique_ptr<BatchLanes> lanes) {
  const std::lock_guard<std::mutex> lock(lanes_mutex);
  batch.spare.push_back(std::move(lanes));
}

void BatchLanes::step(const std::vector<WorldBody*>& some, const BatchStep& step, MatchCounters& counters) {
  for (std::size_t first = 0; first < some.size(); first += models.size()) {
    states.resize(std::min(models.size(), some.size() - first));
    for (std::size_t i = 0; i < states.size(); ++i) {
      WorldBody& body = *some[first + i];
      if (models[i] != body.model.get()) {
        models[i] = body.model.get();
        batch.refit(i, matchInput(*body.model, body.state));
      }
      body.scratch.previous = body.state.positions;
      states[i] = {body.state.positions.data(), body.state.velocities.data(), &body.state.poses[0].rotation};
    }
    batch.step(states, step, counters);
  }
}

}  // namespace meshless
