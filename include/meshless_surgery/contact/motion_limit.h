// The guarantee: nothing crosses in a substep that was apart at its start. Convex features that are apart have a plane
// between them; what would come nearer than a share of its distance along that plane's normal is held back (planar
// displacement truncation, Chen et al. 2025, "Offset geometric contact").
#pragma once

#include <algorithm>
#include <cmath>

#include "meshless_surgery/base/for_each.h"
#include "meshless_surgery/contact/feature_pairs.h"

namespace meshless {

/// How far the corners can go from `start` to `end` [m] together until the pair is nearer than a tenth of its distance
/// at the start, by conservative advancement: 1 where it never is. met: the pair there.
double motionShare(int of_a, const std::array<Vec3, 4>& start, const std::array<Vec3, 4>& end, PairDistance& met);

/// A body whose particles are held back; what it points to has to live as long.
struct LimitedBody {
  const VertexSupports* supports = nullptr;
  const Vec3* offsets = nullptr;   // [m] of vertices from the sum of their supports; null: none
  Vec3* positions = nullptr;       // [m]
  const Vec3* previous = nullptr;  // [m] at the start of the substep
  Points from;                     // [m] the same, from where it gets its speed; empty: that is all the same
  Index particles = 0;
  bool moves = true;
  const double* inverse_masses = nullptr;  // [1/kg] 0: held
  std::vector<Index> watched;              // vertices
  std::vector<char> is_watched;            // one a vertex
  Points vertices;                         // [m] of them now, by their numbers
  Points ways;                             // [m] that each of them has gone since it was placed last
  Vec3 mean_way = Vec3::Zero();            // [m]
  double spread = 0.0;                     // [m] by which a way differs from the mean, at most
  std::vector<char> edited;                // one a particle

  void place() {
    ways.resize(watched.size());
    mean_way.setZero();
    for (std::size_t n = 0; n < watched.size(); ++n) {
      const Index v = watched[n];
      vertices[v] = vertexAt(v, positions);
      ways[n] = vertices[v] - vertexAt(v, previous);
      mean_way += ways[n];
    }
    spread = 0.0;
    if (watched.empty()) return;
    mean_way /= static_cast<double>(watched.size());
    for (const Vec3& way : ways) spread = std::max(spread, (way - mean_way).squaredNorm());
    spread = std::sqrt(spread);
  }
  /// Where a particle was edited.
  void placeEdited() {
    mean_way.setZero();
    spread = 0.0;
    if (std::find(edited.begin(), edited.end(), 1) == edited.end()) return;
    for (const Index v : watched) {
      bool moved = false;
      for (Index k = supports->offsets[v]; k < supports->offsets[v + 1]; ++k)
        moved |= edited[supports->particles[k]] != 0;
      if (!moved) continue;
      const Vec3 before = vertices[v];
      vertices[v] = vertexAt(v, positions);
      spread = std::max(spread, (vertices[v] - before).squaredNorm());
    }
    spread = std::sqrt(spread);
  }
  Vec3 vertexAt(Index v, const Vec3* at) const {
    return offsets ? Vec3(supports->sum(v, at) + offsets[v]) : supports->sum(v, at);
  }
};

/// Features of two bodies, and until when none of them has to be checked.
struct WatchedSet {
  std::vector<WatchedFeatures> features;
  std::vector<double> until;  // [m] one a feature: of `gone`
  double gone = 0.0;          // [m] by which they can have come nearer to each other since they were found

  void start();
  std::size_t bytes() const { return bytesOf(features, until); }
};

/// What is watched between two bodies, a and b by their place in a list.
struct WatchedPairs {
  WatchedSet* set = nullptr;
  Index a = 0, b = 0;
  double touching = 0.0;  // [m] nearer than this nothing tells the sides
  bool closed = false;    // b: its faces know where out is
};

/// Scratch of one thread.
struct LimitScratch {
  struct Meeting {
    std::size_t pairs, features;
  };
  std::vector<std::vector<Meeting>> found;  // one a pair of bodies
  struct Held {
    Index body, particle;
    double share;
  };
  std::vector<Meeting> meeting;
  std::vector<Held> held;
};

/// Moves particles so that no watched pair meets on the way from previous to positions: by impulses between the two,
/// equal and opposite, and where these do not do, by holding particles where they were. members: all of them that move;
/// free: nothing holds them, and what was held back goes to all of them together, so that momentum and angular momentum
/// stay. Returns how many pairs would have met.
std::size_t limitMotion(const std::vector<WatchedPairs>& pairs, std::vector<LimitedBody>& bodies,
                        const std::vector<Index>& members, bool free, LimitScratch& scratch,
                        const ForEach& for_each = oneAfterAnother);

}  // namespace meshless
