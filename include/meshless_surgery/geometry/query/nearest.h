// Nearest-neighbour queries among points (nanoflann's k-d tree).
#pragma once

#include <memory>

#include "meshless_surgery/base/types.h"

namespace meshless {

/// Built once over a copy of the points. Ties go to the lower index.
class NearestPoints {
 public:
  explicit NearestPoints(Points points);
  ~NearestPoints();
  NearestPoints(NearestPoints&&) noexcept;
  NearestPoints& operator=(NearestPoints&&) noexcept;

  /// kNoIndex where there are no points.
  Index nearest(const Vec3& p) const;
  /// Up to `count` indices, nearest first.
  std::vector<Index> nearest(const Vec3& p, std::size_t count) const;
  /// The same into `found`, which has room for `count`. Returns how many there are.
  std::size_t nearest(const Vec3& p, std::size_t count, Index* found) const;
  /// All within `radius` [m], ascending by index.
  std::vector<Index> within(const Vec3& p, double radius) const;

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

}  // namespace meshless
