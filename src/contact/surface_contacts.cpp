#include "meshless_surgery/contact/surface_contacts.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace meshless {
namespace {

constexpr std::uint64_t kGroundKey = ~std::uint64_t{0};  // beyond those of bodies and obstacles
constexpr std::uint64_t kSphereKey = kGroundKey - 1;
// What cells show of a force is blurred over a distance, squared: so many spacings, and times the mean square of how
// far the particles are that carry it. Measured on blocks and cylinders with the pushed sphere at many places.
constexpr double kBlur = 2.0, kBlurOfWidth = 30.0;
constexpr double kMostGiven = 1.0 / 3.0;  // radii of the push sphere, by which tissue is in it at most
constexpr Index kChunk = 1024;            // particles

Box grown(const Box& box, double by) {
  Box larger = box;
  larger.min.array() -= by;
  larger.max.array() += by;
  return larger;
}

double restitutionOf(const Collider& a, const Collider* b) {
  if (!b || b->obstacle) return a.restitution;
  return a.obstacle ? b->restitution : std::sqrt(a.restitution * b->restitution);
}

WayBox sinceOf(const WayBox& gone, const WayBox& then, const WayBox& ahead) {
  return {gone.least - then.least + ahead.least, gone.most - then.most + ahead.most};
}

double farthestOf(const WayBox& way) { return way.least.cwiseAbs().cwiseMax(way.most.cwiseAbs()).norm(); }

/// Whether it may be elsewhere after the frame.
bool goes(const Collider& collider) { return collider.moves || (collider.led && collider.velocities); }

// Rows ascend by their names, as features do.
const ContactRow* rowOfName(const std::vector<ContactRow>& rows, const ContactRow& like) {
  const auto at = std::lower_bound(rows.begin(), rows.end(), like,
                                   [](const ContactRow& x, const ContactRow& y) { return x.name() < y.name(); });
  return at != rows.end() && at->name() == like.name() ? &*at : nullptr;
}

/// [N] that rows press with, without friction, between frames.
Vec3 pressOf(const RowSet& set) {
  Vec3 sum = Vec3::Zero();
  for (const ContactRow& row : set.rows) sum += std::max(0.0, row.normal.dot(row.impulse)) * row.normal;
  return sum;
}

/// What of the half space's answer to a force [1, over pi modulus distance] cells are too coarse to show, at so many
/// `reach`: with no mean over the plane, as cells answer even pressure as they should.
double finePart(double t) { return t < 1.0 ? (1.0 - t) * (1.0 - t) * (1.0 - t) * (1.0 - 5.0 * t) : 0.0; }

struct LoadedPoint {
  Vec3 place;  // [m]
  Vec3 normal;
  double disc;     // [m] radius of a disc of the area that it stands for
  double reach;    // [m] nearer than this the cells show too little
  double modulus;  // [Pa]
};

/// How rows of points on a half space give way: Boussinesq's answer, of a disc to its own force, less what cells show.
/// Points that reach each other are found by their order along x, y or z, whichever they spread along most.
void addFine(const std::vector<LoadedPoint>& points, FineAnswer& fine) {
  Box around;
  double farthest = 0.0;
  for (const LoadedPoint& point : points) {
    around.extend(point.place);
    farthest = std::max(farthest, point.reach);
  }
  int axis;
  (around.max - around.min).maxCoeff(&axis);
  static thread_local std::vector<std::pair<double, Index>> order;
  static thread_local std::vector<Index> rank;
  order.clear();
  for (Index n = 0; n < points.size(); ++n) order.emplace_back(points[n].place[axis], n);
  std::sort(order.begin(), order.end());
  rank.resize(points.size());
  for (Index k = 0; k < order.size(); ++k) rank[order[k].second] = k;
  fine.offsets.push_back(0);
  for (Index n = 0; n < points.size(); ++n) {
    const LoadedPoint& at = points[n];
    const double left = std::max(0.0, 1.0 - at.disc / at.reach);
    fine.entries.push_back({2.0 / (M_PI * at.modulus * at.disc) * left * left * left * left, n});
    const auto meet = [&](Index k) {
      const LoadedPoint& other = points[k];
      const double away = (other.place - at.place).norm();
      const double reach = std::sqrt(0.5 * (at.reach * at.reach + other.reach * other.reach));
      if (!(away < reach)) return;
      const double scale = 1.0 / (M_PI * std::sqrt(at.modulus * other.modulus) * std::max(away, at.disc));
      fine.entries.push_back({scale * at.normal.dot(other.normal) * finePart(away / reach), k});
    };
    const Index mine = rank[n];
    for (Index k = mine; k-- > 0 && order[mine].first - order[k].first < farthest;) meet(order[k].second);
    for (Index k = mine + 1; k < order.size() && order[k].first - order[mine].first < farthest; ++k)
      meet(order[k].second);
    fine.offsets.push_back(static_cast<Index>(fine.entries.size()));
  }
}

/// [m^2] Mean square of how far, across its normal and along one axis, a row's particles are from its point.
double widthOf(const ContactRow& row, const RowSet& set, const Vec3* positions, const Vec3& point) {
  double sum = 0.0;
  for (Index k = row.begin; k < row.middle; ++k) {
    const Vec3 way = positions[set.entries[k].particle] - point;
    sum += set.entries[k].coefficient * (way - row.normal.dot(way) * row.normal).squaredNorm();
  }
  return std::max(0.0, 0.5 * sum);
}

/// [Pa] of what carries a row.
double modulusOf(const ContactRow& row, const RowSet& set, const Collider& collider) {
  if (!collider.stiffness) return collider.modulus;
  double sum = 0.0;
  for (Index k = row.begin; k < row.middle; ++k)
    sum += set.entries[k].coefficient * collider.stiffness[set.entries[k].particle];
  return collider.modulus * std::max(sum, 1e-3);
}

/// [Pa] The same of all that presses, by how much it does.
double modulusOf(const RowSet& set, const Collider& collider) {
  if (!collider.stiffness) return collider.modulus;
  double sum = 0.0, pressed = 0.0;
  for (const ContactRow& row : set.rows) {
    const double press = std::max(0.0, row.normal.dot(row.impulse));
    sum += press * modulusOf(row, set, collider);
    pressed += press;
  }
  return pressed > 0.0 ? sum / pressed : collider.modulus;
}

}  // namespace

