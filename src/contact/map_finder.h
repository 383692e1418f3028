// The cluster whose centre is nearest to a point: a grid over the centres.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "meshless_surgery/base/bytes.h"
#include "meshless_surgery/contact/contacts.h"

namespace meshless {

class MapFinder {
 public:
  void make(const ContactMap* maps, Index count) {
    maps_ = maps;
    count_ = count;
    if (count <= kFewMaps) return;
    Box box;
    for (Index m = 0; m < count; ++m)
      if (maps[m].centre.allFinite()) box.extend(maps[m].centre);
    if (box.empty()) {
      count_ = std::min<Index>(count, 1);
      return;
    }
    const Vec3 extent = (box.max - box.min).cwiseMax(1e-9 * box.diagonal());
    edge_ = std::max(std::cbrt(extent.prod() / count), extent.maxCoeff() / 256.0);
    if (!(edge_ > 0.0)) edge_ = 1.0;
    origin_ = box.min;
    std::size_t total = 1;
    for (int d = 0; d < 3; ++d) {
      cells_[d] = std::min(256, static_cast<int>(extent[d] / edge_) + 1);
      total *= static_cast<std::size_t>(cells_[d]);
    }
    offsets_.assign(total + 1, 0);
    items_.resize(count);
    for (Index m = 0; m < count; ++m) ++offsets_[cellOf(maps[m].centre) + 1];
    for (std::size_t i = 0; i < total; ++i) offsets_[i + 1] += offsets_[i];
    next_.assign(offsets_.begin(), offsets_.end() - 1);
    for (Index m = 0; m < count; ++m) items_[next_[cellOf(maps[m].centre)]++] = m;
  }

  Index nearest(const Vec3& p) const {
    if (count_ <= 1) return 0;
    Index best = 0;
    double least = std::numeric_limits<double>::infinity();
    const auto look = [&](Index m) {
      const double squared = (maps_[m].centre - p).squaredNorm();
      if (squared < least || (squared == least && m < best)) {
        least = squared;
        best = m;
      }
    };
    if (count_ <= kFewMaps) {
      for (Index m = 0; m < count_; ++m) look(m);
      return best;
    }
    std::array<int, 3> at;
    for (int d = 0; d < 3; ++d) at[d] = clampCell(p[d], d);
    const int most = std::max({cells_[0], cells_[1], cells_[2]});
    for (int ring = 0; ring <= most; ++ring) {
      // What lies beyond the rings looked at is farther than their inner radius.
      if (ring > 0) {
        const double inner = (ring - 1) * edge_;
        if (least < std::numeric_limits<double>::infinity() && inner * inner > least) break;
      }
      for (int x = std::max(0, at[0] - ring); x <= std::min(cells_[0] - 1, at[0] + ring); ++x)
        for (int y = std::max(0, at[1] - ring); y <= std::min(cells_[1] - 1, at[1] + ring); ++y)
          for (int z = std::max(0, at[2] - ring); z <= std::min(cells_[2] - 1, at[2] + ring); ++z) {
            if (std::max({std::abs(x - at[0]), std::abs(y - at[1]), std::abs(z - at[2])}) != ring) continue;
            const std::size_t cell = (static_cast<std::size_t>(x) * cells_[1] + y) * cells_[2] + z;
            for (Index k = offsets_[cell]; k < offsets_[cell + 1]; ++k) look(items_[k]);
          }
    }
    return best;
  }

  std::size_t bytes() const { return bytesOf(offsets_, items_, next_); }

 private:
  static constexpr Index kFewMaps = 8;  // so many are searched one by one

  int clampCell(double v, int d) const {
    const double c = (v - origin_[d]) / edge_;
    return c > 0.0 ? (c < cells_[d] ? static_cast<int>(c) : cells_[d] - 1) : 0;
  }
  std::size_t cellOf(const Vec3& p) const {
    return (static_cast<std::size_t>(clampCell(p.x(), 0)) * cells_[1] + clampCell(p.y(), 1)) * cells_[2] +
           clampCell(p.z(), 2);
  }

  const ContactMap* maps_ = nullptr;
  Index count_ = 0;
  double edge_ = 1.0;
  Vec3 origin_ = Vec3::Zero();
  std::array<int, 3> cells_{{1, 1, 1}};
  std::vector<Index> offsets_, items_, next_;
};

}  // namespace meshless
