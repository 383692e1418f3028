#include "meshless_surgery/contact/motion_limit.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "meshless_surgery/contact/contact_rows.h"
#include "meshless_surgery/contact/rigid_groups.h"

namespace meshless {
namespace {

constexpr int kPasses = 3;       // of so many rounds of impulses, before particles are held where they were
constexpr int kMostPasses = 30;  // before all are

}  // namespace

void WatchedSet::start() {
  gone = 0.0;
  until.assign(features.size(), 0.0);
}

double motionShare(int of_a, const std::array<Vec3, 4>& start, const std::array<Vec3, 4>& end, PairDistance& met) {
  constexpr int kMostAdvances = 40;
  met = distanceOfPair(of_a, start);
  const double least = kLeastLeft * met.distance;
  double share = 0.0;
  for (int n = 0; n < kMostAdvances && met.distance > 0.0; ++n) {
    // A plane across what is between them has one on each side: sliding along it brings them no nearer.
    const Vec3 normal = met.between / met.distance;
    double towards_a = 0.0, towards_b = 0.0;
    for (int k = 0; k < 4; ++k) {
      const double along = normal.dot(end[k] - start[k]);
      if (k < of_a)
        towards_b = std::max(towards_b, -along);
      else
        towards_a = std::max(towards_a, along);
    }
    if (!((1.0 - share) * (towards_a + towards_b) > met.distance - least)) return 1.0;
    if (met.distance - least < 0.1 * least) break;
    share += (met.distance - least) / (towards_a + towards_b);
    std::array<Vec3, 4> now;
    for (int k = 0; k < 4; ++k) now[k] = start[k] + share * (end[k] - start[k]);
    met = distanceOfPair(of_a, now);
  }
  return share;
}

namespace {

class Limit {
 public:
  Limit(const std::vector<WatchedPairs>& pairs, std::vector<LimitedBody>& bodies, const std::vector<Index>& members,
        LimitScratch& scratch, const ForEach& for_each)
      : pairs_(pairs), bodies_(bodies), members_(members), scratch_(scratch), for_each_(for_each) {}

  /// Those that would meet: of all that may by how far bodies have gone, and then of what has been edited.
  std::size_t find() {
    runEach(for_each_, members_.size(), [this](std::size_t n) {
      LimitedBody& body = bodies_[members_[n]];
      again_ ? body.placeEdited() : body.place();
    });
    scratch_.found.resize(std::max(scratch_.found.size(), pairs_.size()));
    runEach(for_each_, pairs_.size(), [this](std::size_t n) { find(n); });
    scratch_.meeting.clear();
    for (std::size_t n = 0; n < pairs_.size(); ++n)
      scratch_.meeting.insert(scratch_.meeting.end(), scratch_.found[n].begin(), scratch_.found[n].end());
    again_ = true;
    for (const Index b : members_) std::fill(bodies_[b].edited.begin(), bodies_[b].edited.end(), 0);
    return scratch_.meeting.size();
  }

  /// What has turned with all is near other planes.
  void checkAll() {
    for (const WatchedPairs& pairs : pairs_) std::fill(pairs.set->until.begin(), pairs.set->until.end(), -1.0);
  }

  // An impulse along what is between them where they meet, that leaves twice of it.
  void part() {
    for (const LimitScratch::Meeting& meeting : scratch_.meeting) {
      const WatchedPairs& pairs = pairs_[meeting.pairs];
      const WatchedFeatures& watched = pairs.set->features[meeting.features];
      std::array<Vec3, 4> start, end;
      place(pairs, watched, start, end);
      PairDistance met;
      if (watched.least < 0.0)
        met = distanceOfPair(watched.of_a, start);
      else if (motionShare(watched.of_a, start, end, met) == 1.0 || !(met.distance > 0.0))
        continue;
      const Vec3 normal = watched.least < 0.0 ? watched.normal : Vec3(met.between / met.distance);
      double gap = 0.0;
      for (std::size_t k = 0; k < 4; ++k) gap += met.shares[k] * normal.dot(end[k]);
      scratch_.held.clear();
      eachSupport(pairs, watched, [&](Index body, Index particle, std::size_t corner, double weight) {
        const double coefficient = met.shares[corner] * weight;
        for (LimitScratch::Held& held : scratch_.held)
          if (held.body == body && held.particle == particle) {
            held.share += coefficient;
            return;
          }
        scratch_.held.push_back({body, particle, coefficient});
      });
      double answer = 0.0, farthest = 0.0;
      for (const LimitScratch::Held& held : scratch_.held) {
        const double way = held.share * bodies_[held.body].inverse_masses[held.particle];
        answer += held.share * way;
        farthest = std::max(farthest, std::abs(way));
      }
      const double impulse = (2.0 * met.distance - gap) / answer;
      if (!canAnswer(answer, farthest) || !(impulse > 0.0)) continue;
      for (const LimitScratch::Held& held : scratch_.held) {
        LimitedBody& body = bodies_[held.body];
        body.positions[held.particle] += held.share * body.inverse_masses[held.particle] * impulse * normal;
        body.edited[held.particle] = 1;
      }
    }
  }