SurfaceContacts::Pair& SurfaceContacts::pairOf(Kind kind, const std::vector<Collider>& colliders, Index a, Index b,
                                               std::uint64_t key_b) {
  std::unique_ptr<Pair>& pair = known_[{colliders[a].key, key_b, kind}];
  if (!pair) {
    pair = std::make_unique<Pair>();
    pair->kind = kind;
    pair->key_a = colliders[a].key;
    pair->key_b = key_b;
  }
  pair->a = a;
  pair->b = b;
  pair->near = true;
  pairs_.push_back(pair.get());
  return *pair;
}

void SurfaceContacts::findPairs(const SurfaceScene& scene, const std::vector<Collider>& colliders,
                                ContactCounters& counters) {
  const Index count = static_cast<Index>(colliders.size());
  boxes_.assign(count, Box());
  active_.assign(count, 0);
  needed_.assign(count, 0);
  pairs_.clear();
  Box sphere;  // empty: none
  if (scene.sphere) {
    sphere.extend(scene.sphere->centre);
    sphere.extend(scene.sphere->centre + scene.sphere->way);
    sphere = grown(sphere, scene.sphere->radius);
  }
  numbers_.clear();
  for (Index c = 0; c < count; ++c) {
    const Collider& collider = colliders[c];
    numbers_.push_back({collider.key, c});
    active_[c] = goes(collider);
    needed_[c] = collider.grasped;
    if (collider.bounds.empty()) continue;
    boxes_[c] = grown(collider.bounds, searchMargin(collider.edge_length));
    if (!collider.moves) continue;
    if (scene.ground && boxes_[c].min.z() <= *scene.ground) pairOf(Kind::kGround, colliders, c, kNoIndex, kGroundKey);
    if (boxes_[c].overlaps(sphere)) pairOf(Kind::kSphere, colliders, c, kNoIndex, kSphereKey);
    if (scene.surfaces && collider.self != PairSearch::Self::kNo)
      pairOf(Kind::kVertexFace, colliders, c, c, collider.key);
  }
  std::sort(numbers_.begin(), numbers_.end());
  for (const SurfaceScene::Given& given : scene.given)
    pairOf(Kind::kGiven, colliders, given.a, given.b, colliders[given.b].key).set = given.set;
  if (!scene.surfaces) std::fill(active_.begin(), active_.end(), 0);
  for (const auto& [a, b] : broad_phase_.find(boxes_, active_)) {
    if (colliders[a].obstacle && colliders[b].obstacle) continue;
    ++counters.pairs;
    pairOf(Kind::kVertexFace, colliders, a, b, colliders[b].key);
    pairOf(Kind::kVertexFace, colliders, b, a, colliders[a].key);
  }
  counters.bounds_tested += broad_phase_.tested();
  for (const Pair* pair : pairs_) {
    const char by = pair->a == pair->b ? 1 : kNear;
    needed_[pair->a] = std::max(needed_[pair->a], by);
    if (pair->b != kNoIndex) needed_[pair->b] = std::max(needed_[pair->b], by);
  }
  // Between those that sleep all stays as it was; what is apart is forgotten.
  const auto stays = [&](std::uint64_t key) {
    const Index c = colliderOf(key);
    return c != kNoIndex && !colliders[c].moves;
  };
  for (auto at = known_.begin(); at != known_.end();) {
    Pair& pair = *at->second;
    const bool kept =
        std::exchange(pair.near, false) || (stays(pair.key_a) && (pair.key_b == kGroundKey || stays(pair.key_b)));
    at = kept ? std::next(at) : known_.erase(at);
  }
}

