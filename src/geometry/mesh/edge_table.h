// What is known of each edge, found at once. Private to geometry.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "meshless_surgery/base/types.h"

namespace meshless {

/// A hash table in one block, for a number of edges that is known beforehand. (std::unordered_map takes memory for
/// each.)
template <class Value>
class EdgeTable {
 public:
  /// Room for `most` edges; best for half as many.
  EdgeTable(std::size_t most, const Value& initial) {
    std::size_t size = 16;
    while (size <= most) size *= 2;
    entries_.assign(size, {kNoIndex, kNoIndex, initial});
  }

  /// The same for both directions; `initial` at first. Stays where it is.
  Value& at(Index a, Index b) {
    Entry& entry = entries_[slotOf(a, b)];
    entry.low = std::min(a, b);
    entry.high = std::max(a, b);
    return entry.value;
  }

  /// `initial` where it was never asked for.
  const Value& of(Index a, Index b) const { return entries_[slotOf(a, b)].value; }

 private:
  struct Entry {
    Index low, high;
    Value value;
  };

  std::size_t slotOf(Index a, Index b) const {
    const Index low = std::min(a, b), high = std::max(a, b);
    const std::uint64_t key = (static_cast<std::uint64_t>(low) << 32) | high;
    std::size_t slot = (key * 0x9e3779b97f4a7c15u >> 24) & (entries_.size() - 1);
    while (entries_[slot].low != kNoIndex && (entries_[slot].low != low || entries_[slot].high != high))
      slot = (slot + 1) & (entries_.size() - 1);
    return slot;
  }

  std::vector<Entry> entries_;
};

}  // namespace meshless
