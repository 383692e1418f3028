#include "meshless_surgery/contact/surface_contacts.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace meshless {
namespace {

constexpr Index kChunk = 256;                            // vertices of a task
constexpr double kTolerance = 1e-3;                      // of the mean edge, of the solver in a substep
constexpr double kTouching = 1e-3;                       // of the mean edge: nearer than this nothing is held apart
constexpr std::uint64_t kGroundKey = ~std::uint64_t{0};  // beyond those of bodies and obstacles
constexpr std::uint64_t kSphereKey = kGroundKey - 1;

Index rootOf(std::vector<Index>& root, Index i) {
  while (root[i] != i) {
    root[i] = root[root[i]];
    i = root[i];
  }
  return i;
}

Box grown(const Box& box, double by) {
  Box larger = box;
  larger.min.array() -= by;
  larger.max.array() += by;
  return larger;
}

RowBody rowBody(const Collider& c, Index number) {
  RowBody body;
  body.number = number;
  body.surface = c.surface;
  body.inverse_masses = c.inverse_masses;
  body.positions = c.positions;
  body.own_share = 1.0 - c.rigid_share;
  body.moves = c.moves;
  return body;
}

}  // namespace

void SurfaceContacts::begin(const std::vector<Collider>& colliders) {
  memory_ = memory();
  set_.clear();
  sides_.clear();
  moving_.clear();
  islands_.clear();
  std::set<std::uint64_t> there{kGroundKey, kSphereKey};
  for (const Collider& c : colliders) there.insert(c.key);
  memory_.filter([&](std::uint64_t a, std::uint64_t b) { return there.count(a) && there.count(b); });
}

void SurfaceContacts::findPairs(const SurfaceScene& scene, const std::vector<Collider>& colliders,
                                ContactCounters& counters) {
  const std::size_t count = colliders.size();
  std::vector<Box> boxes(count);
  std::vector<char> active(count);
  needed_.assign(count, 0);
  std::optional<Box> sphere;
  if (scene.sphere) {
    sphere.emplace();
    sphere->extend(scene.sphere->centre);
    sphere->extend(scene.sphere->centre + scene.sphere->way);
    *sphere = grown(*sphere, scene.sphere->radius);
  }
  for (std::size_t c = 0; c < count; ++c) {
    const Collider& collider = colliders[c];
    active[c] = collider.moves;
    if (collider.bounds.empty()) continue;
    boxes[c] = grown(collider.bounds, searchMargin(collider.edge_length));
    if (!collider.moves) continue;
    if (scene.ground && boxes[c].min.z() <= *scene.ground) needed_[c] = 1;
    if (sphere && boxes[c].overlaps(*sphere)) needed_[c] = 1;
    if (scene.between_bodies && collider.self != PairSearch::Self::kNo) needed_[c] = 1;
  }
  near_.clear();
  if (!scene.between_bodies) return;
  near_ = broad_phase_.find(boxes, active);
  counters.pairs += near_.size();
  counters.bounds_tested += broad_phase_.tested();
  for (const auto& [a, b] : near_) needed_[a] = needed_[b] = 1;
}

PairSearch SurfaceContacts::searchOf(const SurfaceScene& scene, const std::vector<Collider>& colliders, Index a,
                                     Index b, std::vector<RememberedSide>& remembered) const {
  PairSearch search;
  search.a = {colliders[a].surface, &frames_[a]};
  search.b = {colliders[b].surface, &frames_[b]};
  search.h = scene.h;
  search.length = std::min(colliders[a].edge_length, colliders[b].edge_length);
  if (a == b) search.self = colliders[a].self;
  remembered.clear();
  const auto [first, end] = memory_.sidesOf(colliders[a].key, colliders[b].key);
  for (std::size_t k = first; k < end; ++k) remembered.push_back(memory_.sides[k].side);
  search.first = remembered.empty();
  search.remembered = remembered.data();
  search.remembered_count = remembered.size();
  return search;
}

