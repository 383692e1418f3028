#include "cap_core.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/geometry/query/union_find.h"

namespace meshless {
namespace surgery {
namespace {

constexpr double kRowHeight = 0.86602540378443865;  // of the spacing
constexpr double kShake = 1e-3;                     // of the spacing: no four points on one circle
constexpr int kWidenings = 40;

/// What happens on a row of the lattice as x grows.
struct Event {
  double x;
  int winding;  // change
  int cover;    // change of the number of segments that are too near
};

/// Neighbouring points of a row.
struct Run {
  int first, last;  // columns
  Index point;      // number of the first
};

/// Where the row at height y is within `radius` of the segment a b. False where it is nowhere.
bool nearOnRow(const Vec2& a, const Vec2& b, double radius, double y, double& low, double& high) {
  low = 1e300;
  high = -1e300;
  const auto add = [&](double x) {
    low = std::min(low, x);
    high = std::max(high, x);
  };
  for (const Vec2& end : {a, b}) {
    const double rise = y - end.y(), squared = radius * radius - rise * rise;
    if (!(squared >= 0.0)) continue;
    const double reach = std::sqrt(squared);
    add(end.x() - reach);
    add(end.x() + reach);
  }
  const Vec2 edge = b - a;
  const double length = edge.norm();
  if (length > 0.0) {
    const Vec2 aside = Vec2(-edge.y(), edge.x()) * (radius / length);
    for (const double sign : {-1.0, 1.0}) {
      const Vec2 from = a + sign * aside;
      const double s = (y - from.y()) / edge.y();
      if (s >= 0.0 && s <= 1.0) add(from.x() + s * edge.x());  // NaN and infinite where it runs along the row
    }
  }
  return low <= high;
}

double shakeOf(std::uint64_t key) {
  key = (key ^ (key >> 30)) * 0xbf58476d1ce4e5b9u;
  key = (key ^ (key >> 27)) * 0x94d049bb133111ebu;
  return kShake * (static_cast<double>(key >> 40) / 8388608.0 - 1.0);
}

class Lattice {
 public:
  Lattice(const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& segments, double spacing)
      : nodes_(nodes), segments_(segments), height_(kRowHeight * spacing) {
    core_.spacing = spacing;
    low_ = nodes[segments[0].from];
    Vec2 high = low_;
    for (const OutlineSegment& s : segments) {
      for (const Index n : {s.from, s.to}) {
        low_ = low_.cwiseMin(nodes[n]);
        high = high.cwiseMax(nodes[n]);
      }
    }
    // Half a row off, so that the lattice sits in the middle of flat sides.
    rows_ = static_cast<int>((high.y() - low_.y()) / height_) + 1;
    low_.y() = 0.5 * (low_.y() + high.y() - (rows_ - 1) * height_);
  }

  /// False where there would be more than `most`.
  bool addPoints(std::size_t most) {
    findEvents();
    runs_.resize(static_cast<std::size_t>(rows_) + 1);
    for (int row = 0; row < rows_; ++row) {
      std::vector<Event>& events = events_[static_cast<std::size_t>(row)];
      std::sort(events.begin(), events.end(), [](const Event& p, const Event& q) { return p.x < q.x; });
      int winding = 0, cover = 0;
      for (std::size_t i = 0; i + 1 < events.size(); ++i) {
        winding += events[i].winding;
        cover += events[i].cover;
        if (winding == 1 && cover == 0) addRun(row, events[i].x, events[i + 1].x);
      }
      if (core_.places.size() > most) return false;
    }
    return true;
  }

  CapCore finish() {
    addTriangles();
    numberParts();
    return std::move(core_);
  }

 private:
  double xOf(int row, double column) const { return low_.x() + (column + (row % 2 ? 0.5 : 0.0)) * core_.spacing; }
  double yOf(int row) const { return low_.y() + row * height_; }

