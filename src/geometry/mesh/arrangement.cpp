#include "arrangement.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <tuple>
#include <utility>

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Constrained_triangulation_plus_2.h>
#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>
#include <CGAL/intersections.h>

#include "crossings.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/query/union_find.h"

namespace meshless {
namespace {

using ExactKernel = CGAL::Exact_predicates_exact_constructions_kernel;
using ExactPoint = ExactKernel::Point_3;
using ExactTriangle = ExactKernel::Triangle_3;
using FlatPoint = ExactKernel::Point_2;
using FlatVertex = CGAL::Triangulation_vertex_base_with_info_2<Index, ExactKernel>;
using FlatFace = CGAL::Constrained_triangulation_face_base_2<ExactKernel>;
using Flat = CGAL::Constrained_triangulation_plus_2<CGAL::Constrained_Delaunay_triangulation_2<
    ExactKernel, CGAL::Triangulation_data_structure_2<FlatVertex, FlatFace>, CGAL::Exact_intersections_tag>>;

struct ByPlace {
  bool operator()(const ExactPoint& a, const ExactPoint& b) const { return CGAL::compare_xyz(a, b) == CGAL::SMALLER; }
};

/// The front of a facet and its back are numbered 2 f and 2 f + 1.
Index front(Index facet) { return 2 * facet; }
Index back(Index facet) { return 2 * facet + 1; }

class Arranging {
 public:
  Arranging(const Points& vertices, const std::vector<Triangle>& triangles) : input_(triangles) {
    made_.vertices = vertices;
  }

  Arrangement run() {
    findCrossings();
    for (Index t = 0; t < input_.size(); ++t) {
      if (!meets_[t])
        addFacet(input_[t], t);
      else if (planes_.find(t) == t)
        divide(t);
    }
    sortAroundEdges();
    joinSides();
    return std::move(made_);
  }

 private:
  static Triangle sorted(Triangle t) {
    std::sort(t.begin(), t.end());
    return t;
  }

  ExactPoint exact(Index v) const {
    const auto found = constructed_.find(v);
    if (found != constructed_.end()) return found->second;
    const Vec3& p = made_.vertices[v];
    return {p.x(), p.y(), p.z()};
  }

  ExactTriangle exactTriangle(Index t) const { return {exact(input_[t][0]), exact(input_[t][1]), exact(input_[t][2])}; }

  /// The vertex at that place, a new one where there is none.
  Index vertexAt(const ExactPoint& p) {
    const auto [at, is_new] = vertex_at_.emplace(p, static_cast<Index>(made_.vertices.size()));
    if (is_new) {
      const auto& known = CGAL::exact(p);
      made_.vertices.emplace_back(CGAL::to_double(known.x()), CGAL::to_double(known.y()), CGAL::to_double(known.z()));
      constructed_.emplace(at->second, p);
    }
    return at->second;
  }

  void findCrossings() {
    forEachCrossing(made_.vertices, input_, [&](Index a, Index b) {
      made_.crossings.push_back({std::min(a, b), std::max(a, b)});
    });
    std::sort(made_.crossings.begin(), made_.crossings.end());
    meets_.assign(input_.size(), false);
    planes_.reset(input_.size());
    for (const auto& pair : made_.crossings)
      for (const Index t : pair) {
        if (!meets_[t])
          for (const Index v : input_[t]) vertex_at_.emplace(exact(v), v);
        meets_[t] = true;
      }
    std::map<Triangle, Index> same;
    for (Index t = 0; t < input_.size(); ++t)
      if (meets_[t]) planes_.join(same.emplace(sorted(input_[t]), t).first->second, t);
    for (const auto& [a, b] : made_.crossings) {
      const auto common = CGAL::intersection(exactTriangle(a), exactTriangle(b));
      if (!common) continue;
      if (const ExactPoint* p = boost::get<ExactPoint>(&*common)) {
        addMeeting(a, b, {vertexAt(*p)});
      } else if (const ExactKernel::Segment_3* s = boost::get<ExactKernel::Segment_3>(&*common)) {
        addMeeting(a, b, {vertexAt(s->source()), vertexAt(s->target())});
      } else {
        planes_.join(a, b);
      }
    }
    for (Index t = 0; t < input_.size(); ++t)
      if (meets_[t]) in_plane_[planes_.find(t)].push_back(t);
  }

