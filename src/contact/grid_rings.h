// Searching a grid outwards from a point, ring by ring. Private to contact.
#pragma once

#include <algorithm>
#include <array>
#include <cstdlib>

#include "meshless_surgery/base/types.h"

namespace meshless {

/// counts[0] x counts[1] x counts[2] cells of edge `edge` [m] from `origin` on, z fastest.
struct Grid {
  Vec3 origin = Vec3::Zero();
  double edge = 1.0;
  std::array<int, 3> counts{{1, 1, 1}};

  /// The cell of a point, or the one at the border that is nearest to it.
  std::array<int, 3> cellAt(const Vec3& p) const {
    std::array<int, 3> at;
    for (int d = 0; d < 3; ++d) {
      const double c = (p[d] - origin[d]) / edge;
      at[d] = c > 0.0 ? (c < counts[d] ? static_cast<int>(c) : counts[d] - 1) : 0;
    }
    return at;
  }
  std::size_t number(int x, int y, int z) const {
    return (static_cast<std::size_t>(x) * counts[1] + y) * counts[2] + z;
  }
  /// The last ring around a cell.
  int ringsAround(const std::array<int, 3>& home) const {
    int rings = 0;
    for (int d = 0; d < 3; ++d) rings = std::max({rings, home[d], counts[d] - 1 - home[d]});
    return rings;
  }
};

/// visit(number) for each cell that is `ring` away from home along the axis where it is farthest.
template <class Visit>
void visitRing(const Grid& grid, const std::array<int, 3>& home, int ring, const Visit& visit) {
  std::array<int, 3> first, last;
  for (int d = 0; d < 3; ++d) {
    first[d] = std::max(home[d] - ring, 0);
    last[d] = std::min(home[d] + ring, grid.counts[d] - 1);
  }
  for (int x = first[0]; x <= last[0]; ++x)
    for (int y = first[1]; y <= last[1]; ++y) {
      if (std::abs(x - home[0]) == ring || std::abs(y - home[1]) == ring) {
        for (int z = first[2]; z <= last[2]; ++z) visit(grid.number(x, y, z));
      } else {
        if (home[2] - ring >= 0) visit(grid.number(x, y, home[2] - ring));
        if (home[2] + ring < grid.counts[2]) visit(grid.number(x, y, home[2] + ring));
      }
    }
}

}  // namespace meshless
