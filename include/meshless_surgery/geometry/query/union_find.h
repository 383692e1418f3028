// Disjoint sets of indices.
#pragma once

#include <numeric>
#include <vector>

#include "meshless_surgery/base/types.h"

namespace meshless {

class UnionFind {
 public:
  explicit UnionFind(std::size_t n = 0) { reset(n); }
  /// All by themselves again.
  void reset(std::size_t n) {
    parent_.resize(n);
    std::iota(parent_.begin(), parent_.end(), Index{0});
  }
  Index find(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  /// The lower index stays the root, so that the result does not depend on the order.
  void join(Index a, Index b) {
    a = find(a);
    b = find(b);
    if (a < b) parent_[b] = a;
    if (b < a) parent_[a] = b;
  }

  std::size_t bytes() const { return parent_.capacity() * sizeof(Index); }

 private:
  std::vector<Index> parent_;
};

}  // namespace meshless
