// Outlines that cross, touch or overlap themselves: where the mesh does so, and where rounding made it so.
#include <algorithm>
#include <cmath>
#include <tuple>
#include <unordered_map>

#include "cap_outline.h"
#include "mesh/exact.h"

namespace meshless {
namespace surgery {
namespace {

constexpr double kSnap = 1e-12;  // of the outline's size
constexpr int kMaxRounds = 40;

double cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

/// Nodes by place, so that none is made next to one that is there.
class NodeGrid {
 public:
  NodeGrid(std::vector<Vec2>& nodes, double snap) : nodes_(nodes), snap_(snap) {}

  /// The nearest node within the snapping distance, kNoIndex without one.
  Index find(const Vec2& p) const {
    Index best = kNoIndex;
    double best_distance = snap_ * snap_;
    const auto [i, j] = cellOf(p);
    for (std::int64_t di = -1; di <= 1; ++di) {
      for (std::int64_t dj = -1; dj <= 1; ++dj) {
        const auto cell = cells_.find(keyOf(i + di, j + dj));
        if (cell == cells_.end()) continue;
        for (const Index n : cell->second) {
          const double distance = (nodes_[n] - p).squaredNorm();
          if (distance < best_distance || (distance == best_distance && n < best)) {
            best = n;
            best_distance = distance;
          }
        }
      }
    }
    return best;
  }

  void add(Index node) {
    const auto [i, j] = cellOf(nodes_[node]);
    cells_[keyOf(i, j)].push_back(node);
  }

 private:
  std::pair<std::int64_t, std::int64_t> cellOf(const Vec2& p) const {
    return {static_cast<std::int64_t>(std::floor(p.x() / (2.0 * snap_))),
            static_cast<std::int64_t>(std::floor(p.y() / (2.0 * snap_)))};
  }
  // Cells that share a key only cost a comparison: distances decide.
  static std::uint64_t keyOf(std::int64_t i, std::int64_t j) {
    return static_cast<std::uint64_t>(i) * 0x9e3779b97f4a7c15u ^ static_cast<std::uint64_t>(j);
  }

  std::vector<Vec2>& nodes_;
  double snap_;
  std::unordered_map<std::uint64_t, std::vector<Index>> cells_;
};

Vec2 extentOf(const std::vector<Vec2>& nodes) {
  Vec2 low = nodes.front(), high = nodes.front();
  for (const Vec2& p : nodes) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return high - low;
}

struct Link {
  Index from, to;         // nodes
  std::size_t chain, at;  // it runs from chains[chain][at] to the next
  double low, high;       // its extent along the axis of the sweep
};

/// A node to be put into a link, at the fraction `s` of its length.
struct Insertion {
  double s;
  Index node;
};

class Splitter {
 public:
  Splitter(const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& segments)
      : snap_(snapDistance(nodes)), grid_(result_.nodes, snap_) {
    result_.nodes = nodes;
    const Vec2 extent = extentOf(nodes);
    axis_ = extent.x() >= extent.y() ? 0 : 1;
    mergeNodes();
    for (const OutlineSegment& s : segments) {
      const Index from = result_.merged[s.from], to = result_.merged[s.to];
      result_.chains.push_back(from == to ? std::vector<Index>{from} : std::vector<Index>{from, to});
    }
  }

  SplitOutline run() {
    result_.ok = settle();
    halveLinksBetweenMeetings();
    result_.ok = result_.ok && settle();
    return std::move(result_);
  }

 private:
  void mergeNodes() {
    result_.merged.resize(result_.nodes.size());
    for (Index n = 0; n < result_.nodes.size(); ++n) {
      const Index same = grid_.find(result_.nodes[n]);
      result_.merged[n] = same == kNoIndex ? n : same;
      if (same == kNoIndex) grid_.add(n);
    }
  }

  Index nodeAt(const Vec2& p) {
    const Index there = grid_.find(p);
    if (there != kNoIndex) return there;
    const Index made = static_cast<Index>(result_.nodes.size());
    result_.nodes.push_back(p);
    result_.merged.push_back(made);
    grid_.add(made);
    return made;
  }

  bool settle() {
    for (int round = 0; round < kMaxRounds; ++round)
      if (!splitOnce()) return true;
    return false;
  }

  /// Layers of the cap hang together where outlines meet. An edge with both ends at such places would be the same edge
  /// in every layer, with four triangles: a node inside of it gives each layer an edge of its own.
  void halveLinksBetweenMeetings() {
    std::vector<bool> meeting(result_.nodes.size(), false);
    for (const std::vector<Index>& chain : result_.chains)
      for (std::size_t k = 1; k + 1 < chain.size(); ++k) meeting[chain[k]] = true;
    for (std::vector<Index>& chain : result_.chains) {
      for (std::size_t k = 0; k + 1 < chain.size(); ++k) {
        const Index a = chain[k], b = chain[k + 1];
        if (a >= meeting.size() || b >= meeting.size() || !meeting[a] || !meeting[b]) continue;
        // Links that lie on each other find the same node again.
        const Index middle = nodeAt(0.5 * (result_.nodes[a] + result_.nodes[b]));
        if (middle != a && middle != b) chain.insert(chain.begin() + static_cast<std::ptrdiff_t>(k++) + 1, middle);
      }
    }
  }