  /// Particles of those that meet stay where they were, or all do. Each pass holds more of them, so that passes end.
  void hold(bool all) {
    for (const Index b : members_)
      if (all) {
        for (Index i = 0; i < bodies_[b].particles; ++i) hold(bodies_[b], i);
      }
    for (const LimitScratch::Meeting& meeting : scratch_.meeting) {
      const WatchedPairs& pairs = pairs_[meeting.pairs];
      eachSupport(pairs, pairs.set->features[meeting.features],
                  [&](Index body, Index particle, std::size_t, double) { hold(bodies_[body], particle); });
    }
  }

 private:
  static void hold(LimitedBody& body, Index particle) {
    body.positions[particle] = body.previous[particle];
    if (!body.from.empty()) body.from[particle] = body.previous[particle];
    body.edited[particle] = 1;
  }

  void find(std::size_t n) {
    const WatchedPairs& pairs = pairs_[n];
    const LimitedBody &a = bodies_[pairs.a], &b = bodies_[pairs.b];
    std::vector<LimitScratch::Meeting>& found = scratch_.found[n];
    found.clear();
    if (again_ && !(a.spread + b.spread > 0.0)) return;
    WatchedSet& set = *pairs.set;
    set.gone += (a.mean_way - b.mean_way).norm() + a.spread + b.spread;  // not what both go alike
    for (std::size_t f = 0; f < set.features.size(); ++f)
      if (set.gone > set.until[f] && wouldMeet(pairs, f)) found.push_back({n, f});
  }

  bool wouldMeet(const WatchedPairs& pairs, std::size_t f) {
    WatchedFeatures& watched = pairs.set->features[f];
    double& until = pairs.set->until[f];
    const Vec3 *const of_a = bodies_[pairs.a].vertices.data(), *const of_b = bodies_[pairs.b].vertices.data();
    const double height = heightOver(watched, of_a, of_b);
    if (height > watched.least) {
      until = pairs.set->gone + height - std::max(0.0, watched.least);
      return false;
    }
    std::array<Vec3, 4> start, end;
    place(pairs, watched, start, end);
    PairDistance met = distanceOfPair(watched.of_a, start);
    // A feature that has come to touch is on the side where it was.
    if (!(met.distance > pairs.touching)) {
      watched.least = -pairs.touching;
      faceEachOther(pairs, watched, met, start);
      const double now = alongNormal(watched, met, end);
      return now < watched.least && now < alongNormal(watched, met, start);
    }
    if (watched.least < 0.0 && watched.normal.dot(met.between) < 0.0) return false;
    watched.normal = met.between / met.distance;
    watched.least = kLeastLeft * met.distance;
    return heightOver(watched, of_a, of_b) <= watched.least && motionShare(watched.of_a, start, end, met) < 1.0;
  }

  /// [m] of the lowest corner of a over the highest of b.
  static double heightOver(const WatchedFeatures& watched, const Vec3* of_a, const Vec3* of_b) {
    const Vec3& n = watched.normal;
    const auto& v = watched.vertices;
    if (watched.of_a == 1)
      return n.dot(of_a[v[0]]) - std::max({n.dot(of_b[v[1]]), n.dot(of_b[v[2]]), n.dot(of_b[v[3]])});
    return std::min(n.dot(of_a[v[0]]), n.dot(of_a[v[1]])) - std::max(n.dot(of_b[v[2]]), n.dot(of_b[v[3]]));
  }

  /// What touches is on one side of the plane of the face, or of both edges: what was between them once may lie along
  /// it where they met elsewhere.
  static void faceEachOther(const WatchedPairs& pairs, WatchedFeatures& watched, const PairDistance& at,
                            const std::array<Vec3, 4>& corners) {
    if (std::find(at.shares.begin(), at.shares.end(), 0.0) != at.shares.end()) return;  // at an end
    const bool of_face = watched.of_a == 1;
    const Vec3 across = of_face ? (corners[2] - corners[1]).cross(corners[3] - corners[1])
                                : (corners[1] - corners[0]).cross(corners[3] - corners[2]);
    const double length = across.norm();
    if (!(length > 0.0)) return;
    const bool same = (of_face && pairs.closed) || across.dot(watched.normal) >= 0.0;
    watched.normal = across / (same ? length : -length);
  }

