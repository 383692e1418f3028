// Where the blade's rectangle crosses the surface, and the triangles that are split there.
#include <algorithm>
#include <cmath>
#include <tuple>

#include "mesh/edge_table.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "surgery_parts.h"

namespace meshless {
namespace surgery {
namespace {

constexpr double kAlong = 0.9;  // cosine between the normals of a blade and of a wound face that it follows

enum class Reach { kInside, kBorder, kOutside };

/// Corners of a triangle that has some above and some below. Along its outline the plane is passed downwards at `down`
/// and upwards at `up`; then follow the corners above, then those below. down and up are corners on the plane or
/// crossings of edges.
struct Crossed {
  Index triangle;
  Index down, up;
  std::array<Index, 2> above, below;  // in the triangle's direction; above after up, below after down
  int above_count, below_count;
  bool down_is_corner, up_is_corner;
  Index chord_from = kNoIndex, chord_to = kNoIndex;  // the part within the blade, in the direction down -> up
};

/// An edge of a triangle with both ends on the plane.
struct FlatEdge {
  Index from, to;  // from < to
  int direction;   // +1: the triangle runs from -> to
  Index triangle;
  bool upper;  // the triangle bounds the solid above the plane
  bool coplanar;
};

class Opener {
 public:
  Opener(const TriangleMesh& mesh, const Frame& frame) : mesh_(mesh) {
    surface_.frame = frame;
    surface_.positions = mesh.vertices;
    surface_.mesh_vertices = static_cast<Index>(mesh.vertices.size());
    surface_.places.assign(mesh.vertices.size(), Vec2::Zero());
    surface_.within.assign(mesh.vertices.size(), 0);
  }

  Result<SplitSurface> run(double follow) {
    follow_ = std::max(follow, surface_.frame.band);
    const Status crossed = findCrossings();
    if (!crossed) return crossed.error();
    limitRectangle();
    if (!(surface_.frame.low.array() < surface_.frame.high.array()).all())
      return Error{ErrorCode::kMissed, "the blade meets no tissue: it is beside the surface"};
    for (const Index v : in_plane_) surface_.within[v] = snap(surface_.places[v]) != Reach::kOutside;
    for (const Crossed& c : crossed_) surface_.section.push_back({c.down, c.up, 1});
    surface_.section.insert(surface_.section.end(), flat_.begin(), flat_.end());
    markWithin();
    splitTriangles();
    return std::move(surface_);
  }

 private:
  /// The crossing of an edge, always computed from its upper end to its lower one: wound faces that lie on each other
  /// are crossed at the same bits.
  Index crossing(EdgeTable<Index>& crossings, Index upper, Index lower) {
    Index& vertex = crossings.at(upper, lower);
    if (vertex == kNoIndex) {
      vertex = surface_.addBetween(upper, lower, heights_[upper] / (heights_[upper] - heights_[lower]));
      surface_.places[vertex] = surface_.frame.flat(surface_.positions[vertex]);
      in_plane_.push_back(vertex);
    }
    return vertex;
  }

