// The solid's section within the blade's rectangle, triangulated.
#include <algorithm>
#include <cmath>
#include <unordered_map>

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Spatial_sort_traits_adapter_2.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>
#include <CGAL/property_map.h>
#include <CGAL/spatial_sort.h>

#include "incise_parts.h"

namespace meshless {
namespace incising {
namespace {

constexpr int kUnreached = 1 << 30;

struct FaceInfo {
  int winding = kUnreached;
  Index component = kNoIndex;
  Index number = kNoIndex;
};

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<Index, Kernel>;
using FaceBase =
    CGAL::Triangulation_face_base_with_info_2<FaceInfo, Kernel, CGAL::Constrained_triangulation_face_base_2<Kernel>>;
using Cdt =
    CGAL::Constrained_Delaunay_triangulation_2<Kernel, CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>>;
using Face = Cdt::Face_handle;

double cross(const Vec2& a, const Vec2& b) { return a.x() * b.y() - a.y() * b.x(); }

std::uint64_t directedKey(Index a, Index b) { return (static_cast<std::uint64_t>(a) << 32) | b; }

/// Segments by place, to keep inner points away from them.
class SegmentGrid {
 public:
  SegmentGrid(const Vec2& low, const Vec2& high, double cell) : low_(low), cell_(cell) {
    for (int k = 0; k < 2; ++k) counts_[k] = 1 + static_cast<int>((high[k] - low[k]) / cell);
    cells_.resize(static_cast<std::size_t>(counts_[0]) * counts_[1]);
  }

  void add(const Vec2& a, const Vec2& b) {
    const Index number = static_cast<Index>(segments_.size());
    segments_.push_back({a, b});
    // Long ones step by step: their bounds may cover the whole grid.
    const int steps = 1 + static_cast<int>((b - a).norm() / cell_);
    for (int i = 0; i < steps; ++i) {
      const Vec2 p = a + (b - a) * (static_cast<double>(i) / steps), q = a + (b - a) * ((i + 1.0) / steps);
      for (int x = at(std::min(p.x(), q.x()), 0); x <= at(std::max(p.x(), q.x()), 0); ++x)
        for (int y = at(std::min(p.y(), q.y()), 1); y <= at(std::max(p.y(), q.y()), 1); ++y) {
          std::vector<Index>& cell = cells_[static_cast<std::size_t>(x) * counts_[1] + y];
          if (cell.empty() || cell.back() != number) cell.push_back(number);
        }
    }
  }

  /// True where a segment is nearer to p than `distance`, at most a cell.
  bool isNear(const Vec2& p, double distance) const {
    for (int x = std::max(at(p.x(), 0) - 1, 0); x <= std::min(at(p.x(), 0) + 1, counts_[0] - 1); ++x)
      for (int y = std::max(at(p.y(), 1) - 1, 0); y <= std::min(at(p.y(), 1) + 1, counts_[1] - 1); ++y)
        for (const Index s : cells_[static_cast<std::size_t>(x) * counts_[1] + y]) {
          const auto& [a, b] = segments_[s];
          const Vec2 edge = b - a, arm = p - a;
          const double length = edge.squaredNorm();
          const double t = length > 0.0 ? std::min(std::max(edge.dot(arm) / length, 0.0), 1.0) : 0.0;
          if ((arm - t * edge).squaredNorm() < distance * distance) return true;
        }
    return false;
  }

 private:
  int at(double x, int axis) const {
    return std::min(std::max(static_cast<int>((x - low_[axis]) / cell_), 0), counts_[axis] - 1);
  }

  Vec2 low_;
  double cell_;
  std::array<int, 2> counts_{1, 1};
  std::vector<std::array<Vec2, 2>> segments_;
  std::vector<std::vector<Index>> cells_;
};

Error pressed() {
  return Error{
      ErrorCode::kUnsuitableShape,
      "the surface crosses itself where the blade meets it, or wound faces of earlier incisions press into each other"};
}

class WoundFiller {
 public:
  WoundFiller(const SplitSurface& surface, const InciseOptions& options, bool touched)
      : surface_(surface), frame_(surface.frame), options_(options) {
    for (const RimEdge& e : surface.rim)
      if (e.kind == RimEdge::kCrossed || touched) rim_.push_back(static_cast<Index>(&e - surface.rim.data()));
  }

  Result<WoundFaces> run() {
    if (rim_.empty()) {
      if (windingAt(0.5 * (frame_.low + frame_.high)) != 0)
        return Error{ErrorCode::kMissed, "the blade does not reach the surface: it is wholly inside the tissue"};
      return missed();
    }
    mergeNodes();
    Status done = placeRim();
    if (done) done = triangulate();
    if (done) done = flood();
    if (!done) return done.error();
    if (filled_ == 0) {
      if (any_solid_)
        return Error{ErrorCode::kMissed, "the blade does not reach the surface: it touches it without opening it"};
      return missed();
    }
    refine();
    done = flood();
    if (!done) return done.error();
    return extract();
  }