  double along(Index node) const { return result_.nodes[node][axis_]; }

  /// One sweep over all links. True where something was split.
  bool splitOnce() {
    links_.clear();
    for (std::size_t c = 0; c < result_.chains.size(); ++c) {
      const std::vector<Index>& chain = result_.chains[c];
      for (std::size_t k = 0; k + 1 < chain.size(); ++k) {
        const double a = along(chain[k]), b = along(chain[k + 1]);
        links_.push_back({chain[k], chain[k + 1], c, k, std::min(a, b) - snap_, std::max(a, b) + snap_});
      }
    }
    std::sort(links_.begin(), links_.end(), [](const Link& p, const Link& q) {
      return std::tie(p.low, p.chain, p.at) < std::tie(q.low, q.chain, q.at);
    });
    insertions_.assign(links_.size(), {});
    for (std::size_t i = 0; i < links_.size(); ++i)
      for (std::size_t j = i + 1; j < links_.size() && links_[j].low <= links_[i].high; ++j) meet(i, j);
    return applyInsertions();
  }

  void meet(std::size_t i, std::size_t j) {
    const Link &p = links_[i], &q = links_[j];
    const Vec2 a = result_.nodes[p.from], b = result_.nodes[p.to], c = result_.nodes[q.from], d = result_.nodes[q.to];
    const int other = 1 - axis_;
    if (std::max(a[other], b[other]) + snap_ < std::min(c[other], d[other]) ||
        std::max(c[other], d[other]) + snap_ < std::min(a[other], b[other]))
      return;
    bool touched = false;
    touched |= touch(i, q.from);
    touched |= touch(i, q.to);
    touched |= touch(j, p.from);
    touched |= touch(j, p.to);
    if (touched || p.from == q.from || p.from == q.to || p.to == q.from || p.to == q.to) return;
    if (exact::turn(a, b, c) * exact::turn(a, b, d) >= 0 || exact::turn(c, d, a) * exact::turn(c, d, b) >= 0) return;
    const double height_a = cross(d - c, a - c), height_b = cross(d - c, b - c);
    double s = height_a / (height_a - height_b);
    if (!(s > 0.0 && s < 1.0)) s = 0.5;  // all but parallel: any point of both will do
    const Index node = nodeAt(a + s * (b - a));
    insert(i, node);
    insert(j, node);
  }

  /// Puts a node into a link that it lies on, to the snapping distance.
  bool touch(std::size_t i, Index node) {
    const Link& link = links_[i];
    if (node == link.from || node == link.to) return false;
    const Vec2 a = result_.nodes[link.from], edge = result_.nodes[link.to] - a, arm = result_.nodes[node] - a;
    const double length = edge.norm(), s = edge.dot(arm) / (length * length);
    if (!(s > 0.0 && s < 1.0) || !(std::abs(cross(edge, arm)) <= snap_ * length)) return false;
    insertions_[i].push_back({s, node});
    return true;
  }

  void insert(std::size_t i, Index node) {
    const Link& link = links_[i];
    if (node == link.from || node == link.to) return;
    const Vec2 a = result_.nodes[link.from], edge = result_.nodes[link.to] - a;
    insertions_[i].push_back({edge.dot(result_.nodes[node] - a) / edge.squaredNorm(), node});
  }

  bool applyInsertions() {
    std::vector<std::vector<std::size_t>> links_of_chain(result_.chains.size());
    for (std::size_t i = 0; i < links_.size(); ++i)
      if (!insertions_[i].empty()) links_of_chain[links_[i].chain].push_back(i);
    bool changed = false;
    for (std::size_t c = 0; c < result_.chains.size(); ++c) {
      std::vector<std::size_t>& split = links_of_chain[c];
      if (split.empty()) continue;
      changed = true;
      // From the chain's end, so that places before it stay as they are.
      std::sort(split.begin(), split.end(), [&](std::size_t p, std::size_t q) { return links_[p].at > links_[q].at; });
      std::vector<Index>& chain = result_.chains[c];
      for (const std::size_t i : split) {
        std::vector<Insertion>& list = insertions_[i];
        std::sort(list.begin(), list.end(),
                  [](const Insertion& p, const Insertion& q) { return p.s != q.s ? p.s < q.s : p.node < q.node; });
        std::vector<Index> inner;
        for (const Insertion& insertion : list)
          if (std::find(inner.begin(), inner.end(), insertion.node) == inner.end()) inner.push_back(insertion.node);
        chain.insert(chain.begin() + static_cast<std::ptrdiff_t>(links_[i].at) + 1, inner.begin(), inner.end());
      }
    }
    return changed;
  }

  SplitOutline result_;
  int axis_ = 0;
  double snap_;
  NodeGrid grid_;
  std::vector<Link> links_;
  std::vector<std::vector<Insertion>> insertions_;
};

}  // namespace

double snapDistance(const std::vector<Vec2>& nodes) {
  return nodes.empty() ? 0.0 : std::max(kSnap * extentOf(nodes).norm(), 1e-300);
}

SplitOutline splitOutline(const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& segments) {
  if (nodes.empty()) {
    SplitOutline nothing;
    nothing.ok = true;
    return nothing;
  }
  return Splitter(nodes, segments).run();
}

}  // namespace surgery
}  // namespace meshless