  Status findCrossings() {
    const Frame& f = surface_.frame;
    heights_.resize(mesh_.vertices.size());
    surface_.sides.resize(mesh_.vertices.size());
    const std::vector<char> followed = followedVertices();
    bool any_above = false, any_below = false;
    for (Index v = 0; v < heights_.size(); ++v) {
      heights_[v] = f.height(mesh_.vertices[v]);
      const double band = !followed.empty() && followed[v] ? follow_ : f.band;
      const int side = (heights_[v] > band) - (heights_[v] < -band);
      surface_.sides[v] = static_cast<signed char>(side);
      any_above |= side > 0;
      any_below |= side < 0;
      if (side != 0) continue;
      surface_.places[v] = f.flat(mesh_.vertices[v]);
      in_plane_.push_back(v);
    }
    if (!f.bounded && (!any_above || !any_below))
      return Error{ErrorCode::kMissed, std::string("the plane misses the surface: nothing of it is ") +
                                           (any_above ? "below" : "above") + " the plane by more than " +
                                           std::to_string(1e3 * f.band) + " mm"};
    std::vector<Index> mixed;
    std::vector<FlatEdge> flat_edges;
    for (Index t = 0; t < mesh_.triangles.size(); ++t) {
      const Triangle& v = mesh_.triangles[t];
      const std::array<int, 3> s{surface_.sides[v[0]], surface_.sides[v[1]], surface_.sides[v[2]]};
      if (s[0] == s[1] && s[1] == s[2] && s[0] != 0) continue;
      const bool above = s[0] > 0 || s[1] > 0 || s[2] > 0, below = s[0] < 0 || s[1] < 0 || s[2] < 0;
      if (above && below) {
        mixed.push_back(t);
        continue;
      }
      const int on = (s[0] == 0) + (s[1] == 0) + (s[2] == 0);
      if (on < 2) continue;
      const bool upper = surface_.isUpper(v);
      for (int k = 0; k < 3; ++k) {
        const Index a = v[k], b = v[(k + 1) % 3];
        if (s[k] == 0 && s[(k + 1) % 3] == 0)
          flat_edges.push_back({std::min(a, b), std::max(a, b), a < b ? 1 : -1, t, upper, on == 3});
      }
      if (on == 3) coplanar_.push_back(t);
    }
    if (f.bounded && mixed.empty() && flat_edges.empty())
      return Error{ErrorCode::kMissed, "the blade meets no tissue: its plane is beside the surface"};
    EdgeTable<Index> crossings(2 * mixed.size() + 16, kNoIndex);
    crossed_.reserve(mixed.size());
    for (const Index t : mixed) addCrossed(t, crossings);
    findFlat(std::move(flat_edges));
    return Done{};
  }

  /// Vertices all of whose wound faces run along the plane.
  std::vector<char> followedVertices() const {
    if (mesh_.patches.empty() || !(follow_ > surface_.frame.band)) return {};
    std::vector<char> along(mesh_.vertices.size(), 0), across(mesh_.vertices.size(), 0);
    for (Index t = 0; t < mesh_.triangles.size(); ++t) {
      if (!isCutPatch(mesh_.patches[t])) continue;
      const Triangle& v = mesh_.triangles[t];
      const Vec3 area =
          (mesh_.vertices[v[1]] - mesh_.vertices[v[0]]).cross(mesh_.vertices[v[2]] - mesh_.vertices[v[0]]);
      const bool is_along = std::abs(area.dot(surface_.frame.normal)) > kAlong * area.norm();
      for (const Index k : v) (is_along ? along : across)[k] = 1;
    }
    for (std::size_t v = 0; v < along.size(); ++v) along[v] = along[v] && !across[v];
    return along;
  }

  void addCrossed(Index t, EdgeTable<Index>& crossings) {
    const Triangle& v = mesh_.triangles[t];
    const std::array<int, 3> s{surface_.sides[v[0]], surface_.sides[v[1]], surface_.sides[v[2]]};
    Crossed c{t, kNoIndex, kNoIndex, {}, {}, 0, 0, false, false};
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3, previous = (k + 2) % 3;
      if (s[k] > 0 && s[next] < 0) c.down = crossing(crossings, v[k], v[next]);
      if (s[k] < 0 && s[next] > 0) c.up = crossing(crossings, v[next], v[k]);
      if (s[k] == 0) {
        (s[previous] > 0 ? c.down : c.up) = v[k];
        (s[previous] > 0 ? c.down_is_corner : c.up_is_corner) = true;
      }
      if (s[k] > 0 && s[previous] <= 0) {
        c.above[c.above_count++] = v[k];
        if (s[next] > 0) c.above[c.above_count++] = v[next];
      }
      if (s[k] < 0 && s[previous] >= 0) {
        c.below[c.below_count++] = v[k];
        if (s[next] < 0) c.below[c.below_count++] = v[next];
      }
    }
    crossed_.push_back(c);
  }

