// Disjoint sets of indices.
#pragma once

#include <algorithm>
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

  /// Cheap for what mostly is one already.
  void join(const Triangle& t) {
    const Index p = parent_[t[0]], q = parent_[t[1]], r = parent_[t[2]];
    if (p == q && q == r) return;
    if (parent_[p] == p && parent_[q] == q && parent_[r] == r) {
      const Index lowest = std::min({p, q, r});
      parent_[p] = parent_[q] = parent_[r] = parent_[t[0]] = parent_[t[1]] = parent_[t[2]] = lowest;
      return;
    }
    join(t[0], t[1]);
    join(t[0], t[2]);
  }
  /// The root of each.
  const std::vector<Index>& flatten() {
    for (Index& p : parent_) p = parent_[p];  // a parent is never higher, and so has its root
    return parent_;
  }

  std::size_t bytes() const { return parent_.capacity() * sizeof(Index); }

 private:
  std::vector<Index> parent_;
};

}  // namespace meshless