 private:
  Error missed() const {
    if (surface_.lies_in_surface)
      return Error{ErrorCode::kMissed,
                   "nothing is left to open: the tissue is already open there, or the blade only lies on it"};
    return Error{ErrorCode::kMissed, "the blade meets no tissue"};
  }

  /// Winding number of the whole section around p, counted along +x.
  int windingAt(const Vec2& p) const {
    int winding = 0;
    for (const auto& [a, b] : surface_.section) {
      if ((a.y() > p.y()) == (b.y() > p.y())) continue;
      const double x = a.x() + (p.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x());
      if (x > p.x()) winding += b.y() > a.y() ? 1 : -1;
    }
    return winding;
  }

  /// Vertices of the rim at the same place become one node: they are there where wound faces lie on each other.
  void mergeNodes() {
    std::vector<Index> vertices;
    for (const Index r : rim_) {
      const RimEdge& e = surface_.rim[r];
      vertices.push_back(e.from);
      vertices.push_back(e.to);
    }
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    for (const double x : {frame_.low.x(), frame_.high.x()})
      for (const double y : {frame_.low.y(), frame_.high.y()}) wound_.nodes.push_back({Vec2(x, y), kNoIndex});
    for (const Index v : vertices) wound_.nodes.push_back({surface_.places[v], v});

    const double snap = 1e-3 * frame_.band;
    std::vector<Index> order(wound_.nodes.size());
    for (Index n = 0; n < order.size(); ++n) order[n] = n;
    std::sort(order.begin(), order.end(), [&](Index a, Index b) {
      const double x = wound_.nodes[a].place.x(), y = wound_.nodes[b].place.x();
      return x != y ? x < y : a < b;
    });
    merged_.resize(order.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
      const Index n = order[i];
      merged_[n] = n;
      for (std::size_t j = i; j-- > 0;) {
        const Index other = order[j];
        if (wound_.nodes[n].place.x() - wound_.nodes[other].place.x() > snap) break;
        if (merged_[other] == other && (wound_.nodes[n].place - wound_.nodes[other].place).norm() <= snap) {
          merged_[n] = other;
          break;
        }
      }
    }
    for (Index n = 0; n < order.size(); ++n)
      if (wound_.nodes[n].vertex != kNoIndex) node_of_vertex_.emplace(wound_.nodes[n].vertex, merged_[n]);
    for (Index n = 0; n < order.size(); ++n) {
      Index& lowest = wound_.nodes[merged_[n]].vertex;
      lowest = std::min(lowest, wound_.nodes[n].vertex);
    }
  }

  std::array<Index, 2> endsOf(Index rim) const {
    return {node_of_vertex_.at(surface_.rim[rim].from), node_of_vertex_.at(surface_.rim[rim].to)};
  }

  Status placeRim() {
    // What is crossed first: at the same place it goes before what is touched.
    std::stable_partition(rim_.begin(), rim_.end(), [&](Index r) { return surface_.rim[r].kind == RimEdge::kCrossed; });
    std::vector<Index> placed;
    for (const Index r : rim_) {
      const auto [a, b] = endsOf(r);
      if (a == b)
        return Error{ErrorCode::kUnsuitableShape,
                     "the surface is finer than " + std::to_string(1e3 * frame_.band) + " mm where the blade meets it"};
      if (surface_.rim[r].kind == RimEdge::kCrossed) {
        if (!rim_of_.emplace(directedKey(a, b), r).second) return pressed();
      } else {
        if (rim_of_.count(directedKey(a, b)) + rim_of_.count(directedKey(b, a)) > 0) continue;
        rim_of_.emplace(directedKey(a, b), r);
        rim_of_.emplace(directedKey(b, a), r);
      }
      placed.push_back(r);
    }
    rim_ = std::move(placed);
    return Done{};
  }

