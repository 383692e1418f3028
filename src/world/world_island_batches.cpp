// Islands of contact do not know of each other within a frame, nor do bodies that touch nothing. So an island batch
// takes all substeps by itself: its bodies stay in the cache, and no thread waits for another after each stage.
#include <algorithm>
#include <chrono>

#include "world_impl.h"

namespace meshless {
namespace {

constexpr std::size_t kMostParticles = 1024;  // of several islands: what a step reads of so many stays in L2
constexpr std::size_t kLeastParticles = 256;  // fewer leave lanes of the batches empty
constexpr std::size_t kIslandBatchesPerThread = 4;
constexpr std::size_t kLanes = 64;  // of a batch, side by side

double secondsSince(std::chrono::steady_clock::time_point& last) {
  const auto now = std::chrono::steady_clock::now();
  const double seconds = std::chrono::duration<double>(now - last).count();
  last = now;
  return seconds;
}

void clear(IslandBatch& island_batch) {
  island_batch.bodies.clear();
  island_batch.alone.clear();
  for (std::vector<WorldBody*>& some : island_batch.side_by_side) some.clear();
  island_batch.particles = 0;
  island_batch.match_counters = MatchCounters();
  island_batch.preserve_counters = PreserveCounters();
  island_batch.corrected = island_batch.ground_contacts = 0;
  island_batch.match = island_batch.contact = 0.0;
}

}  // namespace

// Not with a tool, which acts on all bodies in each substep; not with fast pairs or caught points, for which contacts
// are found in it; and not with a body without a surface, which its particles hold above the ground.
bool World::Impl::formIslandBatches(double h) {
  if (!contacts.settled() || !picks.empty() || push.enabled) return false;
  std::size_t total = 0;
  for (const WorldBody* body : awake) {
    if (body->model->surface.vertices.empty()) return false;
    total += body->state.positions.size();
  }
  const std::size_t threads = static_cast<std::size_t>(std::max(1, settings.threads));
  const std::size_t wanted = std::clamp(total / (kIslandBatchesPerThread * threads), kLeastParticles, kMostParticles);
  if (total <= wanted) return false;

  island_batch_count = 0;
  const auto next = [&](Index first_island) -> IslandBatch& {
    if (island_batch_count == island_batches.size()) island_batches.emplace_back();
    IslandBatch& island_batch = island_batches[island_batch_count++];
    clear(island_batch);
    island_batch.side_by_side.resize(batches.size());
    island_batch.lanes.resize(batches.size());
    island_batch.first_island = island_batch.end_island = first_island;
    return island_batch;
  };
  const std::vector<Index>&offsets = contacts.islandOffsets(), &members = contacts.islandColliders();
  const Index islands = static_cast<Index>(offsets.size() - 1);
  IslandBatch* island_batch = &next(0);
  std::size_t largest = 0;
  in_island.assign(bodies.size(), 0);
  for (Index island = 0; island < islands; ++island) {
    if (island_batch->particles >= wanted) island_batch = &next(island);
    island_batch->end_island = island + 1;
    for (Index k = offsets[island]; k < offsets[island + 1]; ++k) {
      in_island[members[k]] = 1;
      addToIslandBatch(*island_batch, *bodies[members[k]], h);
    }
    largest = std::max(largest, island_batch->particles);
  }
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (bodies[b]->asleep || in_island[b]) continue;
    if (island_batch->particles >= wanted) island_batch = &next(islands);
    addToIslandBatch(*island_batch, *bodies[b], h);
  }
  // Where nearly all touch each other, threads share the stages of their substeps better.
  return island_batch_count > 1 && !(threads > 1 && 2 * largest > total);
}

void World::Impl::addToIslandBatch(IslandBatch& island_batch, WorldBody& body, double h) {
  island_batch.bodies.push_back(&body);
  island_batch.particles += body.state.positions.size();
  if (body.batch != kNoIndex && fitsFloat(body, true, h))
    island_batch.side_by_side[body.batch].push_back(&body);
  else
    island_batch.alone.push_back(&body);
}

void World::Impl::stepInIslandBatches(int substeps, double h) {
  auto last = std::chrono::steady_clock::now();
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    WorldBody& body = *bodies[b];
    body.scratch.previous.resize(body.state.positions.size());
    shape_colliders[b].previous = body.asleep ? shape_colliders[b].positions : body.scratch.previous.data();
  }
  for (WorldBatch& batch : batches) {
    batch.step = batchStep(batch.bodies.front()->material, h);
    batch.step.gravity = settings.gravity;
  }
  contacts.beginIslands(shape_colliders);
  runEach(for_each, island_batch_count, [&](std::size_t n) { stepIslandBatch(island_batches[n], substeps, h); });
  report.island_batches = island_batch_count;
  double match = 0.0, contact = 0.0;
  for (std::size_t n = 0; n < island_batch_count; ++n) {
    const IslandBatch& island_batch = island_batches[n];
    report.match_counters += island_batch.match_counters;
    report.preserve_counters += island_batch.preserve_counters;
    report.contact_counters.corrected += island_batch.corrected;
    report.ground_contacts += island_batch.ground_contacts;
    match += island_batch.match;
    contact += island_batch.contact;
  }
  // Threads have been at it at once: what they took together is the time that has passed.
  const double passed = secondsSince(last);
  report.match += passed * match / (match + contact);
  report.contact += passed * contact / (match + contact);
}

void World::Impl::stepIslandBatch(IslandBatch& island_batch, int substeps, double h) {
  for (WorldBody* body : island_batch.bodies) body->scratch.touched.clear();
  for (std::size_t n = 0; n < batches.size(); ++n)
    if (!island_batch.side_by_side[n].empty()) island_batch.lanes[n] = borrowLanes(batches[n]);
  auto last = std::chrono::steady_clock::now();
  contacts.depenetrateIslands(island_batch.first_island, island_batch.end_island, island_batch.corrected);
  island_batch.contact += secondsSince(last);
  for (int substep = 0; substep < substeps; ++substep) {
    for (std::size_t n = 0; n < batches.size(); ++n)
      if (island_batch.lanes[n])
        island_batch.lanes[n]->step(island_batch.side_by_side[n], batches[n].step, island_batch.match_counters);
    for (WorldBody* body : island_batch.alone) matchAlone(*body, h, island_batch.match_counters);
    island_batch.match += secondsSince(last);
    contacts.solveIslands(island_batch.first_island, island_batch.end_island, substep == 0, island_batch.corrected,
                          island_batch.ground_contacts);
    for (WorldBody* body : island_batch.bodies) {
      keepSize(*body, island_batch.preserve_counters);
      velocitiesFromPositions(*body->model, h, body->state, body->scratch);
    }
    island_batch.contact += secondsSince(last);
  }
  const std::lock_guard<std::mutex> lock(lanes_mutex);
  for (std::size_t n = 0; n < batches.size(); ++n)
    if (island_batch.lanes[n]) batches[n].spare.push_back(std::move(island_batch.lanes[n]));
}

// Lanes of the last island batches. No more are made in all than there are threads.
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
      states[i] = {body.state.positions.data(), body.state.velocities.data(), &body.state.poses[0].rotation, true};
    }
    batch.stepInPlace(states, step, counters);
  }
}

}  // namespace meshless