  void addMeeting(Index a, Index b, const std::vector<Index>& ends) {
    for (const Index t : {a, b}) meetings_[t].push_back(ends);
  }

  /// The triangles that lie on each other with the one of that number, along each other's edges and along all that they
  /// meet.
  void divide(Index first) {
    const std::vector<Index>& members = in_plane_[first];
    const ExactTriangle triangle = exactTriangle(first);
    const auto normal = triangle.supporting_plane().orthogonal_vector();
    int axis = 0;
    for (int k = 1; k < 3; ++k)
      if (CGAL::abs(normal[k]) > CGAL::abs(normal[axis])) axis = k;
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const auto flat = [&](const ExactPoint& p) { return FlatPoint(p[u], p[v]); };
    const ExactPoint origin = triangle.vertex(0);
    Flat plan;
    std::map<Index, Flat::Vertex_handle> handles;
    const auto handleOf = [&](Index vertex) {
      Flat::Vertex_handle& handle = handles[vertex];
      if (handle == Flat::Vertex_handle()) {
        handle = plan.insert(flat(exact(vertex)));
        handle->info() = vertex;
      }
      return handle;
    };
    // Points that crossing lines add have no number yet.
    const auto draw = [&](Index from, Index to) { plan.insert_constraint(handleOf(from), handleOf(to)); };
    for (const Index t : members)
      for (const Index corner : input_[t]) handleOf(corner);
    for (const Index t : members)
      for (const std::vector<Index>& ends : meetings_[t])
        for (const Index end : ends) handleOf(end);
    const std::size_t numbered = plan.number_of_vertices();
    for (const Index t : members) {
      for (int k = 0; k < 3; ++k) draw(input_[t][k], input_[t][(k + 1) % 3]);
      for (const std::vector<Index>& ends : meetings_[t])
        if (ends.size() == 2 && ends[0] != ends[1]) draw(ends[0], ends[1]);
    }
    if (plan.number_of_vertices() > numbered) {
      std::map<Flat::Vertex_handle, bool> known;
      for (const auto& [vertex, handle] : handles) known[handle] = true;
      for (const Flat::Vertex_handle vertex : plan.finite_vertex_handles()) {
        if (known.count(vertex)) continue;
        ExactKernel::FT at[3];
        at[u] = vertex->point().x();
        at[v] = vertex->point().y();
        at[axis] = origin[axis] - (normal[u] * (at[u] - origin[u]) + normal[v] * (at[v] - origin[v])) / normal[axis];
        vertex->info() = vertexAt(ExactPoint(at[0], at[1], at[2]));
      }
    }
    for (const Index t : members) {
      const FlatPoint a = flat(exact(input_[t][0])), b = flat(exact(input_[t][1])), c = flat(exact(input_[t][2]));
      const bool turned = CGAL::orientation(a, b, c) == CGAL::RIGHT_TURN;
      for (const Flat::Face_handle face : plan.finite_face_handles()) {
        if (members.size() > 1) {
          const FlatPoint middle =
              CGAL::centroid(face->vertex(0)->point(), face->vertex(1)->point(), face->vertex(2)->point());
          const auto outside = turned ? CGAL::LEFT_TURN : CGAL::RIGHT_TURN;
          if (CGAL::orientation(a, b, middle) == outside || CGAL::orientation(b, c, middle) == outside ||
              CGAL::orientation(c, a, middle) == outside)
            continue;
        }
        Triangle corners;
        for (int k = 0; k < 3; ++k) corners[k] = face->vertex(k)->info();
        if (turned) std::swap(corners[1], corners[2]);
        addFacet(corners, t);
      }
    }
  }

  void addFacet(const Triangle& corners, Index triangle) {
    const auto [at, is_new] = facet_at_.emplace(sorted(corners), static_cast<Index>(made_.facets.size()));
    if (is_new) {
      made_.facets.push_back(corners);
      made_.uses.emplace_back();
    }
    const Triangle& facet = made_.facets[at->second];
    int k = 0;
    while (facet[k] != corners[0]) ++k;
    made_.uses[at->second].push_back({triangle, facet[(k + 1) % 3] == corners[1]});
  }

  bool runsUp(const Triangle& facet, Index low, Index high) const {
    for (int k = 0; k < 3; ++k)
      if (facet[k] == low) return facet[(k + 1) % 3] == high;
    return false;
  }

