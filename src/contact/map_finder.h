// The nearest of some points, or the cluster whose centre is nearest: a grid over them.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "grid_rings.h"
#include "meshless_surgery/base/bytes.h"
#include "meshless_surgery/contact/contacts.h"

namespace meshless {

class PointFinder {
 public:
  void clear() { points_.clear(); }
  void add(const Vec3& p) { points_.push_back(p); }
  /// Of what was added.
  void build() {
    const Index count = count_ = static_cast<Index>(points_.size());
    if (count <= kFew) return;
    Box box;
    for (const Vec3& p : points_)
      if (p.allFinite()) box.extend(p);
    if (box.empty()) {
      count_ = std::min<Index>(count, 1);
      return;
    }
    const Vec3 extent = (box.max - box.min).cwiseMax(1e-9 * box.diagonal());
    grid_.edge = std::max(std::cbrt(extent.prod() / count), extent.maxCoeff() / 256.0);
    if (!(grid_.edge > 0.0)) grid_.edge = 1.0;
    grid_.origin = box.min;
    std::size_t total = 1;
    for (int d = 0; d < 3; ++d) {
      const double cells = extent[d] / grid_.edge;  // NaN where the box is beyond all numbers
      grid_.counts[d] = cells >= 255.0 ? 256 : cells > 0.0 ? static_cast<int>(cells) + 1 : 1;
      total *= static_cast<std::size_t>(grid_.counts[d]);
    }
    offsets_.assign(total + 1, 0);
    items_.resize(count);
    for (const Vec3& p : points_) ++offsets_[cellOf(p) + 1];
    for (std::size_t i = 0; i < total; ++i) offsets_[i + 1] += offsets_[i];
    next_.assign(offsets_.begin(), offsets_.end() - 1);
    for (Index n = 0; n < count; ++n) items_[next_[cellOf(points_[n])]++] = n;
  }

  bool empty() const { return points_.empty(); }
  Index nearest(const Vec3& p) const {
    if (count_ <= 1) return 0;
    Index best = 0;
    double least = std::numeric_limits<double>::infinity();
    const auto look = [&](Index n) {
      const double squared = (points_[n] - p).squaredNorm();
      if (squared < least || (squared == least && n < best)) {
        least = squared;
        best = n;
      }
    };
    if (count_ <= kFew) {
      for (Index n = 0; n < count_; ++n) look(n);
      return best;
    }
    const std::array<int, 3> home = grid_.cellAt(p);
    for (int ring = 0, rings = grid_.ringsAround(home); ring <= rings; ++ring) {
      visitRing(grid_, home, ring, [&](std::size_t cell) {
        for (Index k = offsets_[cell]; k < offsets_[cell + 1]; ++k) look(items_[k]);
      });
      // Not by rounding.
      const double beyond = beyondRing(grid_, home, ring, p) - 1e-9 * grid_.edge;
      if (beyond > 0.0 && least < beyond * beyond) break;
    }
    return best;
  }

  std::size_t bytes() const { return bytesOf(points_, offsets_, items_, next_); }

 private:
  static constexpr Index kFew = 48;  // so many are searched one by one

  std::size_t cellOf(const Vec3& p) const {
    const std::array<int, 3> at = grid_.cellAt(p);
    return grid_.number(at[0], at[1], at[2]);
  }

  Points points_;
  Index count_ = 0;
  Grid grid_;
  std::vector<Index> offsets_, items_, next_;
};

class MapFinder {
 public:
  void make(const ContactMap* maps, Index count) {
    finder_.clear();
    for (Index m = 0; m < count && count > 1; ++m) finder_.add(maps[m].centre);
    finder_.build();
  }
  Index nearest(const Vec3& p) const { return finder_.nearest(p); }
  std::size_t bytes() const { return finder_.bytes(); }

 private:
  PointFinder finder_;
};

}  // namespace meshless
