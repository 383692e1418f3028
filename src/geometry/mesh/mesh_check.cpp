#include "meshless_surgery/geometry/mesh/mesh_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <sstream>
#include <unordered_map>
#include <utility>

#include "crossings.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace {

constexpr double kWeld = 1e-9;       // of the bounds' diagonal
constexpr double kFlatArea = 1e-14;  // of the squared longest edge: corners on a line
constexpr double kSmallHole = 0.25;  // of the bounds' diagonal
constexpr std::size_t kLongestRim = 200;

std::string count(std::size_t n, const std::string& one, const std::string& many) {
  return std::to_string(n) + " " + (n == 1 ? one : many);
}

std::string written(const Vec3& p) {
  std::ostringstream out;
  out << "(" << p.x() << ", " << p.y() << ", " << p.z() << ")";
  return out.str();
}

bool distinct(const Triangle& t) { return t[0] != t[1] && t[1] != t[2] && t[2] != t[0]; }

bool flat(const Points& points, const Triangle& t) {
  const Vec3 a = points[t[1]] - points[t[0]], b = points[t[2]] - points[t[0]];
  const double longest = std::max({a.squaredNorm(), b.squaredNorm(), (a - b).squaredNorm()});
  return !(a.cross(b).norm() > kFlatArea * longest);
}

Triangle sorted(Triangle t) {
  std::sort(t.begin(), t.end());
  return t;
}

/// One side of a triangle, under its undirected edge.
struct Side {
  Index low, high;
  Index triangle;
  bool forward;  // runs from low to high

  bool sameEdge(const Side& o) const { return low == o.low && high == o.high; }
  bool operator<(const Side& o) const {
    return low != o.low ? low < o.low : high != o.high ? high < o.high : triangle < o.triangle;
  }
};

/// All sides, those of one edge next to each other.
std::vector<Side> sidesOf(const std::vector<Triangle>& triangles) {
  std::vector<Side> sides;
  sides.reserve(3 * triangles.size());
  for (Index f = 0; f < triangles.size(); ++f)
    for (int k = 0; k < 3; ++k) {
      const Index a = triangles[f][k], b = triangles[f][(k + 1) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), f, a < b});
    }
  std::sort(sides.begin(), sides.end());
  return sides;
}

/// Calls edge(first, last) for the sides of each edge.
template <class Edge>
void forEachEdge(const std::vector<Side>& sides, const Edge& edge) {
  for (std::size_t begin = 0; begin < sides.size();) {
    std::size_t end = begin + 1;
    while (end < sides.size() && sides[end].sameEdge(sides[begin])) ++end;
    edge(&sides[begin], &sides[begin] + (end - begin));
    begin = end;
  }
}

/// Components joined by edges, and which triangles to turn so that neighbours agree.
struct Orientation {
  std::vector<Index> component;  // one a triangle, numbered in order of their first triangle
  std::vector<char> turn;        // one a triangle; the first triangle of a component keeps its side
  Index components = 0;
  std::size_t conflicts = 0;  // edges whose two triangles cannot agree
};