  static double alongNormal(const WatchedFeatures& watched, const PairDistance& at,
                            const std::array<Vec3, 4>& corners) {
    double sum = 0.0;
    for (std::size_t k = 0; k < 4; ++k) sum += at.shares[k] * watched.normal.dot(corners[k]);
    return sum;
  }

  void place(const WatchedPairs& pairs, const WatchedFeatures& watched, std::array<Vec3, 4>& start,
             std::array<Vec3, 4>& end) const {
    for (std::size_t k = 0; k < 4; ++k) {
      const LimitedBody& body = bodies_[k < watched.of_a ? pairs.a : pairs.b];
      end[k] = body.vertexAt(watched.vertices[k], body.positions);
      start[k] = body.moves ? body.vertexAt(watched.vertices[k], body.previous) : end[k];
    }
  }

  template <class Visit>
  void eachSupport(const WatchedPairs& pairs, const WatchedFeatures& watched, const Visit& visit) const {
    for (std::size_t k = 0; k < 4; ++k) {
      const Index number = k < watched.of_a ? pairs.a : pairs.b;
      const LimitedBody& body = bodies_[number];
      if (!body.moves) continue;
      for (Index n = body.supports->offsets[watched.vertices[k]]; n < body.supports->offsets[watched.vertices[k] + 1];
           ++n)
        visit(number, body.supports->particles[n], k, body.supports->weights[n]);
    }
  }

  const std::vector<WatchedPairs>& pairs_;
  std::vector<LimitedBody>& bodies_;
  const std::vector<Index>& members_;
  LimitScratch& scratch_;
  const ForEach& for_each_;
  bool again_ = false;  // only what has been edited since the last find()
};

/// Mass, momentum and angular momentum times h, about the origin of the first particle, and how hard they are to turn.
struct Momentum {
  double mass = 0.0;
  Vec3 centre = Vec3::Zero(), linear = Vec3::Zero(), angular = Vec3::Zero();
  Mat3 inertia = Mat3::Zero();
};
const Vec3& startOf(const LimitedBody& body, Index i) { return body.from.empty() ? body.previous[i] : body.from[i]; }

Momentum momentumOf(const std::vector<LimitedBody>& bodies, const std::vector<Index>& members) {
  Momentum all;
  const Vec3& origin = startOf(bodies[members.front()], 0);
  Mat3 moment = Mat3::Zero();
  for (const Index b : members)
    for (Index i = 0; i < bodies[b].particles; ++i) {
      const double m = 1.0 / bodies[b].inverse_masses[i];
      const Vec3 arm = startOf(bodies[b], i) - origin, way = m * (bodies[b].positions[i] - startOf(bodies[b], i));
      all.mass += m;
      all.centre += m * arm;
      all.linear += way;
      all.angular += arm.cross(way);
      moment += m * arm * arm.transpose();
    }
  all.centre /= all.mass;
  all.angular -= all.centre.cross(all.linear);
  moment -= all.mass * all.centre * all.centre.transpose();
  all.inertia = moment.trace() * Mat3::Identity() - moment;
  all.centre += origin;
  return all;
}

void moveTogether(std::vector<LimitedBody>& bodies, const std::vector<Index>& members, const Vec3& centre,
                  const Vec3& shift, const Vec3& turn) {
  for (const Index b : members)
    for (Index i = 0; i < bodies[b].particles; ++i)
      bodies[b].positions[i] += shift + turn.cross(startOf(bodies[b], i) - centre);
}

}  // namespace

std::size_t limitMotion(const std::vector<WatchedPairs>& pairs, std::vector<LimitedBody>& bodies,
                        const std::vector<Index>& members, bool free, LimitScratch& scratch, const ForEach& for_each) {
  if (pairs.empty()) return 0;
  Limit limit(pairs, bodies, members, scratch, for_each);
  const std::size_t met = limit.find();
  if (met == 0) return 0;
  // What is held stays behind the motion of all together, or it would take energy from that motion to others.
  Momentum before;
  Vec3 shift = Vec3::Zero(), turn = Vec3::Zero();
  if (free) {
    before = momentumOf(bodies, members);
    shift = before.linear / before.mass;
    turn = inverseInertia(before.inertia) * before.angular;
    moveTogether(bodies, members, before.centre, -shift, -turn);
    for (const Index b : members) bodies[b].place();
    limit.checkAll();
  }
  int pass = 0;
  do {
    if (pass < kPasses)
      for (int n = 0; n < kPasses; ++n) limit.part();
    else
      limit.hold(pass > kMostPasses);
    ++pass;
  } while (limit.find() > 0);
  if (!free) return met;
  const Momentum after = momentumOf(bodies, members);
  moveTogether(bodies, members, before.centre, shift - after.linear / before.mass,
               turn - inverseInertia(before.inertia) * after.angular);
  limit.checkAll();
  return met;
}

}  // namespace meshless
