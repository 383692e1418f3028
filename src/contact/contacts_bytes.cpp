// How much memory contact holds between frames.
#include "contacts_impl.h"
#include "meshless_surgery/base/bytes.h"

namespace meshless {
namespace {

// Nodes of std::map: what is in them and about what the tree needs.
template <class Map>
std::size_t bytesOfMap(const Map& map) {
  return map.size() * (sizeof(typename Map::value_type) + 4 * sizeof(void*));
}

std::size_t bytesOfFindings(const Findings& f) {
  return bytesOf(f.contacts, f.entries, f.depths, f.self_areas, f.ridges, f.surface.vertices) + f.self_grid.bytes() +
         f.surface.finder.bytes();
}

}  // namespace

std::size_t IslandPlan::bytes() const {
  return bytesOf(contacts, contact_offsets, colliders, collider_offsets, shifts, passes, calm) +
         bytesOf(root_, number_, next_, moving_);
}

std::size_t Contacts::bytes() const {
  const Impl& w = *impl_;
  std::size_t sum = sizeof w + w.parts.bytes() + w.broad.bytes() + w.solver.bytes() + w.plan.bytes() +
                    bytesOf(w.boxes, w.active, w.needed, w.pairs, w.grounded, w.finders, w.maps_now, w.bounds_now,
                            w.contacts, w.last, w.entries) +
                    bytesOf(w.depths, w.fast_known, w.reached, w.keys, w.tasks, w.inside, w.fast, w.traced, w.swept,
                            w.seen, w.foreseen, w.ahead, w.taken) +
                    bytesOfMap(w.caught) + bytesOfMap(w.exits);
  for (const MapFinder& finder : w.finders) sum += finder.bytes();
  for (const auto& maps : w.maps_now) sum += bytesOf(maps);
  for (const Findings& task : w.tasks) sum += bytesOfFindings(task);
  for (const Traced& traced : w.traced) sum += bytesOf(traced.caught);
  for (const SweptCollider& s : w.swept) sum += bytesOf(s.samples, s.corners, s.triangles);
  for (const FastFindings& fast : w.fast) sum += bytesOfFindings(fast.found);
  for (const Foreseen& found : w.foreseen)
    for (const Findings& half : found.halves) sum += bytesOfFindings(half);
  return sum;
}

}  // namespace meshless
