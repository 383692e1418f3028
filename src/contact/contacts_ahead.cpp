// Queries ahead of a frame, by another thread. What they find is taken over where nothing has changed since.
#include <algorithm>
#include <unordered_map>

#include "contacts_impl.h"

namespace meshless {
namespace {

template <class T>
bool sameValues(const T* a, const T* b, std::size_t count) {
  return a && b ? std::equal(a, a + count, b) : a == b;
}

bool sameMaps(const ShapeCollider& a, const ShapeCollider& b) {
  return a.map_count == b.map_count &&
         std::equal(a.maps, a.maps + a.map_count, b.maps, [](const ContactMap& m, const ContactMap& n) {
           return m.from_rest == n.from_rest && m.to_rest == n.to_rest && m.rest == n.rest && m.centre == n.centre &&
                  m.flipped == n.flipped && !m.quadratic == !n.quadratic;
         });
}

// All that a query reads of a collider. Quadratic maps follow from the positions.
bool isAsItWas(const ShapeCollider& now, const ShapeCollider& then) {
  return now.shape == then.shape && now.particles == then.particles && now.bounds.min == then.bounds.min &&
         now.bounds.max == then.bounds.max && sameValues(now.positions, then.positions, now.particles) &&
         sameValues(now.surface, then.surface, now.shape->surface().vertices.size()) && sameMaps(now, then);
}

}  // namespace

void Contacts::queryAhead(const std::vector<ShapeCollider>& colliders, Index fresh, double h) {
  Impl& w = *impl_;
  w.seen = colliders;
  w.foreseen.clear();
  w.prepareQueries(colliders, h);
  for (const Pair& pair : w.pairs) {
    // All queries of fast pairs would take seconds in a heap. The frame bounds them, and has threads.
    if (pair.a >= fresh || pair.a == pair.b || pair.fast) continue;
    w.foreseen.push_back({pair, {}, {}});
    for (const bool second : {false, true}) {
      const Index of = second ? pair.b : pair.a, in = second ? pair.a : pair.b;
      QueryPart half{0, second, 0, samplesFor(pair, *colliders[of].shape), {}};
      w.queryPart(w.foreseen.back().halves[second], colliders, pair, colliders[in].maps, false, half);
      w.foreseen.back().inside[second] = half.inside;
    }
  }
}

void Contacts::expect(std::vector<std::shared_ptr<const Contacts>> ahead) {
  impl_->taken.clear();
  impl_->ahead = std::move(ahead);
}

// Where anything else is known of a pair, a query could find something else.
bool Contacts::Impl::isUnknown(const std::vector<ShapeCollider>& colliders, const Pair& pair) const {
  for (const auto& [a, b] : {std::make_pair(pair.a, pair.b), std::make_pair(pair.b, pair.a)}) {
    const auto held = caught.lower_bound({colliders[a].key, colliders[b].key, 0});
    if (held != caught.end() && held->first.a == colliders[a].key && held->first.b == colliders[b].key) return false;
  }
  const std::size_t at = firstKnown(last, last_sorted, pair, false);
  return at == last_sorted || last[at].b == kNoIndex || std::min(last[at].a, last[at].b) != pair.a ||
         std::max(last[at].a, last[at].b) != pair.b;
}

void Contacts::Impl::findForeseen(const std::vector<ShapeCollider>& colliders) {
  taken.assign(ahead.empty() ? 0 : pairs.size(), {});
  if (ahead.empty()) return;
  std::unordered_map<std::uint64_t, Index> number_of;
  for (Index p = 0; p < colliders.size(); ++p) number_of[colliders[p].key] = p;
  for (const auto& others : ahead) {
    const Impl& from = *others->impl_;
    std::vector<Index> now(from.seen.size(), kNoIndex);
    for (Index p = 0; p < from.seen.size(); ++p) {
      const auto known = number_of.find(from.seen[p].key);
      if (known != number_of.end() && (needed[known->second] & 1) && isAsItWas(colliders[known->second], from.seen[p]))
        now[p] = known->second;
    }
    for (const Foreseen& found : from.foreseen) {
      const Index a = now[found.pair.a], b = now[found.pair.b];
      if (a == kNoIndex || b == kNoIndex) continue;
      const auto pair = std::lower_bound(pairs.begin(), pairs.end(), std::make_pair(std::min(a, b), std::max(a, b)),
                                         [](const Pair& p, const std::pair<Index, Index>& of) {
                                           return std::tie(p.a, p.b) < std::tie(of.first, of.second);
                                         });
      if (pair == pairs.end() || pair->a != std::min(a, b) || pair->b != std::max(a, b)) continue;
      if (pair->reach == found.pair.reach && !pair->by_vertices && isUnknown(colliders, *pair))
        taken[static_cast<std::size_t>(pair - pairs.begin())] = {&found, a > b};
    }
  }
}

// Takes over all points of that collider, whichever are the part's.
void Contacts::Impl::takeForeseen(Findings& to, QueryPart& part) const {
  const Index pair = part.pair;
  const bool second = part.second;
  const Foreseen& found = *taken[pair].found;
  const bool half = second != taken[pair].swapped;
  const Index entries_before = static_cast<Index>(to.entries.size());
  const Findings& from = found.halves[half];
  to.entries.insert(to.entries.end(), from.entries.begin(), from.entries.end());
  to.depths.insert(to.depths.end(), from.depths.begin(), from.depths.end());
  for (Contact c : from.contacts) {
    c.a = second ? pairs[pair].b : pairs[pair].a;
    c.b = second ? pairs[pair].a : pairs[pair].b;
    if (!c.direct) {
      c.first += entries_before;
      c.split += entries_before;
      c.end += entries_before;
    }
    to.contacts.push_back(c);
  }
  part.inside = found.inside[half];
}

}  // namespace meshless
