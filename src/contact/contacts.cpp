#include "meshless_surgery/contact/contacts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <unordered_map>

#include "contacts_impl.h"

namespace meshless {
namespace {

constexpr std::size_t kTaskColliders = 128;  // of a task that compares them with the ground
constexpr double kLongestStep = 0.5;         // of the smaller body's extent: how far fast bodies go in a substep

constexpr double kMostForSheets = 4.0;  // substeps that a thin body asks for, at most

// Of the largest that moves: smaller bodies ask for no more substeps than one of that size.
constexpr double kCrumb = 0.2;

double extentOf(const ShapeCollider& collider) { return (collider.bounds.max - collider.bounds.min).maxCoeff(); }

double speedOf(const ShapeCollider& collider) { return collider.velocity.norm() + collider.spread; }

/// [m/s] at which two colliders can come nearer, at most.
double approachOf(const ShapeCollider& a, const ShapeCollider& b) {
  Vec3 relative = Vec3::Zero();
  double spread = 0.0;
  if (a.moves) {
    relative += a.velocity;
    spread += a.spread;
  }
  if (b.moves) {
    relative -= b.velocity;
    spread += b.spread;
  }
  return relative.norm() + spread;
}

}  // namespace

Contacts::Contacts() : impl_(std::make_unique<Impl>()) {}
Contacts::~Contacts() = default;
Contacts::Contacts(Contacts&&) noexcept = default;
Contacts& Contacts::operator=(Contacts&&) noexcept = default;

const std::vector<char>& Contacts::needed() const { return impl_->needed; }
int Contacts::neededSubsteps() const { return impl_->needed_substeps; }
int Contacts::affordableSubsteps() const { return impl_->affordable_substeps; }
const std::vector<Index>& Contacts::reached() const { return impl_->reached; }
const std::vector<double>& Contacts::depths() const { return impl_->depths; }

void Contacts::clear() {
  impl_->caught.clear();
  impl_->exits.clear();
  impl_->contacts.clear();
  impl_->last.clear();
  impl_->reached.clear();
  impl_->keys.clear();
  impl_->needed_substeps = impl_->standing_substeps = 1;
  impl_->affordable_substeps = kAnySubsteps;
  impl_->impulse_substep = 0.0;
  impl_->depths.clear();
  impl_->frames = impl_->steady_contacts = 0;  // what follows is as from the start
}

void Contacts::forget(std::uint64_t key) {
  Impl& w = *impl_;
  const auto isOf = [&w, key](const Contact& c) {
    return w.keys[c.a] == key || (c.b != kNoIndex && w.keys[c.b] == key);
  };
  const auto steady_end =
      w.contacts.begin() + static_cast<std::ptrdiff_t>(std::min(w.steady_contacts, w.contacts.size()));
  w.steady_contacts -= static_cast<std::size_t>(std::count_if(w.contacts.begin(), steady_end, isOf));
  w.contacts.erase(std::remove_if(w.contacts.begin(), w.contacts.end(), isOf), w.contacts.end());
  for (auto it = w.caught.begin(); it != w.caught.end();)
    it = it->first.a == key || it->first.b == key ? w.caught.erase(it) : std::next(it);
}

void Contacts::findPairs(const ContactScene& scene, const std::vector<ShapeCollider>& colliders, double h,
                         ContactCounters& counters) {
  Impl& w = *impl_;
  w.scene = scene;
  w.pairs.clear();
  w.grounded.clear();
  w.needed.assign(colliders.size(), 0);
  w.boxes.clear();
  w.active.clear();
  const double falling = scene.gravity.norm() * h * h;
  for (const ShapeCollider& collider : colliders) {
    // Relative kMargin on both sides; what moves reaches as far as it can get.
    const double diagonal = collider.bounds.diagonal();
    w.boxes.push_back(
        grown(collider.bounds, kMargin * diagonal + (collider.moves ? speedOf(collider) * h + falling : 0.0)));
    w.active.push_back(collider.moves);
  }
  if (colliders.size() > 1) {
    const auto& found = w.broad.find(w.boxes, w.active);
    counters.bounds_tested += w.broad.tested();
    for (const auto& pair : found) {
      w.pairs.push_back({pair[0], pair[1], 0.0, false, 0.0, false});
      w.needed[pair[0]] = w.needed[pair[1]] = 1;
    }
    counters.pairs += found.size();
  }
  bool any_self = false;
  for (Index a = 0; a < colliders.size(); ++a)
    if (colliders[a].meets_itself && colliders[a].moves) {
      w.pairs.push_back({a, a, 0.0, false, 0.0, false});
      w.needed[a] |= 1;
      any_self = true;
    }
  if (any_self)
    std::sort(w.pairs.begin(), w.pairs.end(),
              [](const Pair& p, const Pair& q) { return std::tie(p.a, p.b) < std::tie(q.a, q.b); });
  if (scene.ground)
    for (Index a = 0; a < colliders.size(); ++a)
      if (colliders[a].moves && colliders[a].mass > 0.0 && w.boxes[a].min.z() < *scene.ground) {
        w.grounded.push_back(a);
        w.needed[a] |= 2;
      }
}

void Contacts::make(const std::vector<ShapeCollider>& colliders, double h, ContactCounters& counters,
                    const ForEach& for_each) {
  Impl& w = *impl_;
  if (w.reached.empty()) {
    w.last.swap(w.contacts);
    w.last_sorted = std::min(w.steady_contacts, w.last.size());
    // Once a frame. Where a body wakes and all is found anew, `last` is still of the colliders of the frame before.
    w.followColliders(colliders);
  }
  ++w.frames;
  w.contacts.clear();
  w.fast_known.clear();
  w.entries.clear();
  w.depths.clear();
  w.prepareQueries(colliders, h);
  w.findHeaps(colliders, for_each);
  w.releaseShallow(colliders);
  w.findForeseen(colliders);
  // From below upwards where it matters: ground first.
  const double falling = w.scene.gravity.norm() * h * h;
  const std::size_t ground_tasks = (w.grounded.size() + kTaskColliders - 1) / kTaskColliders;
  w.parts.clear();
  for (Index k = 0; k < w.pairs.size(); ++k) w.parts.add(colliders, w.pairs[k], k);
  const std::size_t pair_tasks = w.parts.tasks();
  if (w.tasks.size() < ground_tasks + pair_tasks) w.tasks.resize(ground_tasks + pair_tasks);
  runEach(for_each, ground_tasks + pair_tasks, [&](std::size_t n) {
    Findings& task = w.tasks[n];
    task.clear();
    if (n < ground_tasks) {
      for (std::size_t k = n * kTaskColliders; k < std::min(w.grounded.size(), (n + 1) * kTaskColliders); ++k) {
        const ShapeCollider& collider = colliders[w.grounded[k]];
        w.addGround(task, colliders, w.grounded[k], kMargin * collider.shape->size() + speedOf(collider) * h + falling);
      }
      return;
    }
    w.queryParts(n - ground_tasks, task, w.last, w.last_sorted, [&](QueryPart& part) {
      const Pair& pair = w.pairs[part.pair];
      if (pair.a == pair.b)
        w.querySelf(task, colliders, pair);
      else if (!w.isForeseen(part.pair))
        w.queryPart(task, colliders, pair, colliders[part.second ? pair.a : pair.b].maps, false, part);
      else if (part.first == 0)
        w.takeForeseen(task, part);
    });
  });
  w.inside.assign(2 * w.pairs.size(), Inside());
  for (const QueryPart& part : w.parts) w.inside[2 * part.pair + part.second].add(part.inside);
  double largest = 0.0;
  for (const ShapeCollider& collider : colliders)
    if (collider.moves) largest = std::max(largest, extentOf(collider));
  w.asked = 0.0;
  w.asked_points = w.samples = 0;
  for (std::size_t p = 0; p < colliders.size(); ++p)
    if (w.needed[p] & 1) w.samples += colliders[p].shape->samples().size();
  double fastest = 0.0;  // substeps that fast pairs, sheets, and islands with points that have passed through need
  for (std::size_t n = 0; n < ground_tasks + pair_tasks; ++n) {
    const Findings& task = w.tasks[n];
    counters.queries += task.counters.queries;
    counters.self_points += task.counters.self_points;
    if (n < ground_tasks) {
      w.join(task, 0, task.contacts.size(), 0, task.entries.size());
      w.depths.insert(w.depths.end(), task.depths.begin(), task.depths.end());
      continue;
    }
    std::size_t contacts = 0, entries = 0, depths = 0;  // where a part begins
    for (std::size_t k = w.parts.firstOf(n - ground_tasks); k < w.parts.endOf(n - ground_tasks); ++k) {
      const QueryPart& part = w.parts[k];
      Pair& pair = w.pairs[part.pair];
      const ShapeCollider &a = colliders[pair.a], &b = colliders[pair.b];
      const Inside* const inside = &w.inside[2 * part.pair];
      if (part.first == 0 && !part.second)
        pair.expelled = pair.a != pair.b && w.depenetrateWhole(colliders, pair, inside[0], inside[1], h, counters);
      if (pair.expelled) {
        pair.fast = false;
      } else {
        w.join(task, contacts, part.contacts, entries, part.entries);
        w.depths.insert(w.depths.end(), task.depths.begin() + static_cast<std::ptrdiff_t>(depths),
                        task.depths.begin() + static_cast<std::ptrdiff_t>(part.depths));
        const double step = kLongestStep * std::max(kCrumb * largest, std::min(extentOf(a), extentOf(b)));
        if (pair.fast) {
          fastest = std::max(fastest, pair.way * h / step);
          if (part.first == 0) {
            const double crowding = (part.second ? a : b).shape->crowding();
            w.asked_points += inside[part.second].asked;
            w.asked += static_cast<double>(inside[part.second].asked) * crowding;
          }
        }
        // What lies on a sheet must not fall through it within a substep.
        if (part.contacts > contacts)
          for (const ShapeCollider* collider : {&a, &b})
            if (extentOf(*collider) > kCrumb * largest)
              fastest = std::max(fastest,
                                 std::min(kMostForSheets, std::sqrt(falling / (kFast * collider->shape->thickness()))));
      }
      contacts = part.contacts;
      entries = part.entries;
      depths = part.depths;
    }
  }
  counters.contacts += w.contacts.size();
  w.reached.clear();
  for (const Contact& c : w.contacts) {
    if (c.b == kNoIndex) continue;
    for (Index p : {c.a, c.b})
      if (!colliders[p].moves && colliders[p].mass > 0.0) w.reached.push_back(p);
  }
  std::sort(w.reached.begin(), w.reached.end());
  w.reached.erase(std::unique(w.reached.begin(), w.reached.end()), w.reached.end());
  if (!w.reached.empty()) return;  // they wake, and all is found anew
  w.takeOver();
  const std::size_t lasting = w.contacts.size(), lasting_entries = w.entries.size();
  if (!w.caught.empty()) w.addCaught(colliders);
  w.plan.make(colliders, w.contacts);
  double standing = 1.0;  // substeps that stacks need
  for (Index island = 0; island < w.plan.size(); ++island) {
    double& asks = w.anyCaught(island) ? fastest : standing;
    asks = std::max(asks, stackWork(w.scene, colliders, w.plan, island, h) / kMostPasses);
  }
  w.chooseSubsteps(fastest, standing);
  w.frame = h;
  bool any_fast = false;
  for (const Pair& pair : w.pairs) any_fast = any_fast || pair.fast;
  w.settled = !any_fast && w.caught.empty();
  if (!w.settled) w.solver.depenetrate(w.scene, colliders, w.contacts, w.entries, w.plan, h, for_each, counters);
  // Fast pairs are queried again when they have moved, and caught points in every substep.
  const bool any_caught = w.contacts.size() > lasting;
  w.contacts.resize(lasting);
  w.entries.resize(lasting_entries);
  std::size_t out = 0;
  if (any_fast) {
    std::map<std::pair<Index, Index>, bool> fast;
    for (const Pair& pair : w.pairs)
      if (pair.fast) fast[{pair.a, pair.b}] = true;
    for (const Contact& c : w.contacts)
      if (c.b == kNoIndex || !fast.count({std::min(c.a, c.b), std::max(c.a, c.b)}))
        w.contacts[out++] = c;
      else
        w.fast_known.push_back(c);
    w.contacts.resize(out);
  }
  if (any_fast || any_caught) {
    w.plan.make(colliders, w.contacts);
  }
  w.plan_steady = true;
  w.steady_contacts = w.contacts.size();
  w.steady_entries = w.entries.size();
}

void Contacts::begin(const std::vector<ShapeCollider>& colliders, double substep) {
  impl_->scene.substep = substep;
  // A load moves by its force times the square of the substep.
  const double before = impl_->impulse_substep, scale = before > 0.0 ? (substep / before) * (substep / before) : 1.0;
  if (scale != 1.0)
    for (Contact& c : impl_->contacts) {
      c.impulse *= scale;
      c.slip_impulse *= scale;
    }
  impl_->impulse_substep = substep;
  impl_->choosePasses(colliders, substep);
  impl_->fresh = true;
  impl_->most_queries = impl_->mostQueries();
  impl_->queries = 0.0;
  const double rounds = impl_->most_queries / std::max(1.0, impl_->asked);
  const double substeps = std::round(impl_->frame / substep);
  impl_->query_every = static_cast<int>(std::clamp(std::ceil(substeps / std::max(1.0, rounds)), 1.0, 1e6));
  impl_->substep_number = 0;
}

void Contacts::solve(const std::vector<ShapeCollider>& colliders, double substep, const RefitMaps& refit,
                     ContactCounters& counters, const ForEach& for_each) {
  Impl& w = *impl_;
  w.contacts.resize(w.steady_contacts);
  w.entries.resize(w.steady_entries);
  w.queryFast(colliders, substep, refit, counters, for_each);
  if (!w.caught.empty()) w.addCaught(colliders);
  const bool steady = w.contacts.size() == w.steady_contacts;
  if (!steady || !w.plan_steady) {
    w.plan.make(colliders, w.contacts);
    w.choosePasses(colliders, substep);
  }
  w.plan_steady = steady;
  w.solver.solve(w.scene, colliders, w.contacts, w.entries, w.plan, w.fresh || !steady || !w.was_steady, for_each,
                 counters);
  w.was_steady = steady;
  w.fresh = false;
  ++w.substep_number;
  for (std::size_t k = 0; k < w.pairs.size(); ++k) {
    if (!w.pairs[k].fast) continue;
    FastFindings& fast = w.fast[k];
    for (std::size_t n = 0; n < fast.found.contacts.size(); ++n) {
      fast.found.contacts[n].impulse = w.contacts[fast.first + n].impulse;
      fast.found.contacts[n].slip_impulse = w.contacts[fast.first + n].slip_impulse;
    }
  }
}

bool Contacts::settled() const { return impl_->settled; }
const std::vector<Index>& Contacts::islandOffsets() const { return impl_->plan.collider_offsets; }
const std::vector<Index>& Contacts::islandColliders() const { return impl_->plan.colliders; }

void Contacts::depenetrate(const std::vector<ShapeCollider>& colliders, ContactCounters& counters,
                           const ForEach& for_each) {
  Impl& w = *impl_;
  if (w.settled) w.solver.depenetrate(w.scene, colliders, w.contacts, w.entries, w.plan, w.frame, for_each, counters);
}

void Contacts::depenetrateIslands(Index first_island, Index end_island, std::size_t& corrected) {
  Impl& w = *impl_;
  for (Index island = first_island; island < end_island; ++island)
    w.solver.depenetrateIsland(island, w.contacts, w.frame, corrected);
}

void Contacts::beginIslands(const std::vector<ShapeCollider>& colliders) {
  Impl& w = *impl_;
  w.solver.begin(w.scene, colliders, w.entries, w.plan);
  w.fresh = false;
  w.was_steady = true;
}

void Contacts::solveIslands(Index first_island, Index end_island, bool first, std::size_t& corrected,
                            std::size_t& ground_loaded) {
  Impl& w = *impl_;
  for (Index island = first_island; island < end_island; ++island) {
    w.solver.solveIsland(island, w.contacts, first, corrected);
    for (Index k = w.plan.contact_offsets[island]; k < w.plan.contact_offsets[island + 1]; ++k) {
      const Contact& c = w.contacts[w.plan.contacts[k]];
      if (c.b != kNoIndex) break;  // the ground's come first
      ground_loaded += c.impulse > 0.0;
    }
  }
}

void Contacts::loadedPairs(std::vector<LoadedPair>& pairs) const {
  pairs.clear();
  for (const Contact& c : impl_->contacts) {
    if (!(c.impulse > 0.0)) continue;
    LoadedPair pair{c.a, c.b};
    if (c.b != kNoIndex && c.b < c.a) pair = {c.b, c.a};
    if (pairs.empty() || pairs.back().a != pair.a || pairs.back().b != pair.b) pairs.push_back(pair);
  }
  const auto key = [](const LoadedPair& p) { return std::make_pair(p.a, p.b); };
  std::sort(pairs.begin(), pairs.end(), [&](const LoadedPair& p, const LoadedPair& q) { return key(p) < key(q); });
  pairs.erase(std::unique(pairs.begin(), pairs.end(),
                          [&](const LoadedPair& p, const LoadedPair& q) { return key(p) == key(q); }),
              pairs.end());
}

std::size_t Contacts::groundLoaded() const {
  std::size_t count = 0;
  for (const Contact& c : impl_->contacts) {
    if (c.b != kNoIndex) break;  // the ground's come first
    count += c.impulse > 0.0;
  }
  return count;
}

void Contacts::points(const std::vector<ShapeCollider>& colliders, std::vector<Point>& points) const {
  points.clear();
  for (const Contact& c : impl_->contacts) {
    if (!(c.impulse > 0.0)) continue;
    const ShapeCollider& a = colliders[c.a];
    Vec3 p = Vec3::Zero();
    if (c.direct) {
      p = (1.0 - c.share) * a.positions[c.point[0]] + c.share * a.positions[c.point[1]];
    } else {
      for (Index k = c.first; k < c.split; ++k) p += impl_->entries[k].weight * a.positions[impl_->entries[k].particle];
    }
    points.push_back({p, c.normal, c.impulse});
  }
}

// Makes what finds the nearest map of a point; says which pairs are fast, and how far outside points are contacts.
void Contacts::Impl::prepareQueries(const std::vector<ShapeCollider>& colliders, double h) {
  if (finders.size() < colliders.size()) {
    finders.resize(colliders.size());
    maps_now.resize(colliders.size());
    bounds_now.resize(colliders.size());
  }
  for (Index p = 0; p < colliders.size(); ++p)
    if (needed[p] & 1) finders[p].make(colliders[p].maps, colliders[p].map_count);
  const double falling = scene.gravity.norm() * h * h;
  for (Pair& pair : pairs) {
    const ShapeCollider &a = colliders[pair.a], &b = colliders[pair.b];
    const double most = kFast * std::min(a.shape->thickness(), b.shape->thickness());
    pair.way = approachOf(a, b);
    pair.reach = kMargin * std::min(a.shape->size(), b.shape->size()) + std::min(pair.way * h + falling, most);
    pair.fast = pair.a != pair.b && pair.way * h > most;
  }
}

// Bodies that have come or gone change the numbers of the others. What the last frame found of those still holds.
void Contacts::Impl::followColliders(const std::vector<ShapeCollider>& colliders) {
  bool same = keys.size() == colliders.size();
  for (Index p = 0; same && p < colliders.size(); ++p) same = keys[p] == colliders[p].key;
  if (same) return;
  std::unordered_map<std::uint64_t, Index> number_of;
  for (Index p = 0; p < colliders.size(); ++p) number_of[colliders[p].key] = p;
  std::vector<Index> now(keys.size(), kNoIndex);
  for (std::size_t p = 0; p < keys.size(); ++p)
    if (const auto found = number_of.find(keys[p]); found != number_of.end()) now[p] = found->second;
  last.resize(last_sorted);
  last.erase(std::remove_if(last.begin(), last.end(),
                            [&now](Contact& c) {
                              c.a = now[c.a];
                              const bool with_body = c.b != kNoIndex;
                              if (with_body) c.b = now[c.b];
                              return c.a == kNoIndex || (with_body && c.b == kNoIndex);
                            }),
             last.end());
  const auto before = [](const Contact& c, const Contact& d) { return keyOf(c) < keyOf(d); };
  if (!std::is_sorted(last.begin(), last.end(), before)) std::stable_sort(last.begin(), last.end(), before);
  last_sorted = last.size();
  keys.resize(colliders.size());
  for (Index p = 0; p < colliders.size(); ++p) keys[p] = colliders[p].key;
}

// What pressed in the last frame is where the solver starts: both lists are in the same order.
void Contacts::Impl::takeOver() {
  const auto key = keyOf;
  std::size_t old = 0;
  for (Contact& c : contacts) {
    while (old < last_sorted && key(last[old]) < key(c)) ++old;
    if (old >= last_sorted) break;
    if (key(last[old]) != key(c) || !(last[old].impulse > 0.0)) continue;
    c.impulse = last[old].impulse;
    c.slip_impulse = last[old].slip_impulse;
  }
}

}  // namespace meshless