void SurfaceContacts::listTasks(const SurfaceScene& scene, const std::vector<Collider>& colliders,
                                const ForEach& for_each) {
  tasks_.clear();
  looking_.clear();
  const auto addVertices = [&](Index a, Index b) { looking_.push_back({a, b}); };
  for (Index c = 0; c < colliders.size(); ++c) {
    if (!needed_[c] || !colliders[c].moves) continue;
    const double margin = searchMargin(colliders[c].edge_length);
    if (scene.ground && frames_[c].bounds.min.z() - margin <= *scene.ground)
      tasks_.push_back({Task::Kind::kGround, c, kNoIndex});
    if (scene.sphere) tasks_.push_back({Task::Kind::kSphere, c, kNoIndex});
    if (scene.between_bodies && colliders[c].self != PairSearch::Self::kNo) addVertices(c, c);
  }
  for (const auto& [a, b] : near_) {
    if (colliders[a].obstacle && colliders[b].obstacle) continue;
    if (!grown(frames_[a].bounds, searchMargin(std::min(colliders[a].edge_length, colliders[b].edge_length)))
             .overlaps(frames_[b].bounds))
      continue;
    addVertices(a, b);
    addVertices(b, a);
    tasks_.push_back({Task::Kind::kEdgeEdge, a, b});
  }
  near_vertices_.resize(looking_.size());
  runEach(for_each, looking_.size(), [&](std::size_t n) {
    std::vector<RememberedSide> remembered;
    near_vertices_[n] = verticesNear(searchOf(scene, colliders, looking_[n][0], looking_[n][1], remembered));
  });
  for (Index n = 0; n < looking_.size(); ++n) {
    const Index count = static_cast<Index>(near_vertices_[n].size());
    for (Index v = 0; v < count; v += kChunk)
      tasks_.push_back({Task::Kind::kVertexFace, looking_[n][0], looking_[n][1], n, v, std::min(count, v + kChunk)});
  }
}

void SurfaceContacts::placeFrames(const SurfaceScene& scene, const std::vector<Collider>& colliders,
                                  const ForEach& for_each) {
  frames_.resize(colliders.size());
  frame_of_.resize(colliders.size(), 0);
  runEach(for_each, colliders.size(), [&](std::size_t c) {
    const Collider& collider = colliders[c];
    if (!needed_[c]) {
      frame_of_[c] = 0;
      return;
    }
    if (collider.obstacle && frame_of_[c] == collider.key) return;
    frame_of_[c] = collider.obstacle ? collider.key : 0;
    placeFrame(*collider.surface, collider.vertices, collider.moves ? collider.velocities : nullptr, scene.h,
               frames_[c]);
  });
}

void SurfaceContacts::find(const SurfaceScene& scene, const std::vector<Collider>& colliders, ContactCounters& counters,
                           const ForEach& for_each) {
  frame_h_ = scene.h;
  moving_.clear();
  for (const Collider& c : colliders)
    if (c.moves) moving_.push_back(c.key);
  std::sort(moving_.begin(), moving_.end());
  placeFrames(scene, colliders, for_each);
  listTasks(scene, colliders, for_each);
  if (found_.size() < tasks_.size()) found_.resize(tasks_.size());
  runEach(for_each, tasks_.size(), [&](std::size_t t) {
    findTask(scene, colliders, tasks_[t], found_[t]);
    makeRows(scene, colliders, tasks_[t], found_[t]);
  });
  set_.clear();
  sides_.clear();
  reached_.clear();
  for (std::size_t t = 0; t < tasks_.size(); ++t) {
    const Found& found = found_[t];
    set_.append(found.rows);
    counters.lookups += found.looked;
    for (const RememberedSide& side : found.features.sides)
      sides_.push_back({colliders[tasks_[t].a].key, colliders[tasks_[t].b].key, side});
  }
  counters.contacts += set_.rows.size();
  for (const ContactRow& row : set_.rows) {
    if (row.b == kNoIndex) continue;
    for (const Index c : {row.a, row.b})
      if (!colliders[c].moves && !colliders[c].obstacle && row.gap + scene.h * approach(colliders, row) < 0.0)
        reached_.push_back(c);
  }
  std::sort(reached_.begin(), reached_.end());
  reached_.erase(std::unique(reached_.begin(), reached_.end()), reached_.end());
  joinIslands(colliders);
}