Index SurfaceContacts::colliderOf(std::uint64_t key) const {
  const auto at = std::lower_bound(numbers_.begin(), numbers_.end(), std::make_pair(key, Index{0}));
  return at != numbers_.end() && at->first == key ? at->second : kNoIndex;
}

void SurfaceContacts::findMoved(const SurfaceScene& scene, const std::vector<Collider>& colliders) {
  const Index count = static_cast<Index>(colliders.size());
  for (auto at = ways_.begin(); at != ways_.end();) {
    const Index c = colliderOf(at->first);
    const bool near = c != kNoIndex && (needed_[c] || !colliders[c].moves);  // a sleeping collider's rows count from it
    at = near ? std::next(at) : ways_.erase(at);
  }
  gone_.assign(count, WayBox());
  ahead_.assign(count, WayBox());
  velocities_.resize(count);
  for (Index c = 0; c < count; ++c) {
    const Collider& collider = colliders[c];
    if (!needed_[c] || (collider.obstacle && !collider.led)) continue;
    KeptWay& way = ways_[collider.key];
    way.key = collider.key;
    const VertexSupports& supports = collider.surface->supports;
    const Index vertices = collider.surface->vertices();
    const bool known = way.last.size() == vertices;
    way.last.resize(vertices, Vec3::Zero());
    velocities_[c].assign(vertices, Vec3::Zero());
    Box gone, velocities;
    for (Index v = 0; v < vertices && (goes(collider) || !known); ++v) {
      const Vec3 place = supports.sum(v, collider.positions);
      if (goes(collider)) {
        Vec3& velocity = velocities_[c][v] = supports.sum(v, collider.velocities);
        // Who goes farther than an edge between two searches passes what is thin as it is.
        const double edges = scene.h * velocity.norm() / collider.edge_length;
        if (edges > 1.0) velocity /= edges;
      }
      gone.extend(place - way.last[v]);
      velocities.extend(velocities_[c][v]);
      way.last[v] = place;
    }
    if (!velocities.empty()) ahead_[c] = {scene.h * velocities.min, scene.h * velocities.max};
    if (known && !gone.empty()) way.gone = {way.gone.least + gone.min, way.gone.most + gone.max};
    gone_[c] = way.gone;
  }
  moved_.assign(count, 0);
  for (Pair* pair : pairs_) {
    const Collider& a = colliders[pair->a];
    const Collider* const b = pair->b == kNoIndex ? nullptr : &colliders[pair->b];
    const double length = b ? std::min(a.edge_length, b->edge_length) : a.edge_length;
    const double skin = b ? kSkin * length : 0.0;
    const WayBox by_a = sinceOf(gone_[pair->a], pair->way_a, ahead_[pair->a]);
    double gone = pair->a == pair->b ? (by_a.most - by_a.least).norm() : b ? farthestOf(by_a) : -by_a.least.z();
    if (b && pair->a != pair->b) gone += farthestOf(sinceOf(gone_[pair->b], pair->way_b, ahead_[pair->b]));
    pair->stale = !pair->found || pair->kind == Kind::kSphere || !(gone <= searchMargin(length) - skin);
    pair->stale = pair->stale && pair->kind != Kind::kGiven;
    if (!pair->stale) continue;
    pair->way_a = gone_[pair->a];
    if (b) pair->way_b = gone_[pair->b];
    moved_[pair->a] = 1;
    if (b) moved_[pair->b] = 1;
  }
}