  void findEvents() {
    events_.resize(static_cast<std::size_t>(rows_));
    const double radius = (kRimDistance + 2.0 * kShake) * core_.spacing;
    for (const OutlineSegment& s : segments_) {
      const Vec2 &a = nodes_[s.from], &b = nodes_[s.to];
      const double bottom = std::min(a.y(), b.y()) - radius, top = std::max(a.y(), b.y()) + radius;
      const int first = std::max(0, static_cast<int>(std::ceil((bottom - low_.y()) / height_)));
      for (int row = first; row < rows_ && yOf(row) <= top; ++row) {
        std::vector<Event>& events = events_[static_cast<std::size_t>(row)];
        const double y = yOf(row);
        double from, to;
        if (!nearOnRow(a, b, radius, y, from, to)) continue;
        events.push_back({from, 0, 1});
        events.push_back({to, 0, -1});
        if ((a.y() <= y) == (b.y() <= y)) continue;
        const double x = a.x() + (y - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
        events.push_back({x, a.y() <= y ? -s.weight : s.weight, 0});
      }
    }
  }

  void addRun(int row, double from, double to) {
    std::vector<Run>& runs = runs_[static_cast<std::size_t>(row)];
    int first = static_cast<int>(std::ceil((from - xOf(row, 0.0)) / core_.spacing));
    const int last = static_cast<int>(std::floor((to - xOf(row, 0.0)) / core_.spacing));
    if (!runs.empty()) first = std::max(first, runs.back().last + 1);
    if (last < first) return;
    if (!runs.empty() && runs.back().last + 1 == first) {
      runs.back().last = last;
    } else {
      runs.push_back({first, last, static_cast<Index>(core_.places.size())});
    }
    for (int column = first; column <= last; ++column) {
      const std::uint64_t key = (static_cast<std::uint64_t>(row) << 32 | static_cast<std::uint32_t>(column)) + 1;
      core_.places.emplace_back(xOf(row, column) + core_.spacing * shakeOf(2 * key),
                                yOf(row) + core_.spacing * shakeOf(2 * key + 1));
    }
  }

  void addTriangles() {
    // One bit for each of the six triangles around a point, counter-clockwise from the one at its upper right.
    std::vector<unsigned char> around(core_.places.size(), 0);
    const auto add = [&](Index a, Index b, Index c, int sector) {
      core_.triangles.push_back({a, b, c});
      around[a] |= static_cast<unsigned char>(1 << sector);
      around[b] |= static_cast<unsigned char>(1 << (sector + 2));
      around[c] |= static_cast<unsigned char>(1 << (sector + 4));
      first_sector_.push_back(sector);
    };
    for (int row = 0; row + 1 < rows_; ++row) {
      const std::vector<Run>& above = runs_[static_cast<std::size_t>(row) + 1];
      std::size_t cursor = 0;
      const auto pointAbove = [&](int column) {
        while (cursor < above.size() && above[cursor].last < column) ++cursor;
        if (cursor == above.size() || column < above[cursor].first) return kNoIndex;
        return above[cursor].point + static_cast<Index>(column - above[cursor].first);
      };
      for (const Run& run : runs_[static_cast<std::size_t>(row)]) {
        Index up_left = pointAbove(run.first + row % 2 - 1);
        for (int column = run.first; column <= run.last; ++column) {
          const Index point = run.point + static_cast<Index>(column - run.first);
          const Index up_right = pointAbove(column + row % 2);
          if (up_right != kNoIndex && column < run.last) add(point, point + 1, up_right, 0);
          if (up_right != kNoIndex && up_left != kNoIndex) add(point, up_right, up_left, 1);
          up_left = up_right;
        }
      }
    }
    core_.inside.resize(around.size());
    for (std::size_t p = 0; p < around.size(); ++p) core_.inside[p] = around[p] == 63;
    for (std::size_t t = 0; t < core_.triangles.size(); ++t) {
      for (int k = 0; k < 3; ++k) {
        const Index from = core_.triangles[t][k], to = core_.triangles[t][(k + 1) % 3];
        const int right_of_edge = (first_sector_[t] + 2 * k + 5) % 6;
        if (!(around[from] >> right_of_edge & 1)) core_.border.emplace_back(from, to);
      }
    }
  }

  void numberParts() {
    UnionFind sets(core_.places.size());
    for (const Triangle& t : core_.triangles) sets.join(t);
    const std::vector<Index>& roots = sets.flatten();
    core_.part_of_point.resize(roots.size());
    for (Index p = 0; p < roots.size(); ++p)
      core_.part_of_point[p] = roots[p] == p ? core_.parts++ : core_.part_of_point[roots[p]];
  }

  const std::vector<Vec2>& nodes_;
  const std::vector<OutlineSegment>& segments_;
  double height_;
  Vec2 low_;
  int rows_ = 0;
  std::vector<std::vector<Event>> events_;
  std::vector<std::vector<Run>> runs_;
  std::vector<int> first_sector_;  // one a triangle: where its first corner sees it
  CapCore core_;
};

}  // namespace

CapCore coreOf(const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& segments, double spacing,
               std::size_t most) {
  if (most == 0 || segments.empty() || !(spacing > 0.0)) return {};
  double area = 0.0, length = 0.0;
  const Vec2& origin = nodes[segments[0].from];
  for (const OutlineSegment& s : segments) {
    const Vec2 a = nodes[s.from] - origin, b = nodes[s.to] - origin;
    area += 0.5 * s.weight * (a.x() * b.y() - a.y() * b.x());
    length += (b - a).norm();
  }
  // A row for each segment at the most, however long and thin the section.
  spacing = std::max(spacing, length / (4.0 * static_cast<double>(segments.size()) + 100.0));
  spacing = std::max(spacing, std::sqrt(std::max(area, 0.0) / (kRowHeight * static_cast<double>(most))));
  for (int i = 0; i < kWidenings; ++i, spacing *= 1.05) {
    Lattice lattice(nodes, segments, spacing);
    if (lattice.addPoints(most)) return lattice.finish();
  }
  return {};
}

}  // namespace surgery
}  // namespace meshless