Orientation orient(const std::vector<Triangle>& triangles, const std::vector<Side>& sides) {
  struct Neighbour {
    Index triangle;
    bool agrees;
  };
  std::vector<std::vector<Neighbour>> neighbours(triangles.size());
  forEachEdge(sides, [&](const Side* first, const Side* last) {
    if (last - first != 2) {
      // More than two cannot be turned together, but are one piece.
      for (const Side* s = first; s + 1 < last; ++s) {
        neighbours[s[0].triangle].push_back({s[1].triangle, s[0].forward != s[1].forward});
        neighbours[s[1].triangle].push_back({s[0].triangle, s[0].forward != s[1].forward});
      }
      return;
    }
    const bool agrees = first[0].forward != first[1].forward;
    neighbours[first[0].triangle].push_back({first[1].triangle, agrees});
    neighbours[first[1].triangle].push_back({first[0].triangle, agrees});
  });
  Orientation result;
  result.component.assign(triangles.size(), kNoIndex);
  result.turn.assign(triangles.size(), 0);
  std::vector<Index> stack;
  for (Index seed = 0; seed < triangles.size(); ++seed) {
    if (result.component[seed] != kNoIndex) continue;
    result.component[seed] = result.components;
    stack.push_back(seed);
    while (!stack.empty()) {
      const Index f = stack.back();
      stack.pop_back();
      for (const Neighbour& n : neighbours[f]) {
        if (result.component[n.triangle] != kNoIndex) continue;
        result.component[n.triangle] = result.components;
        result.turn[n.triangle] = n.agrees ? result.turn[f] : !result.turn[f];
        stack.push_back(n.triangle);
      }
    }
    ++result.components;
  }
  forEachEdge(sides, [&](const Side* first, const Side* last) {
    if (last - first != 2) return;
    const bool turned_apart = result.turn[first[0].triangle] != result.turn[first[1].triangle];
    if ((first[0].forward != first[1].forward) == turned_apart) ++result.conflicts;
  });
  return result;
}

std::size_t countCrossings(const Points& points, const std::vector<Triangle>& triangles) {
  std::size_t pairs = 0;
  forEachCrossing(points, triangles, [&](Index, Index) { ++pairs; });
  return pairs;
}

/// The numbers of vertices that are the same place: the first of each.
std::vector<Index> weld(const Points& points, double tolerance) {
  struct Hash {
    std::size_t operator()(const std::array<std::int64_t, 3>& c) const {
      std::uint64_t h = 0;
      for (const std::int64_t x : c) h = (h ^ static_cast<std::uint64_t>(x)) * 0x9e3779b97f4a7c15ull + (h >> 29);
      return static_cast<std::size_t>(h ^ (h >> 31));
    }
  };
  const Vec3 origin = boundsOf(points).min;
  const double cell = 4.0 * tolerance;  // wide, so that most vertices have to look into one cell only
  const auto cellOf = [&](double x) { return static_cast<std::int64_t>(std::floor(x / cell)); };
  std::unordered_map<std::array<std::int64_t, 3>, std::vector<Index>, Hash> cells;
  std::vector<Index> same(points.size());
  for (Index v = 0; v < points.size(); ++v) {
    const Vec3 p = points[v] - origin;
    std::array<std::int64_t, 3> low, high, c;
    for (int d = 0; d < 3; ++d) {
      low[d] = cellOf(p[d] - tolerance);
      high[d] = cellOf(p[d] + tolerance);
    }
    same[v] = v;
    for (c[0] = low[0]; c[0] <= high[0]; ++c[0])
      for (c[1] = low[1]; c[1] <= high[1]; ++c[1])
        for (c[2] = low[2]; c[2] <= high[2]; ++c[2]) {
          const auto found = cells.find(c);
          if (found == cells.end()) continue;
          for (const Index w : found->second)
            if ((points[w] - points[v]).norm() <= tolerance) same[v] = std::min(same[v], w);
        }
    if (same[v] == v) cells[{cellOf(p[0]), cellOf(p[1]), cellOf(p[2])}].push_back(v);
  }
  return same;
}

/// The steps of a repair, in their order; each works on the triangles that the one before left.
class Repair {
 public:
  Repair(const TriangleMesh& mesh, const RepairRules& rules)
      : points_(mesh.vertices), triangles_(mesh.triangles), rules_(rules) {}