void SurfaceContacts::find(const SurfaceScene& scene, const std::vector<Collider>& colliders, ContactCounters& counters,
                           const ForEach& for_each) {
  frames_.resize(colliders.size());
  frame_of_.resize(colliders.size(), 0);
  runEach(for_each, colliders.size(), [&](std::size_t c) {
    const Collider& collider = colliders[c];
    const bool stays = collider.obstacle && !collider.led;
    if (!moved_[c] || (stays && frame_of_[c] == collider.key)) return;
    frame_of_[c] = stays ? collider.key : 0;
    const Vec3* const vertices = collider.vertices ? collider.vertices : ways_.find(collider.key)->second.last.data();
    placeFrame(*collider.surface, vertices, goes(collider) ? velocities_[c].data() : nullptr, scene.h, frames_[c]);
  });
  runEach(for_each, pairs_.size(), [&](std::size_t n) {
    if (pairs_[n]->stale) findPair(scene, colliders, *pairs_[n]);
  });
  for (const Pair* pair : pairs_) {
    counters.contacts += pair->set.rows.size();
    if (pair->a == pair->b) counters.self_points += pair->set.rows.size();
    if (pair->stale) counters.queries += pair->queried;
  }
  listReached(scene, colliders);
  joinIslands(scene, colliders);
}

void SurfaceContacts::findPair(const SurfaceScene& scene, const std::vector<Collider>& colliders, Pair& pair) {
  const Collider& a = colliders[pair.a];
  const Collider& b = colliders[pair.b == kNoIndex ? pair.a : pair.b];
  static thread_local SearchScratch scratch;
  scratch.pairs.clear();
  scratch.sides.clear();
  PairSearch search;
  search.a = {a.surface, &frames_[pair.a]};
  search.b = {b.surface, &frames_[pair.b == kNoIndex ? pair.a : pair.b]};
  search.h = scene.h;
  search.length = std::min(a.edge_length, b.edge_length);
  search.spacing = std::min(a.spacing, b.spacing);
  if (pair.a == pair.b) search.self = a.self;
  search.remembered = pair.sides.data();
  search.remembered_count = pair.sides.size();
  search.first = !pair.found;
  switch (pair.kind) {
    case Kind::kGround:
      findPlane(search, *scene.ground, scratch.pairs);
      break;
    case Kind::kSphere:
      findSphere(search,
                 {scene.sphere->centre, scene.sphere->way, scene.sphere->radius, pressOf(pair.set),
                  modulusOf(pair.set, a), std::min(a.spacing, a.edge_length)},
                 scratch.pairs);
      break;
    case Kind::kGiven:
      break;
    case Kind::kVertexFace:
      if (pair.a == pair.b) placeNormalBoxes(*a.surface, frames_[pair.a]);
      pair.queried = findVertexFace(search, scratch);
  }
  makeRows(scene, colliders, scratch.pairs, pair);
  pair.sides.assign(scratch.sides.begin(), scratch.sides.end());
  pair.found = true;
}

