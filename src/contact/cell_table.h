// A hash table of grid cells (Teschner et al. 2003): each cell lists numbers. Starting anew is a new time stamp, not a
// sweep over the table.
#pragma once

#include <algorithm>
#include <cmath>

#include "meshless_surgery/base/types.h"

namespace meshless {

using Cell = std::array<std::int32_t, 3>;

/// Inclusive range of cells.
struct CellRange {
  Cell first{}, last{};

  std::int64_t count() const {
    std::int64_t n = 1;
    for (int d = 0; d < 3; ++d) n *= std::int64_t{last[d]} - first[d] + 1;
    return n;
  }
};

class CellTable {
 public:
  /// More cells than this along an axis are never used: a larger edge is taken instead.
  static constexpr double kMaxCells = 1 << 20;

  /// Forgets everything. `region` (not empty) is what will be inserted and asked for; `edge` [m] > 0 of the cells.
  void start(const Box& region, double edge, std::size_t expected) {
    region_ = region;
    edge_ = std::max(edge, (region.max - region.min).maxCoeff() / kMaxCells);
    std::size_t buckets = 64;
    while (buckets < 2 * expected) buckets *= 2;
    if (buckets_.size() < buckets) buckets_.assign(buckets, Bucket{});
    if (++stamp_ == 0) {  // wrapped: an old bucket could look fresh
      buckets_.assign(buckets_.size(), Bucket{});
      stamp_ = 1;
    }
    entries_.clear();
    large_.clear();
  }

  /// Cells that a box covers inside the region. The box must overlap the region.
  CellRange cellsOf(const Box& box) const {
    CellRange range;
    for (int d = 0; d < 3; ++d) {
      range.first[d] = coordinate(std::max(box.min[d], region_.min[d]), d);
      range.last[d] = coordinate(std::min(box.max[d], region_.max[d]), d);
    }
    return range;
  }
  Cell cellOf(const Vec3& p) const { return {coordinate(p[0], 0), coordinate(p[1], 1), coordinate(p[2], 2)}; }

  void insert(const Cell& cell, Index item) {
    Bucket& bucket = buckets_[hash(cell)];
    if (bucket.stamp != stamp_) bucket = {stamp_, kNoIndex};
    entries_.push_back({cell, item, bucket.head});
    bucket.head = static_cast<Index>(entries_.size() - 1);
  }

  /// Into all cells of a box; where these are more than `most` the item is visited whatever the range.
  void insert(const Box& box, Index item, std::int64_t most) {
    const CellRange range = cellsOf(box);
    if (range.count() > most) {
      large_.push_back(item);
      return;
    }
    Cell cell;
    for (cell[0] = range.first[0]; cell[0] <= range.last[0]; ++cell[0])
      for (cell[1] = range.first[1]; cell[1] <= range.last[1]; ++cell[1])
        for (cell[2] = range.first[2]; cell[2] <= range.last[2]; ++cell[2]) insert(cell, item);
  }

  /// Calls visit(item) for every item of every cell in the range, and for the large ones.
  template <class Visit>
  void forEach(const CellRange& range, Visit visit) const {
    Cell cell;
    for (cell[0] = range.first[0]; cell[0] <= range.last[0]; ++cell[0])
      for (cell[1] = range.first[1]; cell[1] <= range.last[1]; ++cell[1])
        for (cell[2] = range.first[2]; cell[2] <= range.last[2]; ++cell[2]) {
          const Bucket& bucket = buckets_[hash(cell)];
          if (bucket.stamp != stamp_) continue;
          for (Index k = bucket.head; k != kNoIndex; k = entries_[k].next)
            if (same(entries_[k].cell, cell)) visit(entries_[k].item);
        }
    for (const Index item : large_) visit(item);
  }

 private:
  struct Bucket {
    std::uint32_t stamp = 0;
    Index head = kNoIndex;
  };
  struct Entry {
    Cell cell;
    Index item;
    Index next;
  };

  // The arrays' own comparison calls memcmp.
  static bool same(const Cell& a, const Cell& b) { return a[0] == b[0] && a[1] == b[1] && a[2] == b[2]; }
  std::int32_t coordinate(double x, int d) const {
    return static_cast<std::int32_t>(std::floor((x - region_.min[d]) / edge_));
  }
  std::size_t hash(const Cell& cell) const {
    // The primes of Teschner et al.
    const std::uint32_t mixed = static_cast<std::uint32_t>(cell[0]) * 73856093u ^
                                static_cast<std::uint32_t>(cell[1]) * 19349663u ^
                                static_cast<std::uint32_t>(cell[2]) * 83492791u;
    return mixed & (buckets_.size() - 1);
  }

  Box region_;
  double edge_ = 1.0;
  std::uint32_t stamp_ = 0;
  std::vector<Bucket> buckets_ = std::vector<Bucket>(64);
  std::vector<Entry> entries_;
  std::vector<Index> large_;  // items in too many cells
};

}  // namespace meshless