  Result<RepairedMesh> run() {
    if (triangles_.empty() || points_.empty())
      return refuse("the surface is empty: it has " + count(points_.size(), "vertex", "vertices") + " and " +
                    count(triangles_.size(), "triangle", "triangles") + ", at least 4 of each are needed");
    for (std::size_t v = 0; v < points_.size(); ++v)
      if (!points_[v].allFinite())
        return refuse("vertex " + std::to_string(v) + " is not finite: " + written(points_[v]) +
                      "; every coordinate must be a finite number");
    for (std::size_t f = 0; f < triangles_.size(); ++f)
      for (const Index v : triangles_[f])
        if (v >= points_.size())
          return refuse("triangle " + std::to_string(f) + " names vertex " + std::to_string(v) +
                        ", but the surface has the vertices 0 to " + std::to_string(points_.size() - 1) + " only");
    diagonal_ = boundsOf(points_).diagonal();
    if (!(diagonal_ > 0.0) || !std::isfinite(diagonal_))
      return refuse("no triangle has an area: the vertices extend over " + std::to_string(diagonal_) + " m");
    merged_.assign(points_.size(), 0);
    if (rules_.merge_vertices) mergeVertices();
    dropTriangles();
    flipFlatTriangles();
    const bool any_area =
        std::any_of(triangles_.begin(), triangles_.end(), [&](const Triangle& t) { return !flat(points_, t); });
    if (!any_area) return refuse("no triangle has an area: all corners lie on a line or in a point");
    if (const std::string why = nonManifold(); !why.empty()) return refuse(why);
    if (const std::string why = agree(); !why.empty()) return refuse(why);
    if (rules_.close_holes) closeHoles();
    splitTouchingVertices();
    const std::size_t open = openEdges();
    result_.solid = open == 0;
    result_.open_edges = open;
    result_.components = components_;
    if (rules_.turn_outwards) turnOutwards();
    dropVertices();
    if (open > 0)
      note("the surface is open: " + count(open, "edge has", "edges have") + " a triangle on one side only");
    const std::size_t crossings = rules_.turn_outwards ? countCrossings(points_, triangles_) : 0;
    result_.self_intersecting = crossings > 0;
    if (crossings > 0)
      note("the surface crosses itself: " + count(crossings, "pair of triangles meets", "pairs of triangles meet") +
           "; it is loaded all the same, cuts through these places may be refused");
    result_.mesh.vertices = std::move(points_);
    result_.mesh.triangles = std::move(triangles_);
    return std::move(result_);
  }

 private:
  static Error refuse(const std::string& why) { return {ErrorCode::kUnsuitableShape, why}; }
  void note(const std::string& what) { result_.notes.push_back(what); }

  void mergeVertices() {
    const std::vector<Index> same = weld(points_, kWeld * diagonal_);
    std::size_t merged = 0;
    for (std::size_t v = 0; v < same.size(); ++v) merged += same[v] != v;
    for (Triangle& t : triangles_)
      for (Index& v : t) v = same[v];
    for (std::size_t v = 0; v < same.size(); ++v) merged_[v] = same[v] != v;
    if (merged > 0) note("merged " + count(merged, "vertex", "vertices") + " at the place of another");
  }

  void dropTriangles() {
    std::set<Triangle> seen;
    std::vector<Triangle> kept;
    std::size_t degenerate = 0, duplicate = 0;
    for (const Triangle& t : triangles_) {
      if (!distinct(t))
        ++degenerate;
      else if (!seen.insert(sorted(t)).second)
        ++duplicate;
      else
        kept.push_back(t);
    }
    triangles_ = std::move(kept);
    if (degenerate > 0) note("dropped " + count(degenerate, "triangle", "triangles") + " with two equal corners");
    if (duplicate > 0) note("dropped " + count(duplicate, "triangle that was", "triangles that were") + " there twice");
  }