  Status triangulate() {
    std::vector<Kernel::Point_2> points;
    points.reserve(wound_.nodes.size());
    for (const WoundNode& n : wound_.nodes) points.emplace_back(n.place.x(), n.place.y());
    std::vector<std::size_t> order;
    for (std::size_t n = 0; n < points.size(); ++n)
      if (merged_[n] == n) order.push_back(n);
    using PointMap = CGAL::Pointer_property_map<Kernel::Point_2>::type;
    CGAL::spatial_sort(order.begin(), order.end(),
                       CGAL::Spatial_sort_traits_adapter_2<Kernel, PointMap>(CGAL::make_property_map(points)));
    std::vector<Cdt::Vertex_handle> handles(points.size());
    Face hint;
    for (const std::size_t n : order) {
      handles[n] = cdt_.insert(points[n], hint);
      handles[n]->info() = static_cast<Index>(n);
      hint = handles[n]->face();
    }
    try {
      for (const Index r : rim_) cdt_.insert_constraint(handles[endsOf(r)[0]], handles[endsOf(r)[1]]);
    } catch (const Cdt::Intersection_of_constraints_exception&) {
      return pressed();
    }
    // An edge that passes through a node was cut there by the triangulation, but not in the mesh.
    for (const Index r : rim_)
      if (!cdt_.is_edge(handles[endsOf(r)[0]], handles[endsOf(r)[1]])) return pressed();
    if (cdt_.dimension() < 2) return missed();

    // The winding numbers start where rounding cannot reach: in the middle of the largest face.
    double largest = -1.0;
    for (const Face face : cdt_.finite_face_handles()) {
      const Vec2 &a = place(face, 0), &b = place(face, 1), &c = place(face, 2);
      const double area = cross(b - a, c - a);
      if (area > largest) {
        largest = area;
        seed_ = (a + b + c) / 3.0;
      }
    }
    seed_winding_ = windingAt(seed_);
    return Done{};
  }

  const Vec2& place(Face face, int i) const { return wound_.nodes[face->vertex(i)->info()].place; }

  /// The rim edge that bounds `face`, if it is solid, at edge i (opposite vertex i); kNoIndex without one.
  Index rimAt(Face face, int i) const {
    if (!face->is_constrained(i)) return kNoIndex;
    const auto found = rim_of_.find(directedKey(face->vertex(Cdt::ccw(i))->info(), face->vertex(Cdt::cw(i))->info()));
    return found == rim_of_.end() ? kNoIndex : found->second;
  }
  int weightAt(Face face, int i) const {
    const Index r = rimAt(face, i);
    return r != kNoIndex && surface_.rim[r].kind == RimEdge::kCrossed ? 1 : 0;
  }

  /// Winding numbers, and the parts of the solid's section that the rim bounds.
  Status flood() {
    for (const Face face : cdt_.all_face_handles()) face->info() = FaceInfo();
    Face first = cdt_.locate(Kernel::Point_2(seed_.x(), seed_.y()));
    first->info().winding = seed_winding_;
    std::vector<Face> open{first};
    while (!open.empty()) {
      const Face face = open.back();
      open.pop_back();
      if (face->info().winding < 0 || face->info().winding > 1) return pressed();
      for (int i = 0; i < 3; ++i) {
        const Face other = face->neighbor(i);
        if (cdt_.is_infinite(other)) continue;
        const int winding = face->info().winding - weightAt(face, i) + weightAt(other, cdt_.mirror_index(face, i));
        if (other->info().winding == winding) continue;
        if (other->info().winding != kUnreached)
          return Error{ErrorCode::kUnsuitableShape, "the surface is open where the blade meets it"};
        other->info().winding = winding;
        open.push_back(other);
      }
    }
    filled_ = 0;
    any_solid_ = false;
    Index component = 0;
    for (const Face start : cdt_.finite_face_handles()) {
      if (start->info().winding != 1 || start->info().component != kNoIndex) continue;
      any_solid_ = true;
      std::vector<Face> members{start};
      start->info().component = component;
      bool reaches_rim = false;
      for (std::size_t m = 0; m < members.size(); ++m) {
        const Face face = members[m];
        for (int i = 0; i < 3; ++i) {
          if (rimAt(face, i) != kNoIndex) {
            reaches_rim = true;
            continue;
          }
          const Face other = face->neighbor(i);
          if (cdt_.is_infinite(other) || other->info().component != kNoIndex) continue;
          other->info().component = component;
          members.push_back(other);
        }
      }
      ++component;
      if (reaches_rim) {
        filled_ += members.size();
        continue;
      }
      for (const Face face : members) face->info().winding = 0;
    }
    return Done{};
  }

  bool isFilled(Face face) const { return !cdt_.is_infinite(face) && face->info().winding == 1; }

