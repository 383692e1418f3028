// The guarantee: nothing crosses in a substep that was apart at its start. Convex features that are apart have a plane
// between them; what would come nearer than a share of its distance along that plane's normal is held back (planar
// displacement truncation, Chen et al. 2025, "Offset geometric contact").
#pragma once

#include <functional>
#include <tuple>

#include "meshless_surgery/contact/contact_surface.h"

namespace meshless {

/// A vertex and a face, or two edges, which are near each other; corners by their place in a list of points.
struct WatchedPair {
  std::array<Index, 4> corners{};  // first those of a
  std::uint8_t of_a = 1;           // 1 or 2
  double slack = 0.0;              // [m] by which they are apart at least; 0: not known
};

struct PairDistance {
  Vec3 between = Vec3::Zero();     // [m] of the nearest points, from b to a
  double distance = 0.0;           // [m]
  std::array<double, 4> shares{};  // of the corners in it: 1 in all for a, -1 for b
};
/// The nearest points of a vertex and a face, or of two edges.
PairDistance distanceOfPair(const WatchedPair& pair, const std::array<Vec3, 4>& corners);

/// How far the corners can go from `start` to `end` [m] together until the pair is nearer than a tenth of its distance
/// at the start, by conservative advancement: 1 where it never is. met: the pair there.
double motionShare(const WatchedPair& pair, const std::array<Vec3, 4>& start, const std::array<Vec3, 4>& end,
                   PairDistance& met);

/// A vertex by its body and its place there.
struct LimitedPoint {
  Index body = 0, vertex = 0;
  bool operator<(const LimitedPoint& o) const { return std::tie(body, vertex) < std::tie(o.body, o.vertex); }
  bool operator==(const LimitedPoint& o) const { return body == o.body && vertex == o.vertex; }
};

/// A body whose particles are held back; what it points to has to live as long.
struct LimitedBody {
  const VertexSupports* supports = nullptr;
  Vec3* positions = nullptr;       // [m]
  const Vec3* previous = nullptr;  // [m] at the start of the substep
  Index particles = 0;
  bool moves = true;
  const double* inverse_masses = nullptr;  // [1/kg] 0: held
};

/// The watched pairs of some bodies over the substeps of a frame.
class MotionLimit {
 public:
  void clear();
  /// Corners of the pair: first of_a of body a.
  void watch(Index a, Index b, const std::array<Index, 4>& vertices, std::uint8_t of_a);
  /// After the last watch(). vertex_at(point): where it is now [m], with the particles at their present places.
  void begin(const std::vector<LimitedBody>& bodies, const std::function<Vec3(const LimitedPoint&)>& vertex_at,
             double touching);
  /// Moves particles so that no watched pair meets on the way from previous to positions: by impulses between the two,
  /// equal and opposite, and where these do not do, by scaling the ways of some particles or of all of the bodies
  /// `members`. Returns how many pairs would have met.
  std::size_t apply(const std::vector<LimitedBody>& bodies, const std::vector<Index>& members);
  std::size_t bytes() const { return bytesOf(points_, named_, offsets_, start_, end_, lengths_, pairs_); }

 private:
  void place(const std::vector<LimitedBody>& bodies, bool before, Points& at) const;
  /// Pairs that would meet, of those that may.
  void findMeeting(const std::vector<LimitedBody>& bodies);
  double shareOf(const std::vector<LimitedBody>& bodies, const WatchedPair& pair, PairDistance& met) const;
  void part(const std::vector<LimitedBody>& bodies, const WatchedPair& pair, const PairDistance& met);
  std::size_t holdBack(const std::vector<LimitedBody>& bodies, double& least);

  std::vector<LimitedPoint> points_, named_;  // each once; four a pair
  Points offsets_;                            // [m] of points from the sum of their supports
  Points start_, end_;
  std::vector<double> lengths_;
  std::vector<WatchedPair> pairs_;
  double touching_ = 0.0;
  struct Held {
    Index body, particle;
    double share;
  };
  std::vector<Held> held_;
  std::vector<Index> meeting_;  // of pairs
};

}  // namespace meshless
