// Whether a surface is closed and oriented. Private to this room.
#pragma once

#include "meshless_surgery/base/types.h"

namespace meshless {

inline std::uint64_t scatter(Index vertex) {
  const std::uint64_t x = (vertex + std::uint64_t{1}) * 0x9e3779b97f4a7c15u;
  return x ^ (x >> 32);
}

/// Every directed edge a -> b counts r_a r_b (r_b - r_a) with scattered numbers r, which its opposite takes away again:
/// the sum over a closed and oriented surface is 0. A triangle's three edges together are a product.
inline std::uint64_t edgeBalance(const Triangle& t) {
  const std::uint64_t a = scatter(t[0]), b = scatter(t[1]), c = scatter(t[2]);
  return (b - a) * (c - a) * (c - b);
}

/// Then it has no area, and counts nothing.
inline bool namesAVertexTwice(const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; }

}  // namespace meshless