void SurfaceContacts::makeRows(const SurfaceScene& scene, const std::vector<Collider>& colliders,
                               const std::vector<FeaturePair>& found, Pair& pair) const {
  const Collider& a = colliders[pair.a];
  const Collider* const b = pair.b == kNoIndex ? nullptr : &colliders[pair.b];
  const double other_friction = b ? b->friction : pair.kind == Kind::kGround ? scene.ground_friction : a.friction;
  const double friction = std::sqrt(a.friction * other_friction);
  const double restitution = restitutionOf(a, b);
  const double skin = b ? kSkin * std::min(a.edge_length, b->edge_length) : 0.0;
  RowBody of_a{a.surface, a.positions, frames_[pair.a].vertices.data(), a.inverse_masses}, of_b;
  if (b) of_b = {b->surface, b->positions, frames_[pair.b].vertices.data(), b->inverse_masses};
  static thread_local std::vector<ContactRow> old;
  old.swap(pair.set.rows);
  pair.set.clear();
  pair.fine.entries.clear();
  pair.fine.offsets.clear();
  static thread_local std::vector<LoadedPoint> points;
  points.clear();
  for (const FeaturePair& features : found) {
    ContactRow* const row = makeRow(features, of_a, of_b, skin, pair.set);
    if (!row) continue;
    if (features.area > 0.0 && a.modulus > 0.0) {
      Vec3 at = Vec3::Zero();
      for (int k = 0; k < features.of_a; ++k) at += features.shares[k] * of_a.vertices[features.vertices[k]];
      const double s = std::min(a.spacing, a.edge_length);
      points.push_back({at, features.normal, std::sqrt(features.area / M_PI),
                        std::sqrt(kBlur * s * s + kBlurOfWidth * widthOf(*row, pair.set, a.positions, at)),
                        modulusOf(*row, pair.set, a)});
    }
    row->friction = friction;
    row->restitution = restitution;
    if (const ContactRow* before = rowOfName(old, *row)) row->impulse = before->impulse;
  }
  if (points.empty()) return;
  // The theory is one of contacts that are small beside the sphere: tissue would let a deep one in as a whole.
  pair.fine.most = kMostGiven * scene.sphere->radius;
  addFine(points, pair.fine);
}

void SurfaceContacts::listReached(const SurfaceScene& scene, const std::vector<Collider>& colliders) {
  reached_.clear();
  for (const Pair* pair : pairs_) {
    if (pair->b == kNoIndex) continue;
    const auto sleeps = [&](Index c) { return !colliders[c].moves && !colliders[c].obstacle; };
    if (!sleeps(pair->a) && !sleeps(pair->b)) continue;
    const bool led = colliders[pair->a].led || colliders[pair->b].led;
    for (const ContactRow& row : pair->set.rows) {
      double gap = row.constant, approach = 0.0;
      for (Index k = row.begin; k < row.end; ++k) {
        const Collider& c = colliders[k < row.middle ? pair->a : pair->b];
        const RowEntry& entry = pair->set.entries[k];
        gap += entry.coefficient * row.normal.dot(c.positions[entry.particle]);
        if (goes(c)) approach += entry.coefficient * row.normal.dot(c.velocities[entry.particle]);
      }
      // What is held by friction goes along.
      if (!(gap + scene.h * approach < 0.0) && !(led && !row.impulse.isZero(0.0))) continue;
      for (const Index c : {pair->a, pair->b})
        if (sleeps(c)) reached_.push_back(c);
      break;
    }
  }
  std::sort(reached_.begin(), reached_.end());
  reached_.erase(std::unique(reached_.begin(), reached_.end()), reached_.end());
}