  /// A triangle with its corners on a line is needed where it closes a T-junction: its longest edge is flipped into the
  /// neighbour behind it, which changes no shape. Where that is not possible it stays.
  void flipFlatTriangles() {
    std::size_t flipped = 0;
    for (std::size_t pass = 0; pass < 8; ++pass) {
      std::vector<Index> flats;
      for (Index f = 0; f < triangles_.size(); ++f)
        if (flat(points_, triangles_[f])) flats.push_back(f);
      if (flats.empty()) break;
      const std::vector<Side> sides = sidesOf(triangles_);
      const auto edge = [&](Index a, Index b) {
        return std::equal_range(
            sides.begin(), sides.end(), Side{std::min(a, b), std::max(a, b), 0, true},
            [](const Side& x, const Side& y) { return x.low != y.low ? x.low < y.low : x.high < y.high; });
      };
      std::set<Index> changed;
      for (const Index f : flats) {
        const Triangle t = triangles_[f];
        int longest = 0;
        const auto length = [&](int k) { return (points_[t[(k + 1) % 3]] - points_[t[k]]).squaredNorm(); };
        for (int k = 1; k < 3; ++k)
          if (length(k) > length(longest)) longest = k;
        const Index a = t[longest], b = t[(longest + 1) % 3], c = t[(longest + 2) % 3];
        const auto sharing = edge(a, b);
        if (sharing.second - sharing.first != 2) continue;
        const Index g = sharing.first->triangle == f ? (sharing.first + 1)->triangle : sharing.first->triangle;
        if (changed.count(f) || changed.count(g) || sharing.first->forward == (sharing.first + 1)->forward) continue;
        const Index d = triangles_[g][0] + triangles_[g][1] + triangles_[g][2] - a - b;
        const auto across = edge(c, d);
        if (c == d || across.first != across.second) continue;
        triangles_[f] = {a, d, c};
        triangles_[g] = {d, b, c};
        changed.insert(f);
        changed.insert(g);
        ++flipped;
      }
      if (changed.empty()) break;
    }
    std::size_t left = 0;
    for (const Triangle& t : triangles_) left += flat(points_, t);
    if (flipped > 0) note("straightened " + count(flipped, "triangle", "triangles") + " without area");
    if (left > 0) note("kept " + count(left, "triangle", "triangles") + " without area that the surface hangs on");
  }

  std::string nonManifold() const {
    std::size_t edges = 0, most = 0;
    std::string first_place;
    forEachEdge(sidesOf(triangles_), [&](const Side* first, const Side* last) {
      const std::size_t uses = static_cast<std::size_t>(last - first);
      if (uses <= 2) return;
      if (edges++ == 0) first_place = written(points_[first->low]) + " to " + written(points_[first->high]);
      most = std::max(most, uses);
    });
    if (edges == 0) return "";
    return "the surface is not manifold: " + count(edges, "edge is", "edges are") + " shared by up to " +
           std::to_string(most) + " triangles (the first from " + first_place + "); at most 2 are accepted";
  }

  /// Gives each fan of triangles about a vertex a vertex of its own.
  void splitTouchingVertices() {
    std::vector<std::vector<std::pair<Index, int>>> corners(points_.size());
    for (Index f = 0; f < triangles_.size(); ++f)
      for (int k = 0; k < 3; ++k) corners[triangles_[f][k]].push_back({f, k});
    std::size_t doubled = 0;
    const std::size_t old_count = points_.size();
    for (Index v = 0; v < old_count; ++v) {
      auto& fan = corners[v];
      // Grow a fan from the first corner left over edges that contain v; what it does not reach is another fan.
      bool first = true;
      while (!fan.empty()) {
        std::vector<std::pair<Index, int>> reached = {fan.front()}, rest(fan.begin() + 1, fan.end());
        for (std::size_t n = 0; n < reached.size(); ++n) {
          const Triangle& t = triangles_[reached[n].first];
          const int k = reached[n].second;
          const Index left = t[(k + 1) % 3], right = t[(k + 2) % 3];
          for (auto it = rest.begin(); it != rest.end();) {
            const Triangle& o = triangles_[it->first];
            const Index o_left = o[(it->second + 1) % 3], o_right = o[(it->second + 2) % 3];
            if (o_left == left || o_left == right || o_right == left || o_right == right) {
              reached.push_back(*it);
              it = rest.erase(it);
            } else {
              ++it;
            }
          }
        }
        if (!first) {
          const Index copy = static_cast<Index>(points_.size());
          points_.push_back(Vec3(points_[v]));
          merged_.push_back(0);
          for (const auto& corner : reached) triangles_[corner.first][corner.second] = copy;
          ++doubled;
        }
        first = false;
        fan = std::move(rest);
      }
    }
    if (doubled > 0)
      note("doubled " + count(doubled, "vertex", "vertices") + " where the surface touches itself in a point only");
  }

