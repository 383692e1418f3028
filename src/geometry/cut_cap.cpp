#include "cut_cap.h"

#include <algorithm>
#include <unordered_map>

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>
#include <CGAL/property_map.h>
#include <CGAL/spatial_sort.h>
#include <CGAL/Spatial_sort_traits_adapter_2.h>

namespace meshless {
namespace cutting {
namespace {

struct FaceInfo {
  int winding = 0;
  bool reached = false;
};

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<Index, Kernel>;
using FaceBase = CGAL::Triangulation_face_base_with_info_2<FaceInfo, Kernel,
                                                           CGAL::Constrained_triangulation_face_base_2<Kernel>>;
using Cdt = CGAL::Constrained_Delaunay_triangulation_2<Kernel,
                                                       CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>>;

std::uint64_t pairKey(Index a, Index b) {
  return (static_cast<std::uint64_t>(std::min(a, b)) << 32) | std::max(a, b);
}

/// Weight of the outline along a pair of nodes, signed by the direction asked for.
class Weights {
 public:
  void add(const OutlineSegment& s) { sums_[pairKey(s.from, s.to)] += s.from < s.to ? s.weight : -s.weight; }
  int of(Index from, Index to) const {
    const auto found = sums_.find(pairKey(from, to));
    if (found == sums_.end()) return 0;
    return from < to ? found->second : -found->second;
  }

 private:
  std::unordered_map<std::uint64_t, int> sums_;
};

/// Winding numbers spread from the infinite face. False where two ways to a face disagree.
bool floodWindings(Cdt& cdt, const Weights& weights) {
  std::vector<Cdt::Face_handle> open{cdt.infinite_face()};
  open.front()->info().reached = true;
  while (!open.empty()) {
    const Cdt::Face_handle face = open.back();
    open.pop_back();
    for (int i = 0; i < 3; ++i) {
      const Cdt::Face_handle other = face->neighbor(i);
      int winding = face->info().winding;
      if (face->is_constrained(i))
        winding -= weights.of(face->vertex(Cdt::ccw(i))->info(), face->vertex(Cdt::cw(i))->info());
      if (other->info().reached) {
        if (other->info().winding != winding) return false;
        continue;
      }
      other->info() = {winding, true};
      open.push_back(other);
    }
  }
  return true;
}

}  // namespace

CapState triangulateCap(const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& segments,
                        std::vector<CapTriangle>& cap) {
  cap.clear();
  std::vector<Kernel::Point_2> points;
  points.reserve(nodes.size());
  for (const Vec2& p : nodes) points.emplace_back(p.x(), p.y());
  std::vector<bool> used(nodes.size(), false);
  for (const OutlineSegment& s : segments) used[s.from] = used[s.to] = true;
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    if (used[i]) order.push_back(i);
  using PointMap = CGAL::Pointer_property_map<Kernel::Point_2>::type;
  CGAL::spatial_sort(order.begin(), order.end(),
                     CGAL::Spatial_sort_traits_adapter_2<Kernel, PointMap>(CGAL::make_property_map(points)));

  Cdt cdt;
  std::vector<Cdt::Vertex_handle> handles(nodes.size());
  Cdt::Face_handle hint;
  for (const std::size_t i : order) {
    handles[i] = cdt.insert(points[i], hint);
    handles[i]->info() = static_cast<Index>(i);
    hint = handles[i]->face();
  }
  Weights weights;
  try {
    for (const OutlineSegment& s : segments) {
      weights.add(s);
      cdt.insert_constraint(handles[s.from], handles[s.to]);
    }
  } catch (const Cdt::Intersection_of_constraints_exception&) {
    return CapState::kCrossing;
  }
  // A segment that passes through a node was cut there by the triangulation, but not in the mesh.
  for (const OutlineSegment& s : segments)
    if (!cdt.is_edge(handles[s.from], handles[s.to])) return CapState::kCrossing;
  if (cdt.dimension() < 2) return CapState::kFilled;
  if (!floodWindings(cdt, weights)) return CapState::kUnbalanced;
  for (const Cdt::Face_handle face : cdt.finite_face_handles()) {
    const int winding = face->info().winding;
    if (winding == 0) continue;
    std::array<Index, 3> corners{face->vertex(0)->info(), face->vertex(1)->info(), face->vertex(2)->info()};
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    cap.push_back({corners, winding});
  }
  // CGAL settles nodes on one circle by their coordinates: the triangles are always the same, their order need not be.
  std::sort(cap.begin(), cap.end(), [](const CapTriangle& a, const CapTriangle& b) { return a.nodes < b.nodes; });
  return CapState::kFilled;
}

}  // namespace cutting
}  // namespace meshless
