// Generational ids: what leaves a room is an id, never a pointer. A slot that is used again has another generation.
#pragma once

#include <cstdint>
#include <functional>

namespace meshless {

struct BodyId {
  std::uint32_t slot = 0xffffffffu;
  std::uint32_t generation = 0;

  bool operator==(const BodyId& o) const { return slot == o.slot && generation == o.generation; }
  bool operator!=(const BodyId& o) const { return !(*this == o); }
  bool operator<(const BodyId& o) const { return slot != o.slot ? slot < o.slot : generation < o.generation; }
};

/// Never 0 for a live pick, never used twice in a run.
using PickId = std::uint32_t;

}  // namespace meshless
