// Pairs that move so far in a frame that they are looked at again within it, and followed between.
#include <algorithm>
#include <cmath>

#include "contacts_impl.h"

namespace meshless {
namespace {

// Where its surface is.
Box verticesOf(const ContactParty& party) {
  Box box;
  for (Index v = 0; v < party.shape->surface().vertices.size(); ++v) {
    const Vec3 now = vertexAt(party, v);
    if (now.allFinite()) box.extend(now);
  }
  return box;
}

// Where its surface has been in this substep.
Box sweptVertices(const ContactParty& party) {
  Box box;
  for (Index v = 0; v < party.shape->surface().vertices.size(); ++v) {
    const Vec3 now = vertexAt(party, v), before = now - vertexMotion(party, v);
    if (!now.allFinite() || !before.allFinite()) continue;
    box.extend(now);
    box.extend(before);
  }
  return box;
}

}  // namespace

// Quick pairs where they are now, if they may have gone as far as their reach since they were looked at.
void Contacts::Impl::lookAtQuick(const std::vector<ContactParty>& parties, double substep, const RefitMaps& refit,
                                 ContactCounters& counters, const ForEach& for_each) {
  const double falling = scene.gravity.norm() * substep * substep;
  quick.resize(pairs.size());
  std::vector<Index> moved, far, to_fit;  // pairs, and parties
  std::vector<char> fitted;
  // Who came together within the frame may be many more than when it began: the rest of it they are followed alone.
  const bool enough = looked > most_looked || (caught.size() > many_caught && looked > kMostInHeap);
  look_gap = enough ? static_cast<int>(std::round(frame / substep)) : look_every;
  for (Index k = 0; k < pairs.size(); ++k) {
    const Pair& pair = pairs[k];
    if (!pair.quick) continue;
    const double thickness = std::min(parties[pair.a].shape->thickness(), parties[pair.b].shape->thickness());
    // Many short substeps need no look in each of them.
    quick[k].moved += pair.way * substep;
    const bool look = fresh || (!enough && substep_number % look_every == 0 && quick[k].moved >= kQuick * thickness);
    const bool is_far = pair.way * substep * look_gap > kQuick * thickness;
    if (is_far) far.push_back(k);
    if (look) {
      quick[k].moved = 0.0;
      moved.push_back(k);
    }
    if (!is_far && !look) continue;
    if (fitted.empty()) fitted.assign(parties.size(), 0);
    for (Index p : {pair.a, pair.b})
      if (!fitted[p]) {
        to_fit.push_back(p);
        fitted[p] = 1;
      }
  }
  runEach(for_each, to_fit.size(), [&](std::size_t n) {
    const Index p = to_fit[n];
    refit(p, maps_now[p]);
    bounds_now[p] = verticesOf(parties[p]);
    finders[p].make(maps_now[p].data(), static_cast<Index>(maps_now[p].size()));
  });
  std::vector<Box> ways;      // of those that are traced
  std::vector<Index> passes;  // pairs that may pass through each other
  for (const Index k : far) {
    const Pair& pair = pairs[k];
    if (ways.empty()) ways.resize(parties.size());
    for (Index p : {pair.a, pair.b})
      if (ways[p].empty()) ways[p] = sweptVertices(parties[p]);
    if (!ways[pair.a].overlaps(ways[pair.b])) continue;
    passes.push_back(k);
  }
  std::vector<std::pair<Index, Index>> to_sweep;  // parties, and how many of their points
  for (const Index k : passes)
    for (Index p : {pairs[k].a, pairs[k].b}) to_sweep.emplace_back(p, samplesFor(pairs[k], *parties[p].shape));
  std::sort(to_sweep.begin(), to_sweep.end());
  to_sweep.erase(std::unique(to_sweep.begin(), to_sweep.end()), to_sweep.end());
  if (swept.size() < parties.size()) swept.resize(parties.size());
  runEach(for_each, to_sweep.size(),
          [&](std::size_t n) { swept[to_sweep[n].first].make(parties[to_sweep[n].first], to_sweep[n].second); });
  if (traced.size() < 2 * passes.size()) traced.resize(2 * passes.size());
  runEach(for_each, 2 * passes.size(), [&](std::size_t n) {
    trace(parties, pairs[passes[n / 2]], n % 2 == 1, fresh ? nullptr : &quick[passes[n / 2]].found.contacts, traced[n]);
  });
  for (std::size_t n = 0; n < 2 * passes.size(); ++n) {
    counters.traced += traced[n].paths;
    counters.caught += traced[n].caught.size();
    caught.insert(traced[n].caught.begin(), traced[n].caught.end());
  }
  parts.clear();
  for (const Index k : moved) parts.add(parties, pairs[k], k);
  if (tasks.size() < parts.tasks()) tasks.resize(parts.tasks());
  runEach(for_each, parts.tasks(), [&](std::size_t n) {
    tasks[n].clear();
    lookUp(n, tasks[n], quick_known, quick_known.size(), [&](LookupPart& part) {
      Pair pair = pairs[part.pair];
      const ContactShape &a = *parties[pair.a].shape, &b = *parties[pair.b].shape;
      pair.reach = kMargin * std::min(a.size(), b.size()) +
                   std::min(pair.way * frame + falling, kQuick * std::min(a.thickness(), b.thickness()));
      lookInto(tasks[n], parties, pair, maps_now[part.second ? pair.a : pair.b].data(), true, part);
    });
  });
  for (const Index k : moved) quick[k].found.clear();
  for (std::size_t n = 0; n < parts.tasks(); ++n) {
    counters.lookups += tasks[n].counters.lookups;
    counters.contacts += tasks[n].contacts.size();
    std::size_t first = 0, first_entry = 0;
    for (std::size_t k = parts.firstOf(n); k < parts.endOf(n); ++k) {
      const Pair& pair = pairs[parts[k].pair];
      looked +=
          static_cast<double>(parts[k].inside.asked) * parties[parts[k].second ? pair.a : pair.b].shape->crowding();
      Findings& found = quick[parts[k].pair].found;
      append(found.contacts, found.entries, tasks[n], first, parts[k].contacts, first_entry, parts[k].entries);
      first = parts[k].contacts;
      first_entry = parts[k].entries;
    }
  }
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (!pairs[k].quick) continue;
    quick[k].first = contacts.size();
    join(quick[k].found, 0, quick[k].found.contacts.size(), 0, quick[k].found.entries.size());
  }
}

}  // namespace meshless