  /// The side of a facet that is met when one goes around the edge against the clock.
  Index sideAfter(Index facet, Index low, Index high) const {
    return runsUp(made_.facets[facet], low, high) ? front(facet) : back(facet);
  }

  void sortAroundEdges() {
    struct Side {
      Index low, high, facet;
      bool operator<(const Side& o) const {
        return std::make_tuple(low, high, facet) < std::make_tuple(o.low, o.high, o.facet);
      }
    };
    std::vector<Side> sides;
    for (Index f = 0; f < made_.facets.size(); ++f)
      for (int k = 0; k < 3; ++k) {
        const Index a = made_.facets[f][k], b = made_.facets[f][(k + 1) % 3];
        sides.push_back({std::min(a, b), std::max(a, b), f});
      }
    std::sort(sides.begin(), sides.end());
    for (const Side& side : sides) {
      if (made_.edges.empty() || made_.edges.back().low != side.low || made_.edges.back().high != side.high)
        made_.edges.push_back({side.low, side.high, {}});
      made_.edges.back().spokes.push_back({side.facet, kNoIndex});
    }
    for (Arrangement::Edge& edge : made_.edges)
      if (edge.spokes.size() > 2) sortSpokes(edge);
  }

  void sortSpokes(Arrangement::Edge& edge) const {
    struct Ray {
      ExactPoint tip;
      int quarter;  // 0 below half a turn from the first, 1 opposite to it, 2 beyond
      Index facet;
    };
    const ExactPoint low = exact(edge.low), high = exact(edge.high);
    std::vector<Ray> rays;
    for (const auto& spoke : edge.spokes) {
      const Triangle& t = made_.facets[spoke.facet];
      const Index tip = t[0] != edge.low && t[0] != edge.high   ? t[0]
                        : t[1] != edge.low && t[1] != edge.high ? t[1]
                                                                : t[2];
      rays.push_back({exact(tip), 0, spoke.facet});
    }
    for (std::size_t k = 1; k < rays.size(); ++k) {
      const auto side = CGAL::orientation(low, high, rays[0].tip, rays[k].tip);
      rays[k].quarter = side == CGAL::POSITIVE ? 0 : side == CGAL::NEGATIVE ? 2 : 1;
    }
    std::sort(rays.begin() + 1, rays.end(), [&](const Ray& a, const Ray& b) {
      if (a.quarter != b.quarter) return a.quarter < b.quarter;
      return CGAL::orientation(low, high, a.tip, b.tip) == CGAL::POSITIVE;
    });
    for (std::size_t k = 0; k < rays.size(); ++k) edge.spokes[k].facet = rays[k].facet;
  }

  void joinSides() {
    const Index facets = static_cast<Index>(made_.facets.size());
    UnionFind sides(2 * facets), pieces(facets);
    for (const Arrangement::Edge& edge : made_.edges)
      for (std::size_t k = 0; k < edge.spokes.size(); ++k) {
        const Index here = edge.spokes[k].facet, next = edge.spokes[(k + 1) % edge.spokes.size()].facet;
        sides.join(sideAfter(here, edge.low, edge.high), sideAfter(next, edge.low, edge.high) ^ 1u);
        pieces.join(here, next);
      }
    const std::vector<Index> shell_of = sides.flatten();
    nest(sides, shell_of, pieces);
    std::map<Index, Index> number;
    if (outer_ != kNoIndex) number[sides.find(outer_)] = Arrangement::kOutside;
    made_.volumes.assign(1, 0.0);
    made_.cells.resize(facets);
    for (Index f = 0; f < facets; ++f)
      for (const Index side : {front(f), back(f)}) {
        const auto [at, is_new] = number.emplace(sides.find(side), static_cast<Index>(made_.volumes.size()));
        if (is_new) made_.volumes.push_back(0.0);
        made_.cells[f][side & 1u] = at->second;
        if (at->second != Arrangement::kOutside) made_.volumes[at->second] += side & 1u ? volume_[f] : -volume_[f];
      }
    for (Arrangement::Edge& edge : made_.edges)
      for (auto& spoke : edge.spokes)
        spoke.cell_after = made_.cells[spoke.facet][sideAfter(spoke.facet, edge.low, edge.high) & 1u];
  }

