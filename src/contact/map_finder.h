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
    sorted_.resize(count);
    for (Index n = 0; n < count; ++n) {
      const Index place = next_[cellOf(points_[n])]++;
      items_[place] = n;
      sorted_[place] = points_[n];
    }
  }

  bool empty() const { return points_.empty(); }
  /// limit [m]: where none is so near, one that is hardly farther than the nearest will do.
  Index nearest(const Vec3& p, double limit = std::numeric_limits<double>::infinity()) const {
    if (count_ <= 1) return 0;
    Index best = 0;
    double least = std::numeric_limits<double>::infinity();
    const auto compare = [&](const Vec3& at, Index n) {
      const double squared = (at - p).squaredNorm();
      if (squared < least || (squared == least && n < best)) {
        least = squared;
        best = n;
      }
    };
    if (count_ <= kFew) {
      for (Index n = 0; n < count_; ++n) compare(points_[n], n);
      return best;
    }
    const auto compareIn = [&](std::size_t first, std::size_t last) {
      for (Index k = offsets_[first]; k < offsets_[last + 1]; ++k) compare(sorted_[k], items_[k]);
    };
    // The first ring that holds any, then all cells that can hold a nearer one: along z they lie side by side.
    const std::array<int, 3> home = grid_.cellAt(p);
    for (int ring = 0, rings = grid_.ringsAround(home); ring <= rings && !std::isfinite(least); ++ring)
      visitRing(grid_, home, ring, [&](std::size_t cell) { compareIn(cell, cell); });
    if (!std::isfinite(least)) return best;
    const Vec3 around = Vec3::Constant(std::min(std::sqrt(least), limit) + 1e-9 * grid_.edge);  // not by rounding
    const std::array<int, 3> low = grid_.cellAt(p - around), high = grid_.cellAt(p + around);
    for (int x = low[0]; x <= high[0]; ++x)
      for (int y = low[1]; y <= high[1]; ++y) compareIn(grid_.number(x, y, low[2]), grid_.number(x, y, high[2]));
    return best;
  }

  std::size_t bytes() const { return bytesOf(points_, sorted_, offsets_, items_, next_); }

 private:
  static constexpr Index kFew = 48;  // so many are searched one by one

  std::size_t cellOf(const Vec3& p) const {
    const std::array<int, 3> at = grid_.cellAt(p);
    return grid_.number(at[0], at[1], at[2]);
  }

  Points points_, sorted_;  // as they were added, and by cells
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