  /// Turns the fewer triangles of each component so that all agree.
  std::string agree() {
    const Orientation orientation = orient(triangles_, sidesOf(triangles_));
    if (orientation.conflicts > 0)
      return "the surface is not manifold: it has one side only (like a Moebius strip), " +
             count(orientation.conflicts, "edge cannot", "edges cannot") + " be oriented";
    component_ = orientation.component;
    components_ = orientation.components;
    std::vector<std::size_t> size(components_, 0), turns(components_, 0);
    for (std::size_t f = 0; f < triangles_.size(); ++f) {
      ++size[component_[f]];
      turns[component_[f]] += orientation.turn[f] != 0;
    }
    std::size_t turned = 0;
    for (std::size_t f = 0; f < triangles_.size(); ++f) {
      const bool fewer = 2 * turns[component_[f]] <= size[component_[f]];
      if ((orientation.turn[f] != 0) != fewer) continue;
      std::swap(triangles_[f][1], triangles_[f][2]);
      ++turned;
    }
    if (turned > 0) note("turned " + count(turned, "triangle", "triangles") + " that faced against the neighbours");
    return "";
  }

  std::size_t openEdges() const {
    std::size_t open = 0;
    forEachEdge(sidesOf(triangles_), [&](const Side* first, const Side* last) { open += last - first == 1; });
    return open;
  }

  void closeHoles() {
    const std::vector<Side> sides = sidesOf(triangles_);
    std::multimap<Index, Index> next;  // along the rims, which run against the triangles
    std::set<std::pair<Index, Index>> edges;
    std::map<Index, Index> component_at;
    forEachEdge(sides, [&](const Side* first, const Side* last) {
      edges.insert({first->low, first->high});
      if (last - first != 1) return;
      next.insert(first->forward ? std::make_pair(first->high, first->low) : std::make_pair(first->low, first->high));
      component_at[first->low] = component_at[first->high] = component_[first->triangle];
    });
    std::vector<double> area(components_, 0.0);
    for (std::size_t f = 0; f < triangles_.size(); ++f) area[component_[f]] += surfaceArea(points_, {triangles_[f]});

    std::size_t closed = 0, rims = 0;
    std::vector<Index> path;
    while (!next.empty()) {
      if (path.empty()) path.push_back(next.begin()->first);
      const auto step = next.find(path.back());
      if (step == next.end()) {
        path.clear();
        continue;
      }
      const Index to = step->second;
      next.erase(step);
      // Where the path comes back to itself a rim is complete: holes that touch in a vertex are told apart so.
      const auto back = std::find(path.begin(), path.end(), to);
      if (back == path.end()) {
        path.push_back(to);
        continue;
      }
      const std::vector<Index> rim(back, path.end());
      path.erase(back + 1, path.end());
      if (path.size() == 1 && next.count(path.front()) == 0) path.clear();
      double length = 0.0;
      for (std::size_t k = 0; k < rim.size(); ++k)
        length += (points_[rim[k]] - points_[rim[(k + 1) % rim.size()]]).norm();
      if (rim.size() < 3 || !(length < kSmallHole * diagonal_)) continue;
      const std::vector<Triangle> patch = fill(rim, edges);
      // A patch as large as what it closes would lie back to back with an open sheet.
      const Index component = component_at[rim[0]];
      if (patch.empty() || !(surfaceArea(points_, patch) < 0.5 * area[component])) continue;
      for (const Triangle& t : patch) {
        triangles_.push_back(t);
        component_.push_back(component);
        for (int k = 0; k < 3; ++k) edges.insert({std::min(t[k], t[(k + 1) % 3]), std::max(t[k], t[(k + 1) % 3])});
      }
      ++closed;
      rims += rim.size();
    }
    if (closed > 0)
      note("closed " + count(closed, "small hole", "small holes") + " with " + count(rims, "open edge", "open edges") +
           " in all");
  }