double SurfaceContacts::approach(const std::vector<Collider>& colliders, const ContactRow& row) const {
  Vec3 velocity = Vec3::Zero();
  for (Index k = row.begin; k < row.end; ++k) {
    const Collider& c = colliders[k < row.middle ? row.a : row.b];
    if (c.moves) velocity += set_.entries[k].coefficient * c.velocities[set_.entries[k].particle];
  }
  return row.normal.dot(velocity);
}

void SurfaceContacts::findTask(const SurfaceScene& scene, const std::vector<Collider>& colliders, const Task& task,
                               Found& found) const {
  found.features.pairs.clear();
  found.features.sides.clear();
  found.features.watched.clear();
  found.rows.clear();
  found.looked = 0;
  std::vector<RememberedSide> remembered;
  const bool alone = task.b == kNoIndex;
  const PairSearch search = searchOf(scene, colliders, task.a, alone ? task.a : task.b, remembered);
  switch (task.kind) {
    case Task::Kind::kGround:
      return findPlane(search, *scene.ground, found.features.pairs);
    case Task::Kind::kSphere:
      return findSphere(search, scene.sphere->centre, scene.sphere->radius, scene.sphere->way, found.features.pairs);
    case Task::Kind::kEdgeEdge:
      return findEdgeEdge(search, found.features);
    case Task::Kind::kVertexFace:
      found.looked =
          findVertexFace(search, near_vertices_[task.near].data() + task.begin, task.end - task.begin, found.features);
  }
}

void SurfaceContacts::makeRows(const SurfaceScene& scene, const std::vector<Collider>& colliders, const Task& task,
                               Found& found) const {
  const Collider& a = colliders[task.a];
  const Collider* const b = task.b == kNoIndex ? nullptr : &colliders[task.b];
  const bool ground = task.kind == Task::Kind::kGround;
  const double other_friction = b ? b->friction : ground ? scene.ground_friction : a.friction;
  const double friction = std::sqrt(a.friction * other_friction);
  const double restitution = b && !b->obstacle ? std::sqrt(a.restitution * b->restitution) : a.restitution;
  const double skin = b ? skinOf(std::min(a.edge_length, b->edge_length)) : 0.0;
  const RowBody of_a = rowBody(a, task.a), of_b = b ? rowBody(*b, task.b) : RowBody();
  for (const FeaturePair& pair : found.features.pairs) {
    ContactRow* const row = makeRow(pair, of_a, of_b, skin, found.rows);
    if (!row) continue;
    row->friction = friction;
    row->key.a = a.key;
    row->key.b = b ? b->key : ground ? kGroundKey : kSphereKey;
    row->impulse = memory_.forceOf(row->key);
    const double share = b && b->obstacle ? a.restitution : a.obstacle ? b->restitution : restitution;
    if (!(share > 0.0)) continue;
    double speed = 0.0;  // along the normal
    for (int k = 0; k < pair.of_a + pair.of_b; ++k)
      speed += pair.shares[k] * pair.normal.dot(frames_[k < pair.of_a ? task.a : task.b].velocities[pair.vertices[k]]);
    // What gravity gives within a frame is no approach.
    if (-speed > 2.0 * scene.gravity * scene.h) row->bounce = -speed * share;
  }
}