  /// Flat edges where the surface goes through the plane or touches it, and their triangles.
  void findFlat(std::vector<FlatEdge> edges) {
    std::sort(edges.begin(), edges.end(), [](const FlatEdge& p, const FlatEdge& q) {
      return std::tie(p.from, p.to, p.triangle) < std::tie(q.from, q.to, q.triangle);
    });
    for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
      int weight = 0;
      bool all_coplanar = true;
      for (; end < edges.size() && edges[end].from == edges[begin].from && edges[end].to == edges[begin].to; ++end) {
        if (edges[end].upper) weight += edges[end].direction;
        all_coplanar &= edges[end].coplanar;
      }
      if (weight == 0 && all_coplanar) continue;
      flat_.push_back({edges[begin].from, edges[begin].to, weight});
      for (std::size_t e = begin; e < end; ++e) flat_triangles_.emplace_back(flat_.size() - 1, edges[e].triangle);
    }
  }

  /// A blade may be much larger than the body. What is cut off lies in the air.
  void limitRectangle() {
    Frame& f = surface_.frame;
    Vec2 low = Vec2::Constant(1e300), high = Vec2::Constant(-1e300);
    for (const Index v : in_plane_) {
      low = low.cwiseMin(surface_.places[v]);
      high = high.cwiseMax(surface_.places[v]);
    }
    const Vec2 margin = Vec2::Constant(0.05 * (high - low).norm() + 10.0 * f.band);
    f.low = f.bounded ? f.low.cwiseMax(low - margin) : Vec2(low - margin);
    f.high = f.bounded ? f.high.cwiseMin(high + margin) : Vec2(high + margin);
  }

  Reach snap(Vec2& p) const {
    const Frame& f = surface_.frame;
    Reach reach = Reach::kInside;
    for (int k = 0; k < 2; ++k) {
      if (p[k] < f.low[k] - f.band || p[k] > f.high[k] + f.band) return Reach::kOutside;
    }
    for (int k = 0; k < 2; ++k) {
      if (std::abs(p[k] - f.low[k]) <= f.band) {
        p[k] = f.low[k];
        reach = Reach::kBorder;
      } else if (std::abs(p[k] - f.high[k]) <= f.band) {
        p[k] = f.high[k];
        reach = Reach::kBorder;
      }
    }
    return reach;
  }

  /// The part of from -> to within the rectangle; end vertices are made where the border crosses it. False: nothing.
  bool within(Index from, Index to, Index& first, Index& last) {
    Vec2 a = surface_.places[from], b = surface_.places[to];
    const Frame& f = surface_.frame;
    const bool a_in = snap(a) != Reach::kOutside, b_in = snap(b) != Reach::kOutside;
    first = from;
    last = to;
    if (a_in && b_in) return true;
    // The same end, to the last bit, for a wound face that lies on this one and runs the other way.
    const bool swapped = comesFirst(surface_.positions[to], surface_.positions[from]);
    if (swapped) std::swap(a, b);
    double enter = 0.0, leave = 1.0;
    int enter_axis = 0, leave_axis = 0;
    double enter_at = 0.0, leave_at = 0.0;
    for (int k = 0; k < 2; ++k) {
      const double step = b[k] - a[k];
      if (step == 0.0) {
        if (a[k] < f.low[k] || a[k] > f.high[k]) return false;
        continue;
      }
      const double near = step > 0.0 ? f.low[k] : f.high[k], far = step > 0.0 ? f.high[k] : f.low[k];
      if ((near - a[k]) / step > enter) {
        enter = (near - a[k]) / step;
        enter_axis = k;
        enter_at = near;
      }
      if ((far - a[k]) / step < leave) {
        leave = (far - a[k]) / step;
        leave_axis = k;
        leave_at = far;
      }
    }
    if (!((leave - enter) * (b - a).norm() > 2.0 * f.band)) return false;
    const Index start = swapped ? to : from, end = swapped ? from : to;
    const bool start_in = swapped ? b_in : a_in, end_in = swapped ? a_in : b_in;
    const auto endVertex = [&](double s, int axis, double at) {
      const Index made = surface_.addBetween(start, end, s);
      Vec2 place = a + s * (b - a);
      place[axis] = at;
      snap(place);
      surface_.places[made] = place;
      surface_.section_of_made.emplace(made, start);
      return made;
    };
    const Index near_end = start_in ? start : endVertex(enter, enter_axis, enter_at);
    const Index far_end = end_in ? end : endVertex(leave, leave_axis, leave_at);
    first = swapped ? far_end : near_end;
    last = swapped ? near_end : far_end;
    return true;
  }

