// Continuous collision detection of fast pairs: they are queried again within the frame, and traced between.
#include <algorithm>
#include <cmath>

#include "contacts_impl.h"

namespace meshless {
namespace {

// The bounds of its surface.
Box verticesOf(const ShapeCollider& collider) {
  Box box;
  for (Index v = 0; v < collider.shape->surface().vertices.size(); ++v) {
    const Vec3 now = vertexAt(collider, v);
    if (now.allFinite()) box.extend(now);
  }
  return box;
}

// The bounds of its surface in this substep, swept.
Box sweptVertices(const ShapeCollider& collider) {
  Box box;
  for (Index v = 0; v < collider.shape->surface().vertices.size(); ++v) {
    const Vec3 now = vertexAt(collider, v), before = now - vertexMotion(collider, v);
    if (!now.allFinite() || !before.allFinite()) continue;
    box.extend(now);
    box.extend(before);
  }
  return box;
}

}  // namespace

// Queries fast pairs where they are now, if they may have gone as far as their reach since they were queried.
void Contacts::Impl::queryFast(const std::vector<ShapeCollider>& colliders, double substep, const RefitMaps& refit,
                               ContactCounters& counters, const ForEach& for_each) {
  const double falling = scene.gravity.norm() * substep * substep;
  fast.resize(pairs.size());
  std::vector<Index> moved, far, to_fit;  // pairs, and colliders
  std::vector<char> fitted;
  // Many more points may have come together than at the start of the frame. Then, for its rest, they are only traced.
  const bool enough = queries > most_queries || (caught.size() > many_caught && queries > kMostInHeap);
  query_gap = enough ? static_cast<int>(std::round(frame / substep)) : query_every;
  for (Index k = 0; k < pairs.size(); ++k) {
    const Pair& pair = pairs[k];
    if (!pair.fast) continue;
    const double thickness = std::min(colliders[pair.a].shape->thickness(), colliders[pair.b].shape->thickness());
    // Many short substeps need no query in each of them.
    fast[k].moved += pair.way * substep;
    const bool query = fresh || (!enough && substep_number % query_every == 0 && fast[k].moved >= kFast * thickness);
    const bool is_far = pair.way * substep * query_gap > kFast * thickness;
    if (is_far) far.push_back(k);
    if (query) {
      fast[k].moved = 0.0;
      moved.push_back(k);
    }
    if (!is_far && !query) continue;
    if (fitted.empty()) fitted.assign(colliders.size(), 0);
    for (Index p : {pair.a, pair.b})
      if (!fitted[p]) {
        to_fit.push_back(p);
        fitted[p] = 1;
      }
  }
  runEach(for_each, to_fit.size(), [&](std::size_t n) {
    const Index p = to_fit[n];
    refit(p, maps_now[p]);
    bounds_now[p] = verticesOf(colliders[p]);
    finders[p].make(maps_now[p].data(), static_cast<Index>(maps_now[p].size()));
  });
  std::vector<Box> ways;      // of the colliders that are traced
  std::vector<Index> passes;  // pairs that may pass through each other
  for (const Index k : far) {
    const Pair& pair = pairs[k];
    if (ways.empty()) ways.resize(colliders.size());
    for (Index p : {pair.a, pair.b})
      if (ways[p].empty()) ways[p] = sweptVertices(colliders[p]);
    if (!ways[pair.a].overlaps(ways[pair.b])) continue;
    passes.push_back(k);
  }
  std::vector<std::pair<Index, Index>> to_sweep;  // colliders, and how many of their points
  for (const Index k : passes)
    for (Index p : {pairs[k].a, pairs[k].b}) to_sweep.emplace_back(p, samplesFor(pairs[k], *colliders[p].shape));
  std::sort(to_sweep.begin(), to_sweep.end());
  to_sweep.erase(std::unique(to_sweep.begin(), to_sweep.end()), to_sweep.end());
  if (swept.size() < colliders.size()) swept.resize(colliders.size());
  runEach(for_each, to_sweep.size(),
          [&](std::size_t n) { swept[to_sweep[n].first].make(colliders[to_sweep[n].first], to_sweep[n].second); });
  if (traced.size() < 2 * passes.size()) traced.resize(2 * passes.size());
  runEach(for_each, 2 * passes.size(), [&](std::size_t n) {
    trace(colliders, pairs[passes[n / 2]], n % 2 == 1, fresh ? nullptr : &fast[passes[n / 2]].found.contacts,
          traced[n]);
  });
  for (std::size_t n = 0; n < 2 * passes.size(); ++n) {
    counters.traced += traced[n].paths;
    counters.caught += traced[n].caught.size();
    caught.insert(traced[n].caught.begin(), traced[n].caught.end());
  }
  parts.clear();
  for (const Index k : moved) parts.add(colliders, pairs[k], k);
  if (tasks.size() < parts.tasks()) tasks.resize(parts.tasks());
  runEach(for_each, parts.tasks(), [&](std::size_t n) {
    tasks[n].clear();
    queryParts(n, tasks[n], fast_known, fast_known.size(), [&](QueryPart& part) {
      Pair pair = pairs[part.pair];
      const ContactShape &a = *colliders[pair.a].shape, &b = *colliders[pair.b].shape;
      pair.reach = kMargin * std::min(a.size(), b.size()) +
                   std::min(pair.way * frame + falling, kFast * std::min(a.thickness(), b.thickness()));
      queryPart(tasks[n], colliders, pair, maps_now[part.second ? pair.a : pair.b].data(), true, part);
    });
  });
  for (const Index k : moved) fast[k].found.clear();
  for (std::size_t n = 0; n < parts.tasks(); ++n) {
    counters.queries += tasks[n].counters.queries;
    counters.contacts += tasks[n].contacts.size();
    std::size_t first = 0, first_entry = 0;
    for (std::size_t k = parts.firstOf(n); k < parts.endOf(n); ++k) {
      const Pair& pair = pairs[parts[k].pair];
      queries +=
          static_cast<double>(parts[k].inside.asked) * colliders[parts[k].second ? pair.a : pair.b].shape->crowding();
      Findings& found = fast[parts[k].pair].found;
      append(found.contacts, found.entries, tasks[n], first, parts[k].contacts, first_entry, parts[k].entries);
      first = parts[k].contacts;
      first_entry = parts[k].entries;
    }
  }
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (!pairs[k].fast) continue;
    fast[k].first = contacts.size();
    join(fast[k].found, 0, fast[k].found.contacts.size(), 0, fast[k].found.entries.size());
  }
}

}  // namespace meshless
