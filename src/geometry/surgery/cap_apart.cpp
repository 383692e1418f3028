#include "cap_apart.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>

namespace meshless {
namespace surgery {
namespace {

struct Curve {
  std::vector<OutlineSegment> segments;
  Vec2 low = Vec2::Constant(std::numeric_limits<double>::infinity()), high = -low;
  double area = 0.0;  // [m^2] positive where it turns to the left
  Index inside_of = kNoIndex;
};

double turn(const Vec2& a, const Vec2& b, const Vec2& c) {
  return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
}

enum class Meeting { kNone, kApart, kJoined };

class Curves {
 public:
  Curves(const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& segments, const Points& rest, double apart)
      : nodes_(nodes), rest_(rest), apart_(apart) {
    std::vector<Index> root(nodes.size());
    std::iota(root.begin(), root.end(), Index{0});
    const auto rootOf = [&root](Index i) {
      while (root[i] != i) i = root[i] = root[root[i]];
      return i;
    };
    for (const OutlineSegment& s : segments) root[rootOf(s.from)] = rootOf(s.to);
    std::map<Index, Index> numbers;
    for (const OutlineSegment& s : segments) {
      const auto [at, is_new] = numbers.emplace(rootOf(s.from), static_cast<Index>(curves.size()));
      if (is_new) curves.emplace_back();
      Curve& curve = curves[at->second];
      curve.segments.push_back(s);
      const Vec2 &a = nodes[s.from], &b = nodes[s.to];
      curve.low = curve.low.cwiseMin(a).cwiseMin(b);
      curve.high = curve.high.cwiseMax(a).cwiseMax(b);
      const Vec2 origin = nodes[curve.segments[0].from];
      curve.area += 0.5 * s.weight * turn(origin, a, b);
    }
  }

  Meeting meet(const Curve& a, const Curve& b) const {
    Meeting meeting = Meeting::kNone;
    if ((a.low.array() > b.high.array()).any() || (b.low.array() > a.high.array()).any()) return meeting;
    for (const OutlineSegment& s : a.segments) {
      const Vec2 &p = nodes_[s.from], &q = nodes_[s.to];
      const Vec2 low = p.cwiseMin(q), high = p.cwiseMax(q);
      if ((low.array() > b.high.array()).any() || (b.low.array() > high.array()).any()) continue;
      for (const OutlineSegment& t : b.segments) {
        const Vec2 &u = nodes_[t.from], &v = nodes_[t.to];
        if (turn(p, q, u) * turn(p, q, v) > 0.0 || turn(u, v, p) * turn(u, v, q) > 0.0) continue;
        const double along = turn(u, v, p) - turn(u, v, q), beside = turn(p, q, u) - turn(p, q, v);
        const Vec3 there = mixed(s, along != 0.0 ? turn(u, v, p) / along : 0.5),
                   here = mixed(t, beside != 0.0 ? turn(p, q, u) / beside : 0.5);
        if (!((here - there).norm() > apart_)) return Meeting::kJoined;
        meeting = Meeting::kApart;
      }
    }
    return meeting;
  }

  /// How often the curve goes around p.
  int windingAround(const Curve& curve, const Vec2& p) const {
    int winding = 0;
    for (const OutlineSegment& s : curve.segments) {
      const Vec2 &a = nodes_[s.from], &b = nodes_[s.to];
      if (a.y() <= p.y() && b.y() > p.y() && turn(a, b, p) > 0.0) winding += s.weight;
      if (a.y() > p.y() && b.y() <= p.y() && turn(a, b, p) < 0.0) winding -= s.weight;
    }
    return winding;
  }

  std::vector<Curve> curves;

 private:
  Vec3 mixed(const OutlineSegment& s, double share) const {
    return rest_[s.from] + share * (rest_[s.to] - rest_[s.from]);
  }

  const std::vector<Vec2>& nodes_;
  const Points& rest_;
  const double apart_;
};

}  // namespace

std::vector<Index> curvesApart(const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& segments,
                               const Points& rest, double apart) {
  Curves all(nodes, segments, rest, apart);
  std::vector<Curve>& curves = all.curves;
  for (Index a = 0; a < curves.size(); ++a)
    for (Index b = a + 1; b < curves.size(); ++b)
      if (all.meet(curves[a], curves[b]) == Meeting::kJoined) return {};
  for (Curve& hole : curves) {
    if (hole.area > 0.0) continue;
    for (Index n = 0; n < curves.size(); ++n) {
      const Curve& around = curves[n];
      if (!(around.area > 0.0)) continue;
      // A thin wall may be pressed through itself: most of the hole is inside.
      std::size_t inside = 0;
      for (const OutlineSegment& s : hole.segments) inside += all.windingAround(around, nodes[s.from]) > 0;
      if (2 * inside <= hole.segments.size()) continue;
      if (hole.inside_of == kNoIndex || around.area < curves[hole.inside_of].area) hole.inside_of = n;
    }
    if (hole.inside_of == kNoIndex) return {};
  }
  Index groups = 0;
  std::vector<Index> group_of_curve(curves.size(), kNoIndex), group_of_node(nodes.size(), kNoIndex);
  for (Index n = 0; n < curves.size(); ++n)
    if (curves[n].area > 0.0) group_of_curve[n] = groups++;
  for (Index n = 0; n < curves.size(); ++n) {
    const Index group = group_of_curve[curves[n].area > 0.0 ? n : curves[n].inside_of];
    for (const OutlineSegment& s : curves[n].segments) group_of_node[s.from] = group_of_node[s.to] = group;
  }
  return group_of_node;
}

}  // namespace surgery
}  // namespace meshless
