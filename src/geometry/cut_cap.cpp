#include "cut_cap.h"

#include <algorithm>
#include <unordered_map>

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Spatial_sort_traits_adapter_2.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>
#include <CGAL/property_map.h>
#include <CGAL/spatial_sort.h>

#include "split_edges.h"

namespace meshless {
namespace cutting {
namespace {

struct FaceInfo {
  int winding = 0;
  bool reached = false;
  bool in_core = false;
};

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<Index, Kernel>;
using FaceBase =
    CGAL::Triangulation_face_base_with_info_2<FaceInfo, Kernel, CGAL::Constrained_triangulation_face_base_2<Kernel>>;
using Cdt =
    CGAL::Constrained_Delaunay_triangulation_2<Kernel, CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>>;

/// What a constrained edge parts, signed by the direction asked for.
class Borders {
 public:
  struct Border {
    int weight = 0;
    bool core = false;
  };
  explicit Borders(std::size_t most) { borders_.reserve(most); }
  void add(const OutlineSegment& s) { borders_[edgeKey(s.from, s.to)].weight += s.from < s.to ? s.weight : -s.weight; }
  void addCore(Index from, Index to) { borders_[edgeKey(from, to)].core = true; }
  Border of(Index from, Index to) const {
    const auto found = borders_.find(edgeKey(from, to));
    if (found == borders_.end()) return {};
    return {from < to ? found->second.weight : -found->second.weight, found->second.core};
  }

 private:
  std::unordered_map<std::uint64_t, Border> borders_;
};

/// Winding numbers spread from the infinite face. False where two ways to a face disagree, or the core is not where the
/// winding is 1.
bool floodWindings(Cdt& cdt, const Borders& borders) {
  std::vector<Cdt::Face_handle> open{cdt.infinite_face()};
  open.front()->info().reached = true;
  while (!open.empty()) {
    const Cdt::Face_handle face = open.back();
    open.pop_back();
    for (int i = 0; i < 3; ++i) {
      const Cdt::Face_handle other = face->neighbor(i);
      FaceInfo there = face->info();
      if (face->is_constrained(i)) {
        const Borders::Border border = borders.of(face->vertex(Cdt::ccw(i))->info(), face->vertex(Cdt::cw(i))->info());
        there.winding -= border.weight;
        there.in_core ^= border.core;
        if (border.core && there.winding != 1) return false;
      }
      if (other->info().reached) {
        if (other->info().winding != there.winding || other->info().in_core != there.in_core) return false;
        continue;
      }
      other->info() = there;
      open.push_back(other);
    }
  }
  return true;
}

}  // namespace

CapState triangulateCap(const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& segments,
                        const CapCore& core, std::vector<CapTriangle>& cap) {
  cap.clear();
  const Index first_core = static_cast<Index>(nodes.size());
  std::vector<Kernel::Point_2> points;
  points.reserve(nodes.size() + core.places.size());
  for (const Vec2& p : nodes) points.emplace_back(p.x(), p.y());
  for (const Vec2& p : core.places) points.emplace_back(p.x(), p.y());
  std::vector<bool> used(nodes.size(), false);
  for (const OutlineSegment& s : segments) used[s.from] = used[s.to] = true;
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < points.size(); ++i)
    if (i < first_core ? used[i] : !core.inside[i - first_core]) order.push_back(i);
  using PointMap = CGAL::Pointer_property_map<Kernel::Point_2>::type;
  CGAL::spatial_sort(order.begin(), order.end(),
                     CGAL::Spatial_sort_traits_adapter_2<Kernel, PointMap>(CGAL::make_property_map(points)));

  Cdt cdt;
  std::vector<Cdt::Vertex_handle> handles(points.size());
  Cdt::Face_handle hint;
  for (const std::size_t i : order) {
    handles[i] = cdt.insert(points[i], hint);
    handles[i]->info() = static_cast<Index>(i);
    hint = handles[i]->face();
  }
  Borders borders(segments.size() + core.border.size());
  try {
    for (const OutlineSegment& s : segments) {
      borders.add(s);
      cdt.insert_constraint(handles[s.from], handles[s.to]);
    }
    for (const auto& [from, to] : core.border) {
      borders.addCore(first_core + from, first_core + to);
      cdt.insert_constraint(handles[first_core + from], handles[first_core + to]);
    }
  } catch (const Cdt::Intersection_of_constraints_exception&) {
    return CapState::kCrossing;
  }
  // A segment that passes through a node was cut there by the triangulation, but not in the mesh.
  for (const OutlineSegment& s : segments)
    if (!cdt.is_edge(handles[s.from], handles[s.to])) return CapState::kCrossing;
  if (cdt.dimension() < 2) return CapState::kFilled;
  if (!floodWindings(cdt, borders)) return CapState::kUnbalanced;
  for (const Cdt::Face_handle face : cdt.finite_face_handles()) {
    const int winding = face->info().winding;
    if (winding == 0 || face->info().in_core) continue;
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