  /// The triangulation of a rim with the least area that uses no edge twice (Barequet and Sharir 1995); empty: none.
  std::vector<Triangle> fill(const std::vector<Index>& rim, const std::set<std::pair<Index, Index>>& edges) const {
    const std::size_t n = rim.size();
    if (n > kLongestRim) return {};
    constexpr double kNever = std::numeric_limits<double>::infinity();
    std::vector<std::vector<double>> cost(n, std::vector<double>(n, 0.0));
    std::vector<std::vector<std::size_t>> apex(n, std::vector<std::size_t>(n, 0));
    for (std::size_t span = 2; span < n; ++span)
      for (std::size_t i = 0; i + span < n; ++i) {
        const std::size_t j = i + span;
        cost[i][j] = kNever;
        const bool whole = i == 0 && j == n - 1;  // the rim's own last edge
        if (!whole && edges.count({std::min(rim[i], rim[j]), std::max(rim[i], rim[j])})) continue;
        for (std::size_t m = i + 1; m < j; ++m) {
          const Vec3 a = points_[rim[m]] - points_[rim[i]], b = points_[rim[j]] - points_[rim[i]];
          const double total = cost[i][m] + cost[m][j] + a.cross(b).norm();
          if (total < cost[i][j]) {
            cost[i][j] = total;
            apex[i][j] = m;
          }
        }
      }
    if (!std::isfinite(cost[0][n - 1])) return {};
    std::vector<Triangle> patch;
    std::vector<std::pair<std::size_t, std::size_t>> spans = {{0, n - 1}};
    while (!spans.empty()) {
      const auto [i, j] = spans.back();
      spans.pop_back();
      if (j - i < 2) continue;
      const std::size_t m = apex[i][j];
      patch.push_back({rim[i], rim[m], rim[j]});
      spans.push_back({i, m});
      spans.push_back({m, j});
    }
    return patch;
  }

  void turnOutwards() {
    struct Part {
      TriangleMesh mesh;  // all vertices, its triangles, its volume positive
      Points own;         // its vertices
      Box box;
      bool closed = true, inside_out = false;
    };
    std::vector<Part> parts(components_);
    for (std::size_t f = 0; f < triangles_.size(); ++f) parts[component_[f]].mesh.triangles.push_back(triangles_[f]);
    forEachEdge(sidesOf(triangles_), [&](const Side* first, const Side* last) {
      if (last - first == 1) parts[component_[first->triangle]].closed = false;
    });
    for (Part& part : parts) {
      std::set<Index> used;
      for (const Triangle& t : part.mesh.triangles) used.insert(t.begin(), t.end());
      for (const Index v : used) part.own.push_back(points_[v]);
      part.box = boundsOf(part.own);
      part.inside_out = signedVolume(points_, part.mesh.triangles) < 0.0;
      if (part.inside_out)
        for (Triangle& t : part.mesh.triangles) std::swap(t[1], t[2]);
    }
    std::vector<int> depth(parts.size(), 0);
    for (std::size_t outer = 0; outer < parts.size() && parts.size() > 1; ++outer) {
      if (!parts[outer].closed) continue;
      std::unique_ptr<SolidQuery> query;  // made for those that hold another's box
      for (std::size_t inner = 0; inner < parts.size(); ++inner) {
        const Box &in = parts[inner].box, &out = parts[outer].box;
        if (inner == outer || !out.contains(in.min) || !out.contains(in.max)) continue;
        if (!query) {
          parts[outer].mesh.vertices = points_;
          query = std::make_unique<SolidQuery>(parts[outer].mesh);
        }
        // Most of some vertices: one alone could lie on the other surface.
        const Points& own = parts[inner].own;
        const std::size_t asked = std::min<std::size_t>(own.size(), 9);
        std::size_t inside = 0;
        for (std::size_t k = 0; k < asked; ++k) inside += query->contains(own[k * own.size() / asked]);
        if (2 * inside > asked) ++depth[inner];
      }
    }
    std::vector<char> turn(parts.size(), 0);
    std::size_t inside_out = 0, cavities = 0;
    for (std::size_t c = 0; c < parts.size(); ++c) {
      if (!parts[c].closed) continue;
      const bool cavity = depth[c] % 2 == 1;
      turn[c] = parts[c].inside_out != cavity;
      inside_out += turn[c] && !cavity;
      cavities += turn[c] && cavity;
    }
    for (std::size_t f = 0; f < triangles_.size(); ++f)
      if (turn[component_[f]]) std::swap(triangles_[f][1], triangles_[f][2]);
    if (inside_out > 0 && parts.size() == 1) note("the surface was inside-out and has been turned");
    if (inside_out > 0 && parts.size() > 1)
      note(count(inside_out, "component", "components") + " of " + std::to_string(parts.size()) +
           (inside_out == 1 ? " was inside-out and has been turned" : " were inside-out and have been turned"));
    if (cavities > 0) note("turned " + count(cavities, "component", "components") + " inside another into a cavity");
  }

