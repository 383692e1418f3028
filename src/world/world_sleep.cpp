// Rest: islands of bodies that hold still sleep, and cost nothing until something reaches them.
#include <algorithm>
#include <cmath>

#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kStillFor = 0.5;    // [s]
constexpr double kStillMean = 0.01;  // [1/s] times the body's size: root mean square of its particles' speeds
constexpr double kStillMost = 0.02;  // [1/s] likewise, of the fastest
constexpr double kTrembling = 5.0;   // times that: a body that trembles faster within a frame is not checked

Index rootOf(std::vector<Index>& root, Index i) {
  while (root[i] != i) {
    root[i] = root[root[i]];
    i = root[i];
  }
  return i;
}

double sizeOf(const Box& box) { return (box.max - box.min).maxCoeff(); }

// By where it is a frame later: what trembles from substep to substep and stays where it is does not keep it awake.
bool isStill(const WorldBody& body, double h_frame) {
  if (!body.slow) return false;
  const double size = sizeOf(body.bounds) * h_frame;
  const double most = kStillMost * size, mean = kStillMean * size;
  double sum = 0.0;
  for (std::size_t i = 0; i < body.state.positions.size(); ++i) {
    const double squared = (body.state.positions[i] - body.frame_start[i]).squaredNorm();
    if (!(squared <= most * most) && body.model->isTissue(i)) return false;  // nobody sees the far corner of a cell
    sum += body.model->masses[i] * squared;
  }
  return sum <= mean * mean * body.model->mass;
}

}  // namespace

void World::Impl::wake(WorldBody& body) {
  body.still_for = 0.0;
  if (!body.asleep) return;
  const std::uint32_t group = body.sleep_group;
  for (auto& other : bodies)
    if (other->asleep && other->sleep_group == group) {
      other->asleep = false;
      other->still_for = 0.0;
      ++report.woken;
      say(EventType::kAwake, other->name, 0, other->name + " woke");
    }
}

void World::Impl::wakeWithin(const Box& box) {
  for (auto& body : bodies)
    if (body->asleep && body->bounds.overlaps(box)) wake(*body);
}

void World::Impl::listAwake() {
  awake.clear();
  for (auto& body : bodies)
    if (!body->asleep) awake.push_back(body.get());
}

// Where those are that may fall asleep: something is near them, or holds them, and they are slow.
void World::Impl::rememberSlow() {
  if (!settings.sleep) return;
  for (Index b = 0; b < bodies.size(); ++b) {
    WorldBody& body = *bodies[b];
    body.slow = false;
    if (body.asleep || (!isNearAnything(b) && !body.model->any_fixed && picks.empty())) continue;
    const double most = kTrembling * kStillMost * sizeOf(body.bounds);
    body.slow = true;
    for (std::size_t i = 0; i < body.state.velocities.size() && body.slow; ++i)
      body.slow = body.state.velocities[i].squaredNorm() <= most * most || !body.model->isTissue(i);
    if (body.slow) body.frame_start = body.state.positions;
  }
}

bool World::Impl::isNearAnything(Index body) const {
  return contactMethod() == ContactMethod::kSurface ? surface_contacts.needed()[body] : contacts.needed()[body];
}

void World::Impl::listLoaded() {
  loaded.clear();
  if (contactMethod() == ContactMethod::kRestShape) contacts.loadedPairs(loaded);
  if (contactMethod() != ContactMethod::kSurface) return;
  std::vector<LoadedSurfaces> pairs;
  surface_contacts.loadedSurfaces(pairs);
  for (const LoadedSurfaces& pair : pairs) loaded.push_back({pair.a, pair.b});
}

// An island sleeps where all of it has held still long enough and something holds it: without that, what drifts slowly
// through space would stop.
void World::Impl::fallAsleep(double h_frame) {
  if (!settings.sleep || awake.empty()) return;
  if (contactMethod() != ContactMethod::kRestShape && contactMethod() != ContactMethod::kSurface) return;
  bool any = false;
  for (WorldBody* body : awake) {
    body->still_for = isStill(*body, h_frame) ? body->still_for + h_frame : 0.0;
    any = any || body->still_for >= kStillFor;
  }
  if (!any) return;

  std::vector<Index> root(bodies.size());
  std::vector<char> held(bodies.size(), 0), ready(bodies.size(), 1);
  for (Index b = 0; b < bodies.size(); ++b) {
    root[b] = b;
    held[b] = bodies[b]->model->any_fixed;
  }
  listLoaded();
  for (const LoadedPair& pair : loaded) {
    if (pair.a >= bodies.size()) continue;
    if (pair.b >= bodies.size()) {  // the ground, or an obstacle
      held[pair.a] = 1;
    } else {
      const Index a = rootOf(root, pair.a), b = rootOf(root, pair.b);
      root[std::max(a, b)] = std::min(a, b);
    }
  }
  for (const Pick& pick : picks)
    for (Index b = 0; b < bodies.size(); ++b)
      if (bodies[b]->id == pick.body) held[b] = 1;
  for (Index b = 0; b < bodies.size(); ++b) {
    const Index r = rootOf(root, b);
    held[r] |= held[b];
    if (!bodies[b]->asleep && !(bodies[b]->still_for >= kStillFor)) ready[r] = 0;
  }
  std::vector<std::uint32_t> group(bodies.size(), 0);
  for (Index b = 0; b < bodies.size(); ++b) {
    const Index r = rootOf(root, b);
    WorldBody& body = *bodies[b];
    if (body.asleep || !ready[r] || !held[r]) continue;
    if (!group[r]) group[r] = next_sleep_group++;
    body.asleep = true;
    body.sleep_group = group[r];
    for (Vec3& v : body.state.velocities) v.setZero();
    say(EventType::kAsleep, body.name, 0, body.name + " fell asleep");
  }
}

}  // namespace meshless
