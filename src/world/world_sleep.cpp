// Rest: islands of bodies that hold still sleep, and cost nothing until something reaches them.
#include <algorithm>
#include <cmath>

#include "world_impl.h"

namespace meshless {
namespace {

// A body holds still while it stays within a thousandth of its size for this long, and within a thousandth of the way
// that it would fall meanwhile: at small loads that is less, and forces that are not in balance show there too.
constexpr double kStillFor = 0.5;  // [s]
constexpr double kStillShare = 1e-3;

Index rootOf(std::vector<Index>& root, Index i) {
  while (root[i] != i) {
    root[i] = root[root[i]];
    i = root[i];
  }
  return i;
}

double sizeOf(const Box& box) { return (box.max - box.min).maxCoeff(); }

// What trembles and stays where it is does not keep a body awake.
bool isWhereItWas(const WorldBody& body, double gravity) {
  const Points& now = body.state.positions;
  if (body.rest_from.size() != now.size()) return false;
  double most = sizeOf(body.bounds);
  if (gravity > 0.0) most = std::min(most, 0.5 * gravity * kStillFor * kStillFor);
  most *= kStillShare;
  for (std::size_t i = 0; i < now.size(); ++i)  // nobody sees the far corner of a cell
    if (!((now[i] - body.rest_from[i]).squaredNorm() <= most * most) && body.model->isTissue(i)) return false;
  return true;
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

void World::Impl::listLoaded() {
  surface_contacts.loadedSurfaces(loaded);
}

// An island sleeps where all of it has held still long enough and something holds it: without that, what drifts slowly
// through space would stop.
void World::Impl::fallAsleep(double h_frame) {
  if (!settings.sleep || awake.empty()) return;
  bool any = false;
  for (WorldBody* body : awake) {
    if (isWhereItWas(*body, settings.gravity.norm())) {
      body->still_for += h_frame;
    } else {
      body->still_for = 0.0;
      body->rest_from = body->state.positions;
    }
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
  for (const LoadedSurfaces& pair : loaded) {
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
