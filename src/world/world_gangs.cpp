// Islands of contact do not know of each other within a frame, nor do bodies that touch nothing. Some of them at a time
// go through all substeps: while they are in the cache, and without a thread that waits for another after each stage.
#include <algorithm>
#include <chrono>

#include "world_impl.h"

namespace meshless {
namespace {

constexpr std::size_t kMostParticles = 1024;  // of a gang of several islands: what a step reads of so many stays in L2
constexpr std::size_t kLeastParticles = 256;  // fewer leave lanes of the batches empty
constexpr std::size_t kGangsPerThread = 4;
constexpr std::size_t kLanes = 64;  // of a batch, side by side

double secondsSince(std::chrono::steady_clock::time_point& last) {
  const auto now = std::chrono::steady_clock::now();
  const double seconds = std::chrono::duration<double>(now - last).count();
  last = now;
  return seconds;
}

void clear(Gang& gang) {
  gang.bodies.clear();
  gang.alone.clear();
  for (std::vector<WorldBody*>& some : gang.side_by_side) some.clear();
  gang.particles = 0;
  gang.match_counters = MatchCounters();
  gang.preserve_counters = PreserveCounters();
  gang.corrected = gang.ground_contacts = 0;
  gang.match = gang.contact = 0.0;
}

}  // namespace

// Tools look at all bodies in each substep, quick pairs are looked up in it, and what has no surface is held above the
// ground by its particles.
bool World::Impl::formGangs(double h) {
  if (!contacts.settled() || !picks.empty() || push.enabled) return false;
  std::size_t total = 0;
  for (const WorldBody* body : awake) {
    if (body->model->surface.vertices.empty()) return false;
    total += body->state.positions.size();
  }
  const std::size_t threads = static_cast<std::size_t>(std::max(1, settings.threads));
  const std::size_t wanted = std::clamp(total / (kGangsPerThread * threads), kLeastParticles, kMostParticles);
  if (total <= wanted) return false;

  gang_count = 0;
  const auto next = [&](Index first_island) -> Gang& {
    if (gang_count == gangs.size()) gangs.emplace_back();
    Gang& gang = gangs[gang_count++];
    clear(gang);
    gang.side_by_side.resize(batches.size());
    gang.lanes.resize(batches.size());
    gang.first_island = gang.end_island = first_island;
    return gang;
  };
  const std::vector<Index>&offsets = contacts.islandOffsets(), &members = contacts.islandParties();
  const Index islands = static_cast<Index>(offsets.size() - 1);
  Gang* gang = &next(0);
  std::size_t largest = 0;
  in_island.assign(bodies.size(), 0);
  for (Index island = 0; island < islands; ++island) {
    if (gang->particles >= wanted) gang = &next(island);
    gang->end_island = island + 1;
    for (Index k = offsets[island]; k < offsets[island + 1]; ++k) {
      in_island[members[k]] = 1;
      addToGang(*gang, *bodies[members[k]], h);
    }
    largest = std::max(largest, gang->particles);
  }
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (bodies[b]->asleep || in_island[b]) continue;
    if (gang->particles >= wanted) gang = &next(islands);
    addToGang(*gang, *bodies[b], h);
  }
  // Where nearly all touch each other, threads share the stages of their substeps better.
  return gang_count > 1 && !(threads > 1 && 2 * largest > total);
}

void World::Impl::addToGang(Gang& gang, WorldBody& body, double h) {
  gang.bodies.push_back(&body);
  gang.particles += body.state.positions.size();
  if (body.batch != kNoIndex && fitsFloat(body, true, h))
    gang.side_by_side[body.batch].push_back(&body);
  else
    gang.alone.push_back(&body);
}

void World::Impl::stepInGangs(int substeps, double h) {
  auto last = std::chrono::steady_clock::now();
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    WorldBody& body = *bodies[b];
    body.scratch.previous.resize(body.state.positions.size());
    parties[b].previous = body.asleep ? parties[b].positions : body.scratch.previous.data();
  }
  for (WorldBatch& batch : batches) {
    batch.step = batchStep(batch.bodies.front()->material, h);
    batch.step.gravity = settings.gravity;
  }
  contacts.beginIslands(parties);
  runEach(for_each, gang_count, [&](std::size_t n) { stepGang(gangs[n], substeps, h); });
  report.gangs = gang_count;
  double match = 0.0, contact = 0.0;
  for (std::size_t n = 0; n < gang_count; ++n) {
    const Gang& gang = gangs[n];
    report.match_counters += gang.match_counters;
    report.preserve_counters += gang.preserve_counters;
    report.contact_counters.corrected += gang.corrected;
    report.ground_contacts += gang.ground_contacts;
    match += gang.match;
    contact += gang.contact;
  }
  // Threads have been at it at once: what they took together is the time that has passed.
  const double passed = secondsSince(last);
  report.match += passed * match / (match + contact);
  report.contact += passed * contact / (match + contact);
}

void World::Impl::stepGang(Gang& gang, int substeps, double h) {
  for (WorldBody* body : gang.bodies) body->scratch.touched.clear();
  for (std::size_t n = 0; n < batches.size(); ++n)
    if (!gang.side_by_side[n].empty()) gang.lanes[n] = borrowLanes(batches[n]);
  auto last = std::chrono::steady_clock::now();
  contacts.letOutIslands(gang.first_island, gang.end_island, gang.corrected);
  gang.contact += secondsSince(last);
  for (int substep = 0; substep < substeps; ++substep) {
    for (std::size_t n = 0; n < batches.size(); ++n)
      if (gang.lanes[n]) gang.lanes[n]->step(gang.side_by_side[n], batches[n].step, gang.match_counters);
    for (WorldBody* body : gang.alone) matchAlone(*body, h, gang.match_counters);
    gang.match += secondsSince(last);
    contacts.solveIslands(gang.first_island, gang.end_island, substep == 0, gang.corrected, gang.ground_contacts);
    for (WorldBody* body : gang.bodies) {
      keepSize(*body, gang.preserve_counters);
      velocitiesFromPositions(*body->model, h, body->state, body->scratch);
    }
    gang.contact += secondsSince(last);
  }
  const std::lock_guard<std::mutex> lock(lanes_mutex);
  for (std::size_t n = 0; n < batches.size(); ++n)
    if (gang.lanes[n]) batches[n].spare.push_back(std::move(gang.lanes[n]));
}

// Those of the last gangs; as many as threads are made in all.
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