  /// Joins the outer side of each piece that hangs together by edges with the cell of the others that it lies in.
  void nest(UnionFind& sides, const std::vector<Index>& shell_of, UnionFind& pieces) {
    struct Shell {
      std::vector<Index> sides;
      double volume = 0.0;  // [m^3] of what it encloses
      Box box;
      std::unique_ptr<SolidQuery> query;
    };
    struct Piece {
      std::vector<Index> shells;
      Index outer = kNoIndex, largest = kNoIndex;  // shell; facet
      double area = -1.0;
      Box box;
    };
    const Vec3 middle = 0.5 * (boundsOf(made_.vertices).min + boundsOf(made_.vertices).max);
    std::map<Index, Shell> shells;  // by their first side
    std::map<Index, Piece> all;
    for (Index f = 0; f < made_.facets.size(); ++f) {
      const auto& [a, b, c] = made_.facets[f];
      const Vec3 p = made_.vertices[a] - middle, q = made_.vertices[b] - middle, r = made_.vertices[c] - middle;
      volume_.push_back(p.dot(q.cross(r)) / 6.0);
      Piece& piece = all[pieces.find(f)];
      const double area = (q - p).cross(r - p).norm();
      if (area > piece.area) {
        piece.area = area;
        piece.largest = f;
      }
      for (const Index side : {front(f), back(f)}) {
        Shell& shell = shells[shell_of[side]];
        if (shell.sides.empty()) piece.shells.push_back(shell_of[side]);
        shell.sides.push_back(side);
        shell.volume += side & 1u ? volume_[f] : -volume_[f];
        for (const Index v : {a, b, c}) shell.box.extend(made_.vertices[v]);
      }
      for (const Index v : {a, b, c}) piece.box.extend(made_.vertices[v]);
    }
    // Around a piece lies minus the sum of what its other shells enclose.
    for (auto& [root, piece] : all)
      piece.outer = *std::min_element(piece.shells.begin(), piece.shells.end(),
                                      [&](Index a, Index b) { return shells[a].volume < shells[b].volume; });
    const auto holds = [&](Shell& shell, const Vec3& p) {
      if (!shell.box.contains(p)) return false;
      if (!shell.query) {
        TriangleMesh mesh;
        mesh.vertices = made_.vertices;
        for (const Index side : shell.sides) {
          Triangle t = made_.facets[side / 2];
          if (!(side & 1u)) std::swap(t[1], t[2]);
          mesh.triangles.push_back(t);
        }
        shell.query = std::make_unique<SolidQuery>(mesh);
      }
      return shell.query->contains(p);
    };
    for (auto& [root, piece] : all) {
      const Triangle& t = made_.facets[piece.largest];
      const Vec3 p = (made_.vertices[t[0]] + made_.vertices[t[1]] + made_.vertices[t[2]]) / 3.0;
      Index holder = kNoIndex;
      for (auto& [other_root, other] : all) {
        if (other_root == root || !other.box.contains(piece.box.min) || !other.box.contains(piece.box.max)) continue;
        for (const Index s : other.shells)
          if (s != other.outer && (holder == kNoIndex || shells[s].volume < shells[holder].volume) &&
              holds(shells[s], p))
            holder = s;
      }
      if (holder != kNoIndex) {
        sides.join(piece.outer, holder);
      } else {
        if (outer_ != kNoIndex) sides.join(piece.outer, outer_);
        outer_ = piece.outer;
      }
    }
  }

  const std::vector<Triangle>& input_;
  Arrangement made_;
  std::map<ExactPoint, Index, ByPlace> vertex_at_;  // of what meets something
  std::map<Index, ExactPoint> constructed_;
  std::vector<char> meets_;
  UnionFind planes_;  // triangles that lie on each other
  std::map<Index, std::vector<Index>> in_plane_;
  std::map<Index, std::vector<std::vector<Index>>> meetings_;  // of a triangle: in points, or from one to another
  std::map<Triangle, Index> facet_at_;
  std::vector<double> volume_;  // of each facet's tetrahedron [m^3]
  Index outer_ = kNoIndex;      // a side that looks at the outside
};

}  // namespace

Arrangement arrange(const Points& vertices, const std::vector<Triangle>& triangles) {
  return Arranging(vertices, triangles).run();
}

}  // namespace meshless
