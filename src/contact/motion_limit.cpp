#include "meshless_surgery/contact/motion_limit.h"

#include <algorithm>

#include "meshless_surgery/geometry/nearest_on_triangle.h"

namespace meshless {
namespace {

constexpr double kLeastLeft = 0.1;  // of the distance, after a substep
constexpr int kPasses = 6;          // of impulses, and of holding back

// Ericson 2005, Real-Time Collision Detection, sec. 5.1.9.
Vec3 betweenSegments(const Vec3& p, const Vec3& p_end, const Vec3& q, const Vec3& q_end, double& s, double& t) {
  const Vec3 u = p_end - p, v = q_end - q, w = p - q;
  const double a = u.squaredNorm(), e = v.squaredNorm(), f = v.dot(w);
  s = t = 0.0;
  if (a > 0.0 && e > 0.0) {
    const double b = u.dot(v), c = u.dot(w), det = a * e - b * b;
    s = det > 0.0 ? std::clamp((b * f - c * e) / det, 0.0, 1.0) : 0.0;
    t = (b * s + f) / e;
    if (t < 0.0) {
      t = 0.0;
      s = std::clamp(-c / a, 0.0, 1.0);
    } else if (t > 1.0) {
      t = 1.0;
      s = std::clamp((b - c) / a, 0.0, 1.0);
    }
  } else if (a > 0.0) {
    s = std::clamp(-u.dot(w) / a, 0.0, 1.0);
  } else if (e > 0.0) {
    t = std::clamp(f / e, 0.0, 1.0);
  }
  return w + s * u - t * v;
}

}  // namespace

PairDistance distanceOfPair(const WatchedPair& pair, const std::array<Vec3, 4>& corners) {
  PairDistance nearest;
  if (pair.of_a == 1) {
    const Vec3 weights = nearestWeights(corners[0], corners[1], corners[2], corners[3]);
    nearest.shares = {1.0, -weights[0], -weights[1], -weights[2]};
    nearest.between = corners[0] - weights[0] * corners[1] - weights[1] * corners[2] - weights[2] * corners[3];
  } else {
    double s = 0.0, t = 0.0;
    nearest.between = betweenSegments(corners[0], corners[1], corners[2], corners[3], s, t);
    nearest.shares = {1.0 - s, s, t - 1.0, -t};
  }
  nearest.distance = nearest.between.norm();
  return nearest;
}

double motionShare(const WatchedPair& pair, const std::array<Vec3, 4>& start, const std::array<Vec3, 4>& end,
                   PairDistance& met) {
  constexpr int kMostAdvances = 40;
  met = distanceOfPair(pair, start);
  const double least = kLeastLeft * met.distance;
  double share = 0.0;
  for (int n = 0; n < kMostAdvances && met.distance > 0.0; ++n) {
    // A plane across what is between them has one on each side: sliding along it brings them no nearer.
    const Vec3 normal = met.between / met.distance;
    double towards_a = 0.0, towards_b = 0.0;
    for (int k = 0; k < 4; ++k) {
      const double along = normal.dot(end[k] - start[k]);
      if (k < pair.of_a)
        towards_b = std::max(towards_b, -along);
      else
        towards_a = std::max(towards_a, along);
    }
    if (!((1.0 - share) * (towards_a + towards_b) > met.distance - least)) return 1.0;
    if (met.distance - least < 0.1 * least) break;
    share += (met.distance - least) / (towards_a + towards_b);
    std::array<Vec3, 4> now;
    for (int k = 0; k < 4; ++k) now[k] = start[k] + share * (end[k] - start[k]);
    met = distanceOfPair(pair, now);
  }
  return share;
}

void MotionLimit::clear() {
  points_.clear();
  named_.clear();
  pairs_.clear();
}

void MotionLimit::watch(Index a, Index b, const std::array<Index, 4>& vertices, std::uint8_t of_a) {
  WatchedPair pair;
  pair.of_a = of_a;
  pairs_.push_back(pair);
  for (int k = 0; k < 4; ++k) named_.push_back({k < of_a ? a : b, vertices[static_cast<std::size_t>(k)]});
}

void MotionLimit::begin(const std::vector<LimitedBody>& bodies,
                        const std::function<Vec3(const LimitedPoint&)>& vertex_at, double touching) {
  touching_ = touching;
  points_ = named_;
  std::sort(points_.begin(), points_.end());
  points_.erase(std::unique(points_.begin(), points_.end()), points_.end());
  for (std::size_t n = 0; n < named_.size(); ++n)
    pairs_[n / 4].corners[n % 4] =
        static_cast<Index>(std::lower_bound(points_.begin(), points_.end(), named_[n]) - points_.begin());
  offsets_.assign(points_.size(), Vec3::Zero());
  place(bodies, false, end_);
  for (std::size_t p = 0; p < points_.size(); ++p) offsets_[p] = vertex_at(points_[p]) - end_[p];
  lengths_.resize(points_.size());
}

void MotionLimit::place(const std::vector<LimitedBody>& bodies, bool before, Points& at) const {
  at.resize(points_.size());
  for (std::size_t p = 0; p < points_.size(); ++p) {
    const LimitedBody& body = bodies[points_[p].body];
    at[p] = offsets_[p] + body.supports->sum(points_[p].vertex, before && body.moves ? body.previous : body.positions);
  }
}

double MotionLimit::shareOf(const std::vector<LimitedBody>& bodies, const WatchedPair& pair, PairDistance& met) const {
  std::array<Vec3, 4> start, end;
  for (std::size_t k = 0; k < 4; ++k) {
    const LimitedPoint& point = points_[pair.corners[k]];
    start[k] = start_[pair.corners[k]];
    end[k] = offsets_[pair.corners[k]] + bodies[point.body].supports->sum(point.vertex, bodies[point.body].positions);
  }
  return motionShare(pair, start, end, met);
}

void MotionLimit::findMeeting(const std::vector<LimitedBody>& bodies) {
  place(bodies, false, end_);
  for (std::size_t p = 0; p < points_.size(); ++p) lengths_[p] = (end_[p] - start_[p]).norm();
  meeting_.clear();
  for (Index n = 0; n < pairs_.size(); ++n) {
    WatchedPair& pair = pairs_[n];
    double of_a = 0.0, of_b = 0.0;
    for (int k = 0; k < 4; ++k) {
      double& most = k < pair.of_a ? of_a : of_b;
      most = std::max(most, lengths_[pair.corners[k]]);
    }
    if (of_a + of_b < (1.0 - kLeastLeft) * pair.slack) {
      pair.slack -= of_a + of_b;
      continue;
    }
    std::array<Vec3, 4> start;
    for (std::size_t k = 0; k < 4; ++k) start[k] = start_[pair.corners[k]];
    const double distance = distanceOfPair(pair, start).distance;
    pair.slack = std::max(0.0, distance - of_a - of_b);
    if (!(distance > touching_) || of_a + of_b < (1.0 - kLeastLeft) * distance) continue;
    PairDistance met;
    if (shareOf(bodies, pair, met) < 1.0) meeting_.push_back(n);
  }
}

// An impulse along what is between them where they meet, that leaves twice of it.
void MotionLimit::part(const std::vector<LimitedBody>& bodies, const WatchedPair& pair, const PairDistance& met) {
  if (!(met.distance > 0.0)) return;
  const Vec3 normal = met.between / met.distance;
  held_.clear();
  double gap = 0.0;
  for (std::size_t k = 0; k < 4; ++k) {
    const LimitedPoint& point = points_[pair.corners[k]];
    const LimitedBody& body = bodies[point.body];
    gap += met.shares[k] * normal.dot(offsets_[pair.corners[k]] + body.supports->sum(point.vertex, body.positions));
    if (!body.moves) continue;
    for (Index n = body.supports->offsets[point.vertex]; n < body.supports->offsets[point.vertex + 1]; ++n) {
      const Index particle = body.supports->particles[n];
      const double coefficient = met.shares[k] * body.supports->weights[n];
      const auto known = std::find_if(held_.begin(), held_.end(), [&](const Held& held) {
        return held.body == point.body && held.particle == particle;
      });
      if (known != held_.end())
        known->share += coefficient;
      else
        held_.push_back({point.body, particle, coefficient});
    }
  }
  double answer = 0.0;
  for (const Held& held : held_) answer += held.share * held.share * bodies[held.body].inverse_masses[held.particle];
  const double impulse = (2.0 * met.distance - gap) / answer;
  if (!(answer > 0.0) || !(impulse > 0.0)) return;
  for (const Held& held : held_) {
    const LimitedBody& body = bodies[held.body];
    body.positions[held.particle] += held.share * body.inverse_masses[held.particle] * impulse * normal;
  }
}

std::size_t MotionLimit::holdBack(const std::vector<LimitedBody>& bodies, double& least) {
  findMeeting(bodies);
  held_.clear();
  least = 1.0;
  for (const Index n : meeting_) {
    PairDistance met;
    const double share = shareOf(bodies, pairs_[n], met);
    least = std::min(least, share);
    for (const Index corner : pairs_[n].corners) {
      const LimitedPoint& point = points_[corner];
      const LimitedBody& body = bodies[point.body];
      if (!body.moves) continue;
      for (Index k = body.supports->offsets[point.vertex]; k < body.supports->offsets[point.vertex + 1]; ++k)
        held_.push_back({point.body, body.supports->particles[k], share});
    }
  }
  return meeting_.size();
}

std::size_t MotionLimit::apply(const std::vector<LimitedBody>& bodies, const std::vector<Index>& members) {
  if (pairs_.empty()) return 0;
  place(bodies, true, start_);
  std::size_t met = 0;
  for (int pass = 0; pass < kPasses; ++pass) {
    findMeeting(bodies);
    if (meeting_.empty()) return met;
    if (pass == 0) met = meeting_.size();
    for (const Index n : meeting_) {
      PairDistance where;
      if (shareOf(bodies, pairs_[n], where) < 1.0) part(bodies, pairs_[n], where);
    }
  }
  double least = 1.0;
  for (int pass = 0; pass < kPasses; ++pass) {
    if (holdBack(bodies, least) == 0) return met;
    // The least share of each particle.
    std::sort(held_.begin(), held_.end(), [](const Held& x, const Held& y) {
      return std::tie(x.body, x.particle, x.share) < std::tie(y.body, y.particle, y.share);
    });
    for (std::size_t n = 0; n < held_.size(); ++n) {
      if (n > 0 && held_[n].body == held_[n - 1].body && held_[n].particle == held_[n - 1].particle) continue;
      const LimitedBody& body = bodies[held_[n].body];
      const Vec3& from = body.previous[held_[n].particle];
      Vec3& to = body.positions[held_[n].particle];
      to = from + held_[n].share * (to - from);
    }
  }
  // All on their straight ways, and none farther than the first to meet.
  if (holdBack(bodies, least) == 0) return met;
  for (const Index member : members)
    for (Index i = 0; i < bodies[member].particles; ++i)
      bodies[member].positions[i] =
          bodies[member].previous[i] + least * (bodies[member].positions[i] - bodies[member].previous[i]);
  return met;
}

}  // namespace meshless