void SurfaceContacts::joinIslands(const SurfaceScene& scene, const std::vector<Collider>& colliders) {
  const Index count = static_cast<Index>(colliders.size());
  fillSlots(colliders);
  joined_.reset(count);
  island_of_.assign(count, kNoIndex);
  const auto moves = [&](Index c) { return c != kNoIndex && colliders[c].moves; };
  const auto joins = [&](Index c) { return colliders[c].moves || colliders[c].led; };
  for (const Pair* pair : pairs_)
    if (pair->b != kNoIndex && joins(pair->a) && joins(pair->b) && !pair->set.rows.empty())
      joined_.join(pair->a, pair->b);
  for (const SurfaceScene::Join& join : scene.joins)
    if (moves(join.a) && moves(join.b)) joined_.join(join.a, join.b);
  Index islands = 0;
  for (Index c = 0; c < count; ++c) {
    if (!moves(c)) continue;
    Index& island = island_of_[joined_.find(c)];
    if (island == kNoIndex) {
      island = islands++;
      if (island == islands_.size()) islands_.emplace_back();
      islands_[island].bodies.clear();
      islands_[island].led.clear();
      islands_[island].rows.clear();
      islands_[island].held = islands_[island].joined = false;
    }
    islands_[island].bodies.push_back(c);
    islands_[island].held = islands_[island].held || colliders[c].held;
  }
  islands_.resize(islands);
  for (Index c = 0; c < count; ++c)
    if (const Index island = island_of_[joined_.find(c)]; colliders[c].led && island != kNoIndex)
      islands_[island].led.push_back(c);
  for (Pair* pair : pairs_) {
    const Index of = moves(pair->a) ? pair->a : pair->b;
    if (pair->set.rows.empty() || !moves(of)) continue;
    Island& island = islands_[island_of_[joined_.find(of)]];
    island.rows.push_back({&pair->set, pair->a, pair->b, pair->fine.offsets.empty() ? nullptr : &pair->fine});
    island.held = island.held || !moves(pair->a) || !moves(pair->b);
  }
  for (const SurfaceScene::Join& join : scene.joins) {
    if (!moves(join.a)) continue;
    Island& island = islands_[island_of_[joined_.find(join.a)]];
    island.joined = true;
    island.held = island.held || !moves(join.b);
  }
}

void SurfaceContacts::fillSlots(const std::vector<Collider>& colliders) {
  const Index count = static_cast<Index>(colliders.size());
  first_slots_.assign(count + 1, 0);
  for (Index c = 0; c < count; ++c) first_slots_[c + 1] = first_slots_[c] + (needed_[c] ? colliders[c].particles : 0);
  now_.resize(first_slots_[count]);
  before_.resize(first_slots_[count]);
  solver_bodies_.resize(count);
  for (Index c = 0; c < count; ++c) {
    const Collider& collider = colliders[c];
    SolverBody& body = solver_bodies_[c];
    body.now = now_.data() + first_slots_[c];
    body.before = before_.data() + first_slots_[c];
    body.particles = needed_[c] ? collider.particles : 0;
    body.moves = collider.moves;
    body.edge_length = collider.moves ? collider.edge_length : std::numeric_limits<double>::infinity();
    body.held = collider.held;
    body.rigid_share = 0.0;
    body.whole = WholeMotion();
    for (Index i = 0; i < body.particles; ++i) {
      const Vec3& p = collider.positions[i];
      body.now[i] = {p.x(), p.y(), p.z(), collider.moves ? collider.inverse_masses[i] : 0.0};
      before_[first_slots_[c] + i] = body.now[i];
    }
  }
}

