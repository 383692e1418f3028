// Rest: islands of bodies that hold still sleep, and cost nothing until something reaches them.
#include <algorithm>
#include <cmath>
#include <limits>

#include "world_impl.h"

namespace meshless {
namespace {

// A body holds still while it stays within a thousandth of its island's size for this long, and within a thousandth of
// the way that it would fall meanwhile: at small loads that is less, and forces that are not in balance show there too.
constexpr double kStillFor = 0.5;  // [s]
constexpr double kStillShare = 1e-3;
constexpr double kRelaxed = 0.01;  // of the strain: so much may still fade in who sleeps

double sizeOf(const Box& box) { return (box.max - box.min).maxCoeff(); }

/// [m] by which any of its tissue is away from where it rested; nobody sees the far corner of a cell.
double wayFromRest(const WorldBody& body) {
  const Points& now = body.state.positions;
  if (body.rest_from.size() != now.size()) return std::numeric_limits<double>::infinity();
  double most = 0.0;
  for (std::size_t i = 0; i < now.size(); ++i)
    if (const double way = (now[i] - body.rest_from[i]).squaredNorm(); !(way <= most) && body.model->isTissue(i))
      most = way;
  return std::sqrt(most);
}

bool leaks(const WorldBody& body) {
  return std::any_of(body.state.cavities.begin(), body.state.cavities.end(),
                     [](const FilledCavity& cavity) { return cavity.open_for > 0.0; });
}

/// Whether what holds it is on its way.
bool isBeingMoved(const WorldBody& body) {
  return std::any_of(body.state.held.begin(), body.state.held.end(),
                     [](const HeldMotion& motion) { return motion.left > 0.0; });
}

/// Whether it creeps, however slowly: stress that fades moves tissue later.
bool relaxes(const WorldBody& body) {
  const BodyState& state = body.state;
  if (!body.material.relaxes() || state.relaxed.empty() || !body.model->cells) return false;
  return relaxingShare(*body.model->cells, relaxationStep(body.material.relaxation, 0.0), state.positions, state.cells,
                       state.relaxed, state.swelling, state.plastic_cells) > kRelaxed;
}

/// Less than a cell of tissue: it rocks on a point, and whoever sleeps on it does not mind.
bool isCrumb(const WorldBody& body) {
  return body.model->mass < body.material.density * std::pow(body.model->spacing, 3);
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

void World::Impl::listLoaded() { surface_contacts.loadedSurfaces(loaded); }

// An island sleeps where all of it has held still long enough and something holds it: without that, what drifts slowly
// through space would stop.
void World::Impl::fallAsleep(double h_frame) {
  if (!settings.sleep || awake.empty()) return;
  auto& [joined, held, ready, whole, size, group] = sleepers;
  joined.reset(bodies.size());
  held.assign(bodies.size(), 0);
  ready.assign(bodies.size(), 1);
  whole.assign(bodies.size(), 0);
  for (Index b = 0; b < bodies.size(); ++b) held[b] = bodies[b]->model->any_fixed;
  listLoaded();
  std::vector<Index> in_hand(instruments.size(), kNoIndex), led;  // a body each; bodies in hands that move
  for (const auto& [a, b] : loaded) {
    if (a >= bodies.size()) continue;
    if (b >= bodies.size()) {  // the ground, an obstacle, or an instrument: whoever it touches moves with it
      held[a] = 1;
      if (b == kNoIndex || b < bodies.size() + obstacles.size()) continue;
      const std::size_t n = b - bodies.size() - obstacles.size();
      if (!instrument_bodies[n]->still) led.push_back(a);
      if (in_hand[n] != kNoIndex) joined.join(a, in_hand[n]);
      in_hand[n] = a;
    } else
      joined.join(a, b);
  }
  for (const AttachedFibre& fibre : attached.all) {
    if (fibre.b == kNoIndex)
      held[fibre.a] = 1;
    else
      joined.join(fibre.a, fibre.b);
  }
  for (const Pick& pick : picks)
    for (Index b = 0; b < bodies.size(); ++b)
      if (bodies[b]->id == pick.body) held[b] = 1;
  size.assign(bodies.size(), 0.0);
  for (Index b = 0; b < bodies.size(); ++b) {
    const Index r = joined.find(b);
    held[r] |= held[b];
    whole[r] |= !isCrumb(*bodies[b]);
    size[r] = std::max(size[r], sizeOf(bodies[b]->bounds));
  }
  for (const Index b : led) ready[joined.find(b)] = 0;
  const double gravity = settings.gravity.norm();
  for (Index b = 0; b < bodies.size(); ++b) {
    WorldBody& body = *bodies[b];
    if (body.asleep) continue;
    const Index r = joined.find(b);
    double most = size[r];
    if (gravity > 0.0) most = std::min(most, 0.5 * gravity * kStillFor * kStillFor);
    if (wayFromRest(body) <= kStillShare * most && !leaks(body) && !isBeingMoved(body) && forced.count(&body) == 0) {
      body.still_for += h_frame;
    } else {
      body.still_for = 0.0;
      body.rest_from = body.state.positions;
    }
    if (!(body.still_for >= kStillFor) && !(whole[r] && isCrumb(body))) ready[r] = 0;
    if (ready[r] && body.still_for >= kStillFor && relaxes(body)) {  // asked again when it was still as long again
      body.still_for = 0.0;
      ready[r] = 0;
    }
  }
  group.assign(bodies.size(), 0);
  for (Index b = 0; b < bodies.size(); ++b) {
    const Index r = joined.find(b);
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