void SurfaceContacts::joinIslands(const std::vector<Collider>& colliders) {
  const Index count = static_cast<Index>(colliders.size());
  std::vector<Index> root(count), number(count, kNoIndex);
  for (Index c = 0; c < count; ++c) root[c] = c;
  const auto moves = [&](Index c) { return c != kNoIndex && colliders[c].moves; };
  const auto join = [&](Index x, Index y) {
    if (!moves(x) || !moves(y)) return;
    const Index a = rootOf(root, x), b = rootOf(root, y);
    root[std::max(a, b)] = std::min(a, b);
  };
  for (const ContactRow& row : set_.rows) join(row.a, row.b);
  for (std::size_t t = 0; t < tasks_.size(); ++t)
    if (!found_[t].features.watched.empty()) join(tasks_[t].a, tasks_[t].b);
  islands_.clear();
  for (Index c = 0; c < count; ++c) {
    if (!moves(c)) continue;
    Index& island = number[rootOf(root, c)];
    if (island == kNoIndex) {
      island = static_cast<Index>(islands_.size());
      islands_.emplace_back();
    }
    islands_[island].bodies.push_back(c);
  }
  for (Index r = 0; r < set_.rows.size(); ++r) {
    const ContactRow& row = set_.rows[r];
    const Index of = moves(row.a) ? row.a : moves(row.b) ? row.b : kNoIndex;
    if (of == kNoIndex) continue;
    Island& island = islands_[number[rootOf(root, of)]];
    island.rows.push_back(r);
    if (row.b == kNoIndex || !moves(row.a) || !moves(row.b)) island.free = false;
  }
  for (std::size_t t = 0; t < tasks_.size(); ++t) {
    const Index of = moves(tasks_[t].a) ? tasks_[t].a : moves(tasks_[t].b) ? tasks_[t].b : kNoIndex;
    if (of == kNoIndex || found_[t].features.watched.empty()) continue;
    MotionLimit& limit = islands_[number[rootOf(root, of)]].limit;
    for (const WatchedFeatures& w : found_[t].features.watched)
      limit.watch(tasks_[t].a, tasks_[t].b, w.vertices, w.of_a);
  }
  lengths_.resize(count);
  limited_.resize(count);
  solver_bodies_.resize(count);
  for (Index c = 0; c < count; ++c) {
    const Collider& collider = colliders[c];
    lengths_[c] = collider.edge_length;
    SolverBody& body = solver_bodies_[c];
    body.positions = collider.positions;
    body.previous = collider.positions;
    body.inverse_masses = collider.inverse_masses;
    body.particles = collider.particles;
    body.groups = collider.groups;
    body.rigid_share = collider.moves && collider.groups ? collider.rigid_share : 0.0;
    limited_[c] = {collider.surface ? &collider.surface->supports : nullptr,
                   collider.positions,
                   collider.positions,
                   collider.particles,
                   collider.moves,
                   collider.inverse_masses};
    body.motions.assign(body.rigid_share > 0.0 ? collider.groups->size() : 0, GroupMotion());
  }
  for (Island& island : islands_)
    for (const Index c : island.bodies)
      if (colliders[c].inverse_masses)
        for (Index i = 0; island.free && i < colliders[c].particles; ++i)
          island.free = colliders[c].inverse_masses[i] > 0.0;
}

std::size_t SurfaceContacts::beginIsland(Index island, SolverScratch& scratch) {
  Island& of = islands_[island];
  double shortest = std::numeric_limits<double>::infinity();
  for (const Index b : of.bodies) shortest = std::min(shortest, lengths_[b]);
  of.tolerance = kTolerance * shortest;
  of.limit.begin(
      limited_, [this](const LimitedPoint& p) { return frames_[p.body].vertices[p.vertex]; }, kTouching * shortest);
  std::vector<Points> before;
  if (std::none_of(of.rows.begin(), of.rows.end(), [this](Index r) { return set_.rows[r].gap < 0.0; })) return 0;
  for (const Index b : of.bodies) {
    before.emplace_back(solver_bodies_[b].positions, solver_bodies_[b].positions + solver_bodies_[b].particles);
    setPrevious(b, before.back().data());
  }
  const std::size_t moved = letOut(set_, of.rows.data(), of.rows.size(), lengths_, frame_h_, solver_bodies_, scratch);
  if (moved > 0) of.limit.apply(limited_, of.bodies);
  return moved;
}

