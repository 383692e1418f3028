// Which boxes overlap: a hierarchy of uniform grids, one level for each power of two of the boxes' sizes.
#pragma once

#include "meshless_surgery/base/bytes.h"
#include "meshless_surgery/base/types.h"

namespace meshless {

/// Kept between steps: finding allocates nothing once it has grown, and boxes that stay about where they were are
/// searched for again only when one has left the margin around it. What is found does not depend on it.
class BroadPhase {
 public:
  /// {lower, higher} index of each pair of overlapping boxes, ascending. Empty boxes (and such with NaN) overlap
  /// nothing; `active`: pairs of two inactive ones are left out. The result is valid until the next call.
  const std::vector<std::array<Index, 2>>& find(const std::vector<Box>& boxes, const std::vector<char>& active);
  /// Pairs of boxes compared in the last call.
  std::size_t tested() const { return tested_; }
  /// That it holds.
  std::size_t bytes() const {
    return bytesOf(entries_, level_of_, table_, table_keys_, pairs_, wide_, wide_active_, wide_pairs_);
  }

 private:
  struct Entry {
    std::uint64_t key;
    Index box;
  };
  bool stillWithin(const std::vector<Box>& boxes, const std::vector<char>& active) const;
  void search(const std::vector<Box>& boxes, const std::vector<char>& active, std::vector<std::array<Index, 2>>& pairs);

  std::vector<Entry> entries_;
  std::vector<int> level_of_;
  std::vector<std::array<Index, 2>> table_;  // first and end of a cell's entries, by hash
  std::vector<std::uint64_t> table_keys_;
  std::vector<std::array<Index, 2>> pairs_;
  std::size_t tested_ = 0;

  std::vector<Box> wide_;  // the boxes of the last search, with their margins
  std::vector<char> wide_active_;
  std::vector<std::array<Index, 2>> wide_pairs_;
  static constexpr int kWorthIt = 2;  // calls that margins have to hold
  int held_ = kWorthIt;               // calls since the last search
  int without_ = 0;                   // searches without margins, the last one included, until they are tried again
};

}  // namespace meshless
