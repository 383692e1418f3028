#include "meshless_surgery/contact/contact_memory.h"

#include <algorithm>

namespace meshless {
namespace {

auto placeOf(const ContactMemory::Side& side) { return std::make_tuple(side.a, side.b, side.side.vertex); }

}  // namespace

Vec3 ContactMemory::forceOf(const RowKey& key) const {
  const auto at = std::lower_bound(forces.begin(), forces.end(), key,
                                   [](const Force& force, const RowKey& wanted) { return force.key < wanted; });
  return at != forces.end() && !(key < at->key) ? at->force : Vec3(Vec3::Zero());
}

std::array<std::size_t, 2> ContactMemory::sidesOf(std::uint64_t a, std::uint64_t b) const {
  const auto before = [](const Side& side, const std::pair<std::uint64_t, std::uint64_t>& of) {
    return std::tie(side.a, side.b) < std::tie(of.first, of.second);
  };
  const auto after = [](const std::pair<std::uint64_t, std::uint64_t>& of, const Side& side) {
    return std::tie(of.first, of.second) < std::tie(side.a, side.b);
  };
  const std::pair<std::uint64_t, std::uint64_t> of{a, b};
  return {static_cast<std::size_t>(std::lower_bound(sides.begin(), sides.end(), of, before) - sides.begin()),
          static_cast<std::size_t>(std::upper_bound(sides.begin(), sides.end(), of, after) - sides.begin())};
}

void ContactMemory::sort() {
  std::sort(forces.begin(), forces.end(), [](const Force& x, const Force& y) { return x.key < y.key; });
  std::sort(sides.begin(), sides.end(), [](const Side& x, const Side& y) { return placeOf(x) < placeOf(y); });
}

void ContactMemory::filter(const std::function<bool(std::uint64_t, std::uint64_t)>& keep) {
  forces.erase(std::remove_if(forces.begin(), forces.end(), [&](const Force& f) { return !keep(f.key.a, f.key.b); }),
               forces.end());
  sides.erase(std::remove_if(sides.begin(), sides.end(), [&](const Side& s) { return !keep(s.a, s.b); }), sides.end());
}

std::string ContactMemory::fault() const {
  for (const Force& f : forces)
    if (!f.force.allFinite()) return "a contact's force is not finite";
  for (const Side& s : sides)
    if (!s.side.normal.allFinite() || !(s.side.depth >= 0.0)) return "a contact's side is not finite";
  if (!std::is_sorted(forces.begin(), forces.end(), [](const Force& x, const Force& y) { return x.key < y.key; }) ||
      !std::is_sorted(sides.begin(), sides.end(), [](const Side& x, const Side& y) { return placeOf(x) < placeOf(y); }))
    return "contacts are not in their order";
  return "";
}

}  // namespace meshless