void SurfaceContacts::solveIsland(Index island, SolverStep step, bool first, std::vector<SpringRow>& springs,
                                  SolverScratch& scratch, SolverCounters& counters) {
  const Island& of = islands_[island];
  step.warm = first ? step.h * step.h : 1.0;
  step.tolerance = of.tolerance;
  solveRows(set_, of.rows.data(), of.rows.size(), springs, solver_bodies_, step, of.free && springs.empty(), scratch,
            counters);
  counters.limited += islands_[island].limit.apply(limited_, of.bodies);
}

void SurfaceContacts::finishIsland(Index island, double h) {
  for (const Index r : islands_[island].rows) set_.rows[r].impulse /= h * h;
}

void SurfaceContacts::loadedSurfaces(std::vector<LoadedSurfaces>& pairs) const {
  pairs.clear();
  for (const ContactRow& row : set_.rows)
    if (!row.impulse.isZero(0.0) && row.kind != FeaturePair::Kind::kSphere)
      pairs.push_back({std::min(row.a, row.b), std::max(row.a, row.b)});
  const auto less = [](const LoadedSurfaces& x, const LoadedSurfaces& y) { return std::tie(x.a, x.b) < std::tie(y.a, y.b); };
  std::sort(pairs.begin(), pairs.end(), less);
  pairs.erase(std::unique(pairs.begin(), pairs.end(),
                          [](const LoadedSurfaces& x, const LoadedSurfaces& y) { return x.a == y.a && x.b == y.b; }),
              pairs.end());
}

void SurfaceContacts::points(const std::vector<Collider>& colliders, std::vector<Point>& points) const {
  points.clear();
  for (const ContactRow& row : set_.rows) {
    const double force = row.normal.dot(row.impulse);
    if (!(force > 0.0) || row.kind == FeaturePair::Kind::kSphere) continue;
    Vec3 at = Vec3::Zero();
    double share = 0.0;
    for (Index k = row.begin; k < row.middle; ++k) {
      at += set_.entries[k].coefficient * colliders[row.a].positions[set_.entries[k].particle];
      share += set_.entries[k].coefficient;
    }
    if (share > 0.5) points.push_back({at, row.normal, force});
  }
}

// What has not moved was not looked for, and is as it was.
ContactMemory SurfaceContacts::memory() const {
  ContactMemory now = memory_;
  const auto moved = [&](std::uint64_t key) { return std::binary_search(moving_.begin(), moving_.end(), key); };
  now.filter([&](std::uint64_t a, std::uint64_t b) { return !moved(a) && !moved(b); });
  for (const ContactRow& row : set_.rows)
    if (!row.impulse.isZero(0.0)) now.forces.push_back({row.key, row.impulse});
  now.sides.insert(now.sides.end(), sides_.begin(), sides_.end());
  now.sort();
  return now;
}

void SurfaceContacts::recall(ContactMemory memory) {
  clear();
  memory_ = std::move(memory);
}

void SurfaceContacts::clear() {
  set_.clear();
  sides_.clear();
  moving_.clear();
  islands_.clear();
  memory_ = ContactMemory();
  std::fill(frame_of_.begin(), frame_of_.end(), 0);
}

void SurfaceContacts::forget(std::uint64_t key) {
  ContactMemory kept = memory();
  kept.filter([key](std::uint64_t a, std::uint64_t b) { return a != key && b != key; });
  recall(std::move(kept));
}

std::size_t SurfaceContacts::bytes() const {
  std::size_t sum = broad_phase_.bytes() +
                    bytesOf(near_, needed_, frames_, frame_of_, tasks_, found_, looking_, reached_) +
                    bytesOf(set_.rows, set_.entries, lengths_, solver_bodies_, islands_, memory_.forces, memory_.sides,
                            sides_, moving_);
  for (const SurfaceFrame& frame : frames_) sum += frame.bytes();
  for (const Found& found : found_)
    sum += bytesOf(found.features.pairs, found.features.sides, found.features.watched, found.rows.rows,
                   found.rows.entries);
  for (const SolverBody& body : solver_bodies_) sum += bytesOf(body.motions);
  for (const Island& island : islands_) sum += bytesOf(island.bodies, island.rows) + island.limit.bytes();
  return sum;
}

}  // namespace meshless
