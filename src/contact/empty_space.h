// Where nothing of a closed surface is for a long way: a map of distances, coarse and fast to make. Private to
// contact.
#pragma once

#include <cstddef>
#include <vector>

#include "grid_rings.h"
#include "meshless_surgery/geometry/triangle_mesh.h"

namespace meshless {

/// Cells about a surface of which is known how many others lie between them and the next one that a triangle can reach,
/// if they are joined to the outside by such cells.
class EmptySpace {
 public:
  EmptySpace() = default;
  /// Cells have about `edge` [m]. A surface with open edges has no outside: nothing is known then.
  EmptySpace(const TriangleMesh& surface, double edge);

  bool known() const { return !gaps_.empty(); }
  /// [m] a point is outside and nothing of the surface is nearer than that; 0 where no more is known.
  double around(const Vec3& point) const;
  /// True only for points that are joined to the outside.
  bool isOutside(const Vec3& point) const;
  std::size_t bytes() const { return gaps_.capacity() * sizeof(float); }

 private:
  Grid grid_;
  std::vector<float> gaps_;  // [m] one a cell; negative where it is not outside
};

}  // namespace meshless