std::vector<std::uint64_t> SurfaceContacts::loadedBy(std::uint64_t key) const {
  std::vector<std::uint64_t> loaded;
  for (const auto& [name, pair] : known_)
    if ((pair->key_a == key || pair->key_b == key) &&
        std::any_of(pair->set.rows.begin(), pair->set.rows.end(),
                    [](const ContactRow& row) { return !row.impulse.isZero(0.0); }))
      loaded.push_back(pair->key_a == key ? pair->key_b : pair->key_a);
  return loaded;
}

void SurfaceContacts::lead(Index collider, const Points& before, const Points& now) {
  const SolverBody& body = solver_bodies_[collider];
  for (Index i = 0; i < body.particles; ++i) {
    body.before[i].put(before[i]);
    body.now[i].put(now[i]);
  }
}

void SurfaceContacts::setRigidShare(Index collider, double share) { solver_bodies_[collider].rigid_share = share; }

void SurfaceContacts::solveIsland(Index island_number, SolverStep step, int number,
                                  const std::vector<Collider>& colliders, const std::vector<Vec3*>& previous,
                                  std::vector<SpringRow>& springs, std::vector<FibreRow>& fibres,
                                  SolverScratch& scratch, SolverCounters& counters, const ForEach& for_each) {
  Island& island = islands_[island_number];
  if (island.rows.empty() && springs.empty() && fibres.empty()) return;
  step.warm = number == 0 ? step.h * step.h : 1.0;
  step.number = number;
  // Of all bodies, or of the only one in chunks.
  const auto eachParticle = [&](const auto& visit) {
    if (island.bodies.size() > 1) {
      runEach(for_each, island.bodies.size(),
              [&](std::size_t n) { visit(n, 0, solver_bodies_[island.bodies[n]].particles); });
      return;
    }
    const Index all = solver_bodies_[island.bodies[0]].particles;
    runEach(for_each, (all + kChunk - 1) / kChunk, [&](std::size_t chunk) {
      const Index from = static_cast<Index>(chunk) * kChunk;
      visit(0, from, std::min(all, from + kChunk));
    });
  };
  eachParticle([&](std::size_t n, Index from, Index to) {
    const SolverBody& body = solver_bodies_[island.bodies[n]];
    const Vec3* const positions = colliders[island.bodies[n]].positions;
    for (Index i = from; i < to; ++i) {
      body.now[i].put(positions[i]);
      body.before[i].put(previous[n][i]);
    }
  });
  static const std::vector<Index> kNone;
  solveRows(island.rows, springs, fibres, solver_bodies_, step, springs.empty() && !island.held ? island.bodies : kNone,
            scratch, counters);
  eachParticle([&](std::size_t n, Index from, Index to) {
    const SolverBody& body = solver_bodies_[island.bodies[n]];
    Vec3* const positions = colliders[island.bodies[n]].positions;
    for (Index i = from; i < to; ++i) {
      positions[i] = body.now[i].place();
      previous[n][i] = body.before[i].place();
    }
  });
}

Vec3 SurfaceContacts::sphereImpulse(Index island) const {
  Vec3 sum = Vec3::Zero();
  for (const SolverRows& rows : islands_[island].rows)
    for (const ContactRow& row : rows.set->rows)
      if (row.kind == FeaturePair::Kind::kSphere) sum += row.impulse;
  return sum;
}

void SurfaceContacts::pushedBySphere(std::vector<char>& pushed) const {
  pushed.assign(needed_.size(), 0);
  for (const Pair* pair : pairs_)
    if (pair->kind == Kind::kSphere)
      for (const ContactRow& row : pair->set.rows) pushed[pair->a] = pushed[pair->a] || !row.impulse.isZero(0.0);
}