  /// Points on the buried front and inside, at the spacing of the surface.
  void refine() {
    Vec2 low = frame_.high, high = frame_.low;
    double area = 0.0;
    for (const Face face : cdt_.finite_face_handles()) {
      if (!isFilled(face)) continue;
      for (int i = 0; i < 3; ++i) {
        low = low.cwiseMin(place(face, i));
        high = high.cwiseMax(place(face, i));
      }
      area += 0.5 * cross(place(face, 1) - place(face, 0), place(face, 2) - place(face, 0));
    }
    double h = options_.spacing > 0.0 ? options_.spacing : surface_.spacing;
    h = std::max({h, std::sqrt(area / (0.866 * static_cast<double>(std::max<std::size_t>(options_.max_points, 1)))),
                  1e-3 * (high - low).norm()});

    SegmentGrid segments(low, high, h);
    for (const Index r : rim_) segments.add(wound_.nodes[endsOf(r)[0]].place, wound_.nodes[endsOf(r)[1]].place);
    std::vector<std::pair<Vec2, Face>> points;
    for (const Face face : cdt_.finite_face_handles()) {
      if (!isFilled(face)) continue;
      for (int i = 0; i < 3; ++i) {
        if (!cdt_.is_infinite(face->neighbor(i)) || rimAt(face, i) != kNoIndex) continue;
        const Vec2 &a = place(face, Cdt::ccw(i)), &b = place(face, Cdt::cw(i));
        segments.add(a, b);
        const int parts = static_cast<int>(std::lround((b - a).norm() / h));
        for (int k = 1; k < parts; ++k) {
          Vec2 p = a + (b - a) * (static_cast<double>(k) / parts);
          for (int axis = 0; axis < 2; ++axis)
            if (a[axis] == b[axis]) p[axis] = a[axis];  // on the border to the last bit
          points.push_back({p, face});
        }
      }
    }
    if (options_.max_points > 0) {
      const double row = 0.866 * h;
      int line = 0;
      Face hint;
      for (double y = low.y() + 0.5 * row; y < high.y(); y += row, ++line) {
        for (double x = low.x() + (line % 2 ? 0.75 : 0.25) * h; x < high.x(); x += h) {
          const Vec2 p(x, y);
          if (segments.isNear(p, 0.6 * h)) continue;
          hint = cdt_.locate(Kernel::Point_2(x, y), hint);
          if (isFilled(hint)) points.push_back({p, hint});
        }
      }
    }
    // Only now: inserting changes the faces.
    Face hint;
    for (const auto& [p, face] : points) {
      const Cdt::Vertex_handle made = cdt_.insert(Kernel::Point_2(p.x(), p.y()), hint);
      made->info() = static_cast<Index>(wound_.nodes.size());
      wound_.nodes.push_back({p, kNoIndex});
      hint = made->face();
    }
  }

  Result<WoundFaces> extract() {
    struct Ordered {
      std::array<Index, 3> nodes;
      Face face;
      int first;
    };
    std::vector<Ordered> order;
    for (const Face face : cdt_.finite_face_handles()) {
      if (!isFilled(face)) continue;
      std::array<Index, 3> n{face->vertex(0)->info(), face->vertex(1)->info(), face->vertex(2)->info()};
      const int first = static_cast<int>(std::min_element(n.begin(), n.end()) - n.begin());
      order.push_back({{n[first], n[(first + 1) % 3], n[(first + 2) % 3]}, face, first});
    }
    // CGAL settles nodes on one circle by their coordinates: the triangles are always the same, their order need not
    // be.
    std::sort(order.begin(), order.end(), [](const Ordered& a, const Ordered& b) { return a.nodes < b.nodes; });
    for (Index f = 0; f < order.size(); ++f) order[f].face->info().number = f;
    std::unordered_map<Index, Index> component_numbers;
    for (const Ordered& o : order) {
      WoundTriangle face;
      face.nodes = o.nodes;
      const auto [entry, fresh] = component_numbers.try_emplace(o.face->info().component, wound_.components);
      wound_.components += fresh;
      face.component = entry->second;
      for (int k = 0; k < 3; ++k) {
        const int opposite = (o.first + k + 2) % 3;
        face.rim[k] = rimAt(o.face, opposite);
        face.against[k] = face.rim[k] != kNoIndex && endsOf(face.rim[k])[0] != o.nodes[k];
        const Face other = o.face->neighbor(opposite);
        if (face.rim[k] == kNoIndex && isFilled(other)) face.neighbors[k] = other->info().number;
      }
      wound_.triangles.push_back(face);
    }
    return std::move(wound_);
  }

  const SplitSurface& surface_;
  const Frame& frame_;
  const InciseOptions& options_;
  WoundFaces wound_;
  std::vector<Index> merged_;
  std::unordered_map<Index, Index> node_of_vertex_;
  std::vector<Index> rim_;                           // the edges of the rim that count
  std::unordered_map<std::uint64_t, Index> rim_of_;  // from, to node: solid to the left
  Cdt cdt_;
  Vec2 seed_ = Vec2::Zero();
  int seed_winding_ = 0;
  std::size_t filled_ = 0;
  bool any_solid_ = false;
};

}  // namespace

Result<WoundFaces> fillWoundFaces(const SplitSurface& surface, const InciseOptions& options, bool touched) {
  return WoundFiller(surface, options, touched).run();
}

}  // namespace incising
}  // namespace meshless
