// Which boxes overlap: a hierarchy of uniform grids, one level for each power of two of the boxes' sizes.
#pragma once

#include "meshless_surgery/base/bytes.h"
#include "meshless_surgery/base/types.h"

namespace meshless {

/// Kept between steps, so that finding allocates nothing once it has grown.
class BroadPhase {
 public:
  /// {lower, higher} index of each pair of overlapping boxes, ascending. Empty boxes (and such with NaN) overlap
  /// nothing; `active`: pairs of two inactive ones are left out. The result is valid until the next call.
  const std::vector<std::array<Index, 2>>& find(const std::vector<Box>& boxes, const std::vector<char>& active);
  /// Boxes compared in the last call.
  std::size_t tested() const { return tested_; }
  std::size_t bytes() const { return bytesOf(entries_, level_of_, table_, table_keys_, pairs_); }  // that it holds

 private:
  struct Entry {
    std::uint64_t key;
    Index box;
  };
  std::vector<Entry> entries_;
  std::vector<int> level_of_;
  std::vector<std::array<Index, 2>> table_;  // first and end of a cell's entries, by hash
  std::vector<std::uint64_t> table_keys_;
  std::vector<std::array<Index, 2>> pairs_;
  std::size_t tested_ = 0;
};

}  // namespace meshless
