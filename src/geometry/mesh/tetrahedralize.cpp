#include "meshless_surgery/geometry/mesh/tetrahedralize.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Regular_triangulation_3.h>
#include <CGAL/Triangulation_vertex_base_with_info_3.h>

#include "meshless_surgery/geometry/query/inside.h"

namespace meshless {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using VertexBase =
    CGAL::Triangulation_vertex_base_with_info_3<Index, Kernel, CGAL::Regular_triangulation_vertex_base_3<Kernel>>;
using CellBase = CGAL::Regular_triangulation_cell_base_3<Kernel>;
using Triangulation = CGAL::Regular_triangulation_3<Kernel, CGAL::Triangulation_data_structure_3<VertexBase, CellBase>>;

constexpr double kFlat = 1e-9;     // of the cubed mean edge
constexpr double kWeight = 1e-10;  // of the squared spacing

/// 0..1, the same for a number on every machine (splitmix64).
double hashed(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return static_cast<double>((x ^ (x >> 31)) >> 11) * 0x1.0p-53;
}

double sixfoldVolume(const Points& points, const Tetrahedron& t) {
  const Vec3& a = points[t[0]];
  return (points[t[1]] - a).cross(points[t[2]] - a).dot(points[t[3]] - a);
}

/// Even permutation with the smallest index first and the next smallest second: one spelling a tetrahedron.
Tetrahedron canonical(Tetrahedron t) {
  const auto swapPairs = [&](int a, int b) {
    std::swap(t[a], t[b]);
    int c = -1, d = -1;
    for (int k = 0; k < 4; ++k)
      if (k != a && k != b) (c < 0 ? c : d) = k;
    std::swap(t[c], t[d]);
  };
  const int lowest = static_cast<int>(std::min_element(t.begin(), t.end()) - t.begin());
  if (lowest != 0) swapPairs(0, lowest);
  const int next = static_cast<int>(std::min_element(t.begin() + 1, t.end()) - t.begin());
  std::rotate(t.begin() + 1, t.begin() + next, t.end());
  return t;
}

/// Cells of the hull, positively oriented and sorted. Points of a lattice lie on common spheres and planes up to
/// rounding, which would leave flat tetrahedra between them. A tiny weight a point, far above rounding and far below
/// any effect on the shape, lets all cells about a face choose the same diagonal.
std::vector<Tetrahedron> cells(const Points& points) {
  std::vector<Tetrahedron> found;
  Box box;
  std::size_t finite = 0;
  for (const Vec3& p : points)
    if (p.allFinite()) {
      box.extend(p);
      ++finite;
    }
  if (finite < 4) return found;
  const Vec3 origin = 0.5 * (box.min + box.max);
  const double spacing = box.diagonal() / std::cbrt(static_cast<double>(finite));
  std::vector<std::pair<Kernel::Weighted_point_3, Index>> weighted;
  weighted.reserve(finite);
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (!points[k].allFinite()) continue;
    const Vec3 p = points[k] - origin;
    weighted.emplace_back(
        Kernel::Weighted_point_3(Kernel::Point_3(p.x(), p.y(), p.z()), kWeight * spacing * spacing * hashed(k)),
        static_cast<Index>(k));
  }
  const Triangulation triangulation(weighted.begin(), weighted.end());
  if (triangulation.dimension() < 3) return found;
  found.reserve(triangulation.number_of_finite_cells());
  double edges = 0.0;
  for (const auto& cell : triangulation.finite_cell_handles()) {
    Tetrahedron t;
    for (int k = 0; k < 4; ++k) t[k] = cell->vertex(k)->info();
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < i; ++j) edges += (points[t[i]] - points[t[j]]).norm();
    found.push_back(canonical(t));
  }
  // Sums depend on the order of the cells in their last digits; that is far below the threshold's own meaning.
  const double mean_edge = edges / (6.0 * static_cast<double>(found.size()));
  const double least = 6.0 * kFlat * mean_edge * mean_edge * mean_edge;
  found.erase(std::remove_if(found.begin(), found.end(),
                             [&](const Tetrahedron& t) { return !(sixfoldVolume(points, t) > least); }),
              found.end());
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace

std::vector<Tetrahedron> tetrahedralize(const Points& points, const SolidQuery& solid) {
  std::vector<Tetrahedron> kept = cells(points);
  kept.erase(std::remove_if(kept.begin(), kept.end(),
                            [&](const Tetrahedron& t) {
                              const Vec3 sum = points[t[0]] + points[t[1]] + points[t[2]] + points[t[3]];
                              return !solid.contains(0.25 * sum);
                            }),
             kept.end());
  return kept;
}

std::vector<Tetrahedron> tetrahedralizeHull(const Points& points) { return cells(points); }

std::vector<Triangle> boundaryFaces(const std::vector<Tetrahedron>& tetrahedra) {
  // Face k leaves out corner k; seen from outside a positive tetrahedron these turn counter-clockwise.
  constexpr int kFaces[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
  struct Face {
    Triangle sorted, turned;
  };
  std::vector<Face> faces;
  faces.reserve(4 * tetrahedra.size());
  for (const Tetrahedron& t : tetrahedra)
    for (const auto& f : kFaces) {
      Face face;
      face.turned = {t[f[0]], t[f[1]], t[f[2]]};
      std::rotate(face.turned.begin(), std::min_element(face.turned.begin(), face.turned.end()), face.turned.end());
      face.sorted = face.turned;
      std::sort(face.sorted.begin(), face.sorted.end());
      faces.push_back(face);
    }
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) {
    return a.sorted != b.sorted ? a.sorted < b.sorted : a.turned < b.turned;
  });
  std::vector<Triangle> boundary;
  for (std::size_t k = 0; k < faces.size();) {
    std::size_t end = k + 1;
    while (end < faces.size() && faces[end].sorted == faces[k].sorted) ++end;
    if (end - k == 1) boundary.push_back(faces[k].turned);
    k = end;
  }
  return boundary;
}

std::vector<std::array<Index, 2>> tetrahedronEdges(const std::vector<Tetrahedron>& tetrahedra) {
  std::vector<std::array<Index, 2>> edges;
  edges.reserve(6 * tetrahedra.size());
  for (const Tetrahedron& t : tetrahedra)
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < i; ++j) edges.push_back({std::min(t[i], t[j]), std::max(t[i], t[j])});
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

}  // namespace meshless