  void markWithin() {
    std::vector<Index> met;  // triangles
    for (Crossed& c : crossed_) {
      Index first, last;
      if (!within(c.down, c.up, first, last)) continue;
      c.chord_from = first;
      c.chord_to = last;
      met.push_back(c.triangle);
      for (const Index v : {first, last}) surface_.within[v] = 1;
    }
    std::vector<char> flat_met(flat_.size(), 0);
    for (std::size_t i = 0; i < flat_.size(); ++i) {
      const SectionEdge& e = flat_[i];
      Index first, last;
      if (!within(e.from, e.to, first, last)) continue;
      flat_met[i] = 1;
      std::vector<Index> inner;
      if (first != e.from) inner.push_back(first);
      if (last != e.to) inner.push_back(last);
      for (const Index v : inner) surface_.within[v] = 1;
      if (!inner.empty()) inside_edge_.emplace(edgeKey(e.from, e.to), std::move(inner));
    }
    for (const auto& [edge, triangle] : flat_triangles_)
      if (flat_met[edge]) met.push_back(triangle);
    // By length: the short edges that earlier blades left must not make the wound faces finer and finer.
    double lengths = 0.0, squares = 0.0;
    for (const Index t : met) {
      const Triangle& v = mesh_.triangles[t];
      for (int k = 0; k < 3; ++k) {
        const double squared = (mesh_.vertices[v[(k + 1) % 3]] - mesh_.vertices[v[k]]).squaredNorm();
        lengths += std::sqrt(squared);
        squares += squared;
      }
    }
    if (lengths > 0.0) surface_.spacing = squares / lengths;
    for (const Index t : coplanar_) {
      const Triangle& v = mesh_.triangles[t];
      const Vec2 middle = (surface_.places[v[0]] + surface_.places[v[1]] + surface_.places[v[2]]) / 3.0;
      if ((middle.array() > surface_.frame.low.array()).all() && (middle.array() < surface_.frame.high.array()).all())
        surface_.lies_in_surface = true;
    }
  }

  /// A crossing that is within the rectangle is one of the surface's vertices now.
  bool present(Index v, bool corner) const { return corner || surface_.within[v] != 0; }

  void splitTriangles() {
    surface_.triangles.reserve(mesh_.triangles.size() + 3 * crossed_.size());
    surface_.patches.reserve(mesh_.triangles.size() + 3 * crossed_.size());
    surface_.triangles = mesh_.triangles;
    surface_.patches = mesh_.patches;
    if (surface_.patches.empty()) surface_.patches.assign(mesh_.triangles.size(), kOuterPatch);
    std::vector<Triangle> parts;
    const auto replace = [&](Index t) {
      surface_.triangles[t] = parts[0];
      for (std::size_t p = 1; p < parts.size(); ++p) {
        surface_.triangles.push_back(parts[p]);
        surface_.patches.push_back(surface_.patches[t]);
      }
    };
    for (const Crossed& c : crossed_) {
      parts.clear();
      splitCrossed(c, parts);
      if (!parts.empty()) replace(c.triangle);
    }
    if (!inside_edge_.empty()) splitAtEdges(surface_.triangles, surface_.patches, inside_edge_);
  }

