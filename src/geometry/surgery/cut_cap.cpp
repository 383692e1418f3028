#include "cut_cap.h"

#include <algorithm>

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>

#include "mesh/edge_table.h"

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

/// Every other bit of the result.
std::uint64_t spread(std::uint32_t bits) {
  std::uint64_t x = bits;
  x = (x | (x << 16)) & 0x0000ffff0000ffffu;
  x = (x | (x << 8)) & 0x00ff00ff00ff00ffu;
  x = (x | (x << 4)) & 0x0f0f0f0f0f0f0f0fu;
  x = (x | (x << 2)) & 0x3333333333333333u;
  return (x | (x << 1)) & 0x5555555555555555u;
}

/// Along a Morton curve, so that each point is inserted next to the one before. (CGAL's spatial_sort would take a tenth
/// of a plain cut.)
void sortByPlace(const std::vector<Kernel::Point_2>& points, std::vector<Index>& order) {
  if (order.empty()) return;
  double left = points[order[0]].x(), right = left, low = points[order[0]].y(), high = low;
  for (const Index i : order) {
    left = std::min(left, points[i].x());
    right = std::max(right, points[i].x());
    low = std::min(low, points[i].y());
    high = std::max(high, points[i].y());
  }
  const double extent = std::max(right - left, high - low);
  const double scale = extent > 0.0 ? 65535.0 / extent : 0.0;
  std::vector<std::pair<std::uint64_t, Index>> keyed;
  keyed.reserve(order.size());
  for (const Index i : order) {
    const auto x = static_cast<std::uint32_t>(scale * (points[i].x() - left));
    const auto y = static_cast<std::uint32_t>(scale * (points[i].y() - low));
    keyed.emplace_back(spread(x) | spread(y) << 1, i);
  }
  std::sort(keyed.begin(), keyed.end());
  // In rounds, from coarse to fine: without them a rim that runs round is triangulated by thin fans, again and again.
  std::size_t stride = 1, sorted = 0;
  while (8 * stride < keyed.size()) stride *= 4;
  for (std::size_t k = 0; k < keyed.size(); k += stride) order[sorted++] = keyed[k].second;
  for (; stride > 1; stride /= 4)
    for (std::size_t k = 0; k < keyed.size(); k += stride / 4)
      if (k % stride != 0) order[sorted++] = keyed[k].second;
}

/// What a constrained edge parts, signed by the direction asked for.
struct Border {
  int weight = 0;  // from the lower number to the higher
  bool core = false;
};
using Borders = EdgeTable<Border>;

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
        const Index from = face->vertex(Cdt::ccw(i))->info(), to = face->vertex(Cdt::cw(i))->info();
        const Border& border = borders.of(from, to);
        there.winding -= from < to ? border.weight : -border.weight;
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
  std::vector<Index> order;
  for (Index i = 0; i < points.size(); ++i)
    if (i < first_core ? used[i] : !core.inside[i - first_core]) order.push_back(i);
  sortByPlace(points, order);

  Cdt cdt;
  std::vector<Cdt::Vertex_handle> handles(points.size());
  Cdt::Face_handle hint;
  for (const Index i : order) {
    handles[i] = cdt.insert(points[i], hint);
    handles[i]->info() = i;
    hint = handles[i]->face();
  }
  Borders borders(2 * (segments.size() + core.border.size()), Border());
  try {
    for (const OutlineSegment& s : segments) {
      borders.at(s.from, s.to).weight += s.from < s.to ? s.weight : -s.weight;
      cdt.insert_constraint(handles[s.from], handles[s.to]);
    }
    for (const auto& [from, to] : core.border) {
      borders.at(first_core + from, first_core + to).core = true;
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