  void dropVertices() {
    std::vector<Index> number(points_.size(), kNoIndex);
    for (const Triangle& t : triangles_)
      for (const Index v : t) number[v] = 0;
    Points kept;
    std::size_t unused = 0;
    for (std::size_t v = 0; v < points_.size(); ++v) {
      if (number[v] == kNoIndex) {
        unused += !merged_[v];  // merged ones were counted
        continue;
      }
      number[v] = static_cast<Index>(kept.size());
      kept.push_back(points_[v]);
    }
    for (Triangle& t : triangles_)
      for (Index& v : t) v = number[v];
    points_ = std::move(kept);
    if (unused > 0) note("dropped " + count(unused, "vertex", "vertices") + " that no triangle uses");
  }

  Points points_;
  std::vector<Triangle> triangles_;
  const RepairRules rules_;
  std::vector<Index> component_;  // one a triangle, once they agree
  std::vector<char> merged_;      // one a vertex
  Index components_ = 0;
  double diagonal_ = 0.0;
  RepairedMesh result_;
};

}  // namespace

MeshReport inspectMesh(const TriangleMesh& mesh, bool check_intersections) {
  MeshReport report;
  for (const Vec3& p : mesh.vertices) report.non_finite_vertices += !p.allFinite();
  std::vector<Triangle> sound;
  std::set<Triangle> seen;
  for (const Triangle& t : mesh.triangles) {
    if (std::any_of(t.begin(), t.end(), [&](Index v) { return v >= mesh.vertices.size(); })) {
      ++report.bad_indices;
      continue;
    }
    if (std::any_of(t.begin(), t.end(), [&](Index v) { return !mesh.vertices[v].allFinite(); })) continue;
    if (!distinct(t) || flat(mesh.vertices, t)) ++report.degenerate_triangles;
    if (!distinct(t)) continue;
    if (!seen.insert(sorted(t)).second) ++report.duplicate_triangles;
    sound.push_back(t);
  }
  const std::vector<Side> sides = sidesOf(sound);
  forEachEdge(sides, [&](const Side* first, const Side* last) {
    report.boundary_edges += last - first == 1;
    report.non_manifold_edges += last - first > 2;
  });
  const Orientation orientation = orient(sound, sides);
  report.non_manifold_edges += orientation.conflicts;
  report.components = orientation.components;
  report.signed_volume = signedVolume(mesh.vertices, sound);
  if (check_intersections) report.self_intersections = countCrossings(mesh.vertices, sound);
  return report;
}

Result<RepairedMesh> repairMesh(const TriangleMesh& mesh, const RepairRules& rules) {
  return Repair(mesh, rules).run();
}

TriangleMesh withMergedVertices(const TriangleMesh& mesh) {
  const std::vector<Index> same = weld(mesh.vertices, kWeld * boundsOf(mesh.vertices).diagonal());
  TriangleMesh merged = mesh;
  for (Triangle& t : merged.triangles)
    for (Index& v : t) v = same[v];
  return merged;
}

}  // namespace meshless