  /// A convex polygon of three or four corners.
  void addConvex(const std::array<Index, 4>& v, int count, std::vector<Triangle>& parts) const {
    if (count == 3) return parts.push_back({v[0], v[1], v[2]});
    const Points& p = surface_.positions;
    const double diagonal_02 = (p[v[2]] - p[v[0]]).squaredNorm(), diagonal_13 = (p[v[3]] - p[v[1]]).squaredNorm();
    bool first = diagonal_02 < diagonal_13;
    // Wound faces that lie on each other must be split alike.
    if (diagonal_02 == diagonal_13) {
      const Vec3& low_02 = comesFirst(p[v[0]], p[v[2]]) ? p[v[0]] : p[v[2]];
      const Vec3& low_13 = comesFirst(p[v[1]], p[v[3]]) ? p[v[1]] : p[v[3]];
      first = comesFirst(low_02, low_13);
    }
    const int k = first ? 0 : 1;
    parts.push_back({v[k], v[k + 1], v[k + 2]});
    parts.push_back({v[(k + 2) % 4], v[(k + 3) % 4], v[k]});
  }

  void splitCrossed(const Crossed& c, std::vector<Triangle>& parts) const {
    const bool down_present = present(c.down, c.down_is_corner), up_present = present(c.up, c.up_is_corner);
    Index from = c.chord_from, to = c.chord_to;
    if (from == kNoIndex) {
      const bool down_used = down_present && !c.down_is_corner, up_used = up_present && !c.up_is_corner;
      if (!down_used && !up_used) return;
      if (down_present && up_present) {
        from = c.down;
        to = c.up;
      } else {
        const Index middle = down_used ? c.down : c.up;
        const Index before = down_used ? c.above[c.above_count - 1] : c.below[c.below_count - 1];
        const Index after = down_used ? c.below[0] : c.above[0];
        const Triangle& v = mesh_.triangles[c.triangle];
        const Index apex = v[0] != before && v[0] != after ? v[0] : v[1] != before && v[1] != after ? v[1] : v[2];
        parts.push_back({before, middle, apex});
        parts.push_back({middle, after, apex});
        return;
      }
    }
    std::array<Index, 4> polygon{};
    int count = 0;
    polygon[count++] = from;
    polygon[count++] = to;
    for (int k = 0; k < c.above_count; ++k) polygon[count++] = c.above[k];
    addConvex(polygon, count, parts);
    count = 0;
    polygon[count++] = to;
    polygon[count++] = from;
    for (int k = 0; k < c.below_count; ++k) polygon[count++] = c.below[k];
    addConvex(polygon, count, parts);
    const Index last_above = c.above[c.above_count - 1], last_below = c.below[c.below_count - 1];
    if (from != c.down) {
      if (down_present) {
        parts.push_back({last_above, c.down, from});
        parts.push_back({c.down, c.below[0], from});
      } else {
        parts.push_back({last_above, c.below[0], from});
      }
    }
    if (to != c.up) {
      if (up_present) {
        parts.push_back({last_below, c.up, to});
        parts.push_back({c.up, c.above[0], to});
      } else {
        parts.push_back({last_below, c.above[0], to});
      }
    }
  }

  const TriangleMesh& mesh_;
  double follow_ = 0.0;  // [m]
  SplitSurface surface_;
  std::vector<double> heights_;
  std::vector<Index> in_plane_;  // vertices
  std::vector<Crossed> crossed_;
  std::vector<SectionEdge> flat_;
  std::vector<std::pair<std::size_t, Index>> flat_triangles_;  // of each of those
  std::vector<Index> coplanar_;                                // triangles
  InnerVertices inside_edge_;
};

}  // namespace

Result<SplitSurface> splitAtBlade(const TriangleMesh& mesh, const Frame& frame, double follow) {
  return Opener(mesh, frame).run(follow);
}

}  // namespace surgery
}  // namespace meshless
