// Where the vertices of a piece come from.
#pragma once

#include <array>
#include <vector>

#include "meshless_surgery/base/types.h"

namespace meshless {

/// Where a vertex of a piece comes from: sum of weights[k] * parent vertex parents[k]. A vertex that was there before
/// has one parent of weight 1; one on a cut edge has two; one where two rims cross has four; one inside the cap has
/// none. Unused slots have weight 0 and parent kNoIndex. The same weights interpolate rest position, position and
/// velocity.
struct VertexOrigin {
  std::array<Index, 4> parents{{kNoIndex, kNoIndex, kNoIndex, kNoIndex}};
  std::array<double, 4> weights{{0.0, 0.0, 0.0, 0.0}};

  static VertexOrigin of(Index parent) {
    VertexOrigin origin;
    origin.parents[0] = parent;
    origin.weights[0] = 1.0;
    return origin;
  }
  /// The parent that the vertex is; kNoIndex for one that the blade made.
  Index same() const { return parents[1] == kNoIndex && parents[2] == kNoIndex ? parents[0] : kNoIndex; }
  bool insideCap() const { return parents[0] == kNoIndex; }
};

/// One a vertex. Nearly all vertices of a piece were there before: those take four bytes each.
class VertexOrigins {
 public:
  std::size_t size() const { return entries_.size(); }
  void reserve(std::size_t count) { entries_.reserve(count); }

  VertexOrigin operator[](std::size_t vertex) const {
    const Index entry = entries_[vertex];
    return entry & kMade ? made_[entry & ~kMade] : VertexOrigin::of(entry);
  }
  /// As operator[](vertex).same() and .insideCap().
  Index same(std::size_t vertex) const {
    const Index entry = entries_[vertex];
    return entry & kMade ? made_[entry & ~kMade].same() : entry;
  }
  bool insideCap(std::size_t vertex) const {
    const Index entry = entries_[vertex];
    return (entry & kMade) && made_[entry & ~kMade].insideCap();
  }

  void push_back(const VertexOrigin& origin) {
    entries_.push_back(kMade | static_cast<Index>(made_.size()));
    made_.push_back(origin);
  }
  /// Vertices begin .. end - 1 of the parent, as they are.
  void addKept(Index begin, Index end) {
    for (Index v = begin; v < end; ++v) entries_.push_back(v);
  }
  void append(const VertexOrigins& other) {
    const Index offset = static_cast<Index>(made_.size());
    for (const Index entry : other.entries_) entries_.push_back(entry & kMade ? entry + offset : entry);
    made_.insert(made_.end(), other.made_.begin(), other.made_.end());
  }

 private:
  static constexpr Index kMade = Index{1} << 31;  // a mesh of so many vertices would not fit into memory

  std::vector<Index> entries_;  // the parent vertex, or kMade and a number in made_
  std::vector<VertexOrigin> made_;
};

}  // namespace meshless