void SurfaceContacts::finishIsland(Index island, double h) {
  for (const SolverRows& rows : islands_[island].rows)
    for (ContactRow& row : rows.set->rows) row.impulse /= h * h;
}

void SurfaceContacts::loadedSurfaces(std::vector<std::pair<Index, Index>>& pairs) const {
  pairs.clear();
  for (const Pair* pair : pairs_) {
    if (pair->kind == Kind::kSphere) continue;
    if (std::any_of(pair->set.rows.begin(), pair->set.rows.end(),
                    [](const ContactRow& row) { return !row.impulse.isZero(0.0); }))
      pairs.push_back(std::minmax(pair->a, pair->b));
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
}

void SurfaceContacts::points(const std::vector<Collider>& colliders, std::vector<Point>& points) const {
  points.clear();
  for (const Pair* pair : pairs_) {
    const bool second = pair->b != kNoIndex && colliders[pair->a].obstacle;
    const double side = second ? -1.0 : 1.0;
    for (const ContactRow& row : pair->set.rows) {
      if (!(row.normal.dot(row.impulse) > 0.0)) continue;
      Vec3 at = Vec3::Zero();
      double share = 0.0;
      for (Index k = row.begin; k < row.middle; ++k) {
        at += pair->set.entries[k].coefficient * colliders[pair->a].positions[pair->set.entries[k].particle];
        share += pair->set.entries[k].coefficient;
      }
      if (!(share > 0.5)) continue;
      points.push_back({second ? pair->b : pair->a, second ? pair->a : pair->b, pair->kind == Kind::kSphere, at,
                        side * row.normal, side * row.impulse});
    }
  }
}

SurfaceMemory SurfaceContacts::memory() const {
  SurfaceMemory memory;
  for (const auto& [name, pair] : known_) memory.pairs.push_back(*pair);
  for (const auto& [key, way] : ways_) memory.ways.push_back(way);
  return memory;
}

void SurfaceContacts::recall(const SurfaceMemory& memory) {
  clear();
  for (const KeptPair& kept : memory.pairs) {
    auto pair = std::make_unique<Pair>();
    static_cast<KeptPair&>(*pair) = kept;
    known_[{kept.key_a, kept.key_b, kept.kind}] = std::move(pair);
  }
  for (const KeptWay& way : memory.ways) ways_[way.key] = way;
}

void SurfaceContacts::clear() {
  pairs_.clear();
  known_.clear();
  ways_.clear();
  islands_.clear();
  numbers_.clear();
  needed_.clear();
  moved_.clear();
  std::fill(frame_of_.begin(), frame_of_.end(), 0);
}

void SurfaceContacts::forget(std::uint64_t key) {
  islands_.clear();
  pairs_.clear();
  ways_.erase(key);
  for (auto at = known_.begin(); at != known_.end();)
    at = at->second->key_a == key || at->second->key_b == key ? known_.erase(at) : std::next(at);
}

std::size_t SurfaceContacts::bytes() const {
  constexpr std::size_t kNode = 48;  // of a map, with what the allocator keeps of it
  std::size_t sum = broad_phase_.bytes() + bytesOf(boxes_, active_, needed_, moved_, numbers_, gone_, ahead_, pairs_) +
                    bytesOf(frames_, frame_of_, reached_, now_, before_, first_slots_, solver_bodies_) +
                    bytesOf(islands_, island_of_) + joined_.bytes();
  for (const SurfaceFrame& frame : frames_) sum += frame.bytes();
  for (const auto& [name, pair] : known_)
    sum += kNode + sizeof name + sizeof(Pair) +
           bytesOf(pair->set.rows, pair->set.entries, pair->sides, pair->fine.entries, pair->fine.offsets);
  for (const auto& [key, way] : ways_) sum += kNode + sizeof way + bytesOf(way.last);
  for (const Points& velocities : velocities_) sum += bytesOf(velocities);
  for (const Island& island : islands_) sum += bytesOf(island.bodies, island.rows);
  return sum;
}

}  // namespace meshless
