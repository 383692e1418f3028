#include "meshless_surgery/contact/surface_memory.h"

#include <cmath>

namespace meshless {
namespace {

bool isUnit(const Vec3& v) { return std::abs(v.squaredNorm() - 1.0) < 1e-3; }

std::string faultOf(const KeptPair& pair, const SurfaceMemory::Known& a, const SurfaceMemory::Known& b) {
  if (pair.kind > KeptPair::Kind::kGiven) return "a pair of contact is of no kind that there is";
  const RowSet& set = pair.set;
  const bool with_itself = pair.key_a == pair.key_b;
  for (const ContactRow& row : set.rows) {
    if (row.begin > row.middle || row.middle > row.end || row.end > set.entries.size() ||
        row.kind > FeaturePair::Kind::kSphere)
      return "a contact names particles beyond its list";
    for (Index k = row.begin; k < row.end; ++k)
      if (set.entries[k].particle >= (k < row.middle || with_itself ? a : b).particles ||
          !std::isfinite(set.entries[k].coefficient))
        return "a contact names a particle that is not there";
    if (!isUnit(row.normal) || !row.impulse.allFinite() || !std::isfinite(row.constant) || !std::isfinite(row.rise) ||
        !(row.friction >= 0.0) || !(row.restitution >= 0.0))
      return "a contact is not finite";
  }
  for (const RememberedSide& side : pair.sides)
    if (side.vertex >= a.vertices || !isUnit(side.normal) || !(side.depth >= 0.0))
      return "contact remembers the side of a vertex that is not there";
  return {};
}

}  // namespace

// Of colliders that are gone nothing is read any more.
std::string SurfaceMemory::fault(const std::map<std::uint64_t, Known>& colliders) const {
  for (const KeptPair& pair : pairs) {
    const bool alone = pair.kind == KeptPair::Kind::kGround || pair.kind == KeptPair::Kind::kSphere;
    const auto a = colliders.find(pair.key_a), b = colliders.find(pair.key_b);
    if (a == colliders.end() || (!alone && b == colliders.end())) continue;
    if (const std::string fault = faultOf(pair, a->second, alone ? Known() : b->second); !fault.empty()) return fault;
  }
  return {};
}

}  // namespace meshless
