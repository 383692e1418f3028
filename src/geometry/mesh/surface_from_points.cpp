#include "meshless_surgery/geometry/mesh/surface_from_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <random>
#include <unordered_map>
#include <utility>

#include <Eigen/Eigenvalues>

#include <CGAL/Advancing_front_surface_reconstruction.h>
#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/compute_average_spacing.h>
#include <CGAL/version.h>
#if CGAL_VERSION_NR >= 1050500000
#include <CGAL/Surface_mesh.h>
#include <CGAL/alpha_wrap_3.h>
#endif

#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"

namespace meshless {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;

constexpr double kFlat = 1e-6;     // thickness over width of a cloud that is called coplanar
constexpr double kCrumb = 0.01;    // components below this part of the volume are dropped
constexpr double kFarthest = 3.0;  // spacings that a point may be off the surface

std::vector<Kernel::Point_3> toCgal(const Points& points) {
  std::vector<Kernel::Point_3> converted;
  converted.reserve(points.size());
  for (const Vec3& p : points) converted.emplace_back(p.x(), p.y(), p.z());
  return converted;
}

Error refuse(const std::string& why) { return {ErrorCode::kUnsuitableShape, why}; }

/// Each position once, in the order of their first mention.
Points unique(const Points& cloud) {
  std::vector<std::size_t> order(cloud.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  const auto less = [&](std::size_t a, std::size_t b) {
    for (int d = 0; d < 3; ++d)
      if (cloud[a][d] != cloud[b][d]) return cloud[a][d] < cloud[b][d];
    return a < b;
  };
  std::sort(order.begin(), order.end(), less);
  std::vector<char> first(cloud.size(), 0);
  for (std::size_t k = 0; k < order.size(); ++k) first[order[k]] = k == 0 || cloud[order[k]] != cloud[order[k - 1]];
  Points kept;
  for (std::size_t k = 0; k < cloud.size(); ++k)
    if (first[k]) kept.push_back(cloud[k]);
  return kept;
}

/// Thickness over width: the square root of the ratio of the covariance's smallest and largest eigenvalue.
double flatness(const Points& points) {
  Vec3 mean = Vec3::Zero();
  for (const Vec3& p : points) mean += p / static_cast<double>(points.size());
  Mat3 covariance = Mat3::Zero();
  for (const Vec3& p : points) covariance += (p - mean) * (p - mean).transpose();
  const Vec3 values = Eigen::SelfAdjointEigenSolver<Mat3>(covariance, Eigen::EigenvaluesOnly).eigenvalues();
  return values[2] > 0.0 ? std::sqrt(std::max(values[0], 0.0) / values[2]) : 0.0;
}

/// One point for each occupied cell of a cubic grid: the mean of those in it.
Points averaged(const Points& points, double cell) {
  const Vec3 origin = boundsOf(points).min;
  std::map<std::array<std::int64_t, 3>, std::pair<Vec3, int>> cells;
  for (const Vec3& p : points) {
    std::array<std::int64_t, 3> key;
    for (int d = 0; d < 3; ++d) key[d] = static_cast<std::int64_t>(std::floor((p[d] - origin[d]) / cell));
    auto& sum = cells.emplace(key, std::make_pair(Vec3(Vec3::Zero()), 0)).first->second;
    sum.first += p;
    ++sum.second;
  }
  Points means;
  means.reserve(cells.size());
  for (const auto& entry : cells) means.push_back(entry.second.first / entry.second.second);
  return means;
}

/// Drops what encloses next to nothing: four points beside the surface that found each other.
TriangleMesh withoutCrumbs(const TriangleMesh& mesh) {
  std::vector<Index> root(mesh.vertices.size());
  for (Index v = 0; v < root.size(); ++v) root[v] = v;
  const auto find = [&](Index v) {
    while (root[v] != v) v = root[v] = root[root[v]];
    return v;
  };
  for (const Triangle& t : mesh.triangles)
    for (int k = 1; k < 3; ++k) {
      const Index a = find(t[0]), b = find(t[k]);
      root[std::max(a, b)] = std::min(a, b);
    }
  std::map<Index, std::vector<Triangle>> parts;
  for (const Triangle& t : mesh.triangles) parts[find(t[0])].push_back(t);
  double largest = 0.0;
  for (const auto& part : parts) largest = std::max(largest, std::abs(signedVolume(mesh.vertices, part.second)));
  TriangleMesh kept;
  kept.vertices = mesh.vertices;
  for (const auto& part : parts)
    if (std::abs(signedVolume(mesh.vertices, part.second)) >= kCrumb * largest)
      kept.triangles.insert(kept.triangles.end(), part.second.begin(), part.second.end());
  return kept;
}

/// One spelling for a set of triangles, whichever way they face.
void sort(std::vector<Triangle>& triangles) {
  for (Triangle& t : triangles) std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  std::sort(triangles.begin(), triangles.end(), [](Triangle a, Triangle b) {
    std::sort(a.begin(), a.end());
    std::sort(b.begin(), b.end());
    return a < b;
  });
}

/// Numbers cells or vertices as they are made: CGAL then compares their handles by these stamps. Without them it
/// compares addresses, which decide from which side it looks at a facet and so turn results over from run to run.
template <class Base>
class Stamped : public Base {
 public:
  template <class Tds>
  struct Rebind_TDS {
    using Other = Stamped<typename Base::template Rebind_TDS<Tds>::Other>;
  };
  using Has_timestamp = CGAL::Tag_true;
  using Base::Base;
  Stamped() = default;
  Stamped(const Stamped& other) : Base(other) {}  // a copy is another one, so it gets a stamp of its own
  Stamped& operator=(const Stamped&) = delete;

  std::size_t time_stamp() const { return stamp_; }
  void set_time_stamp(const std::size_t& stamp) { stamp_ = stamp; }

 private:
  std::size_t stamp_ = static_cast<std::size_t>(-1);  // CGAL's value for none yet
};

/// Numbers for the front's border edges, in the order in which this thread's reconstruction first queues them.
class BorderNumbers {
 public:
  static std::size_t of(const void* border_edge) {
    return numbers().emplace(border_edge, numbers().size()).first->second;
  }
  static void clear() { numbers().clear(); }

 private:
  static std::unordered_map<const void*, std::size_t>& numbers() {
    static thread_local std::unordered_map<const void*, std::size_t> numbers;  // looked up, never walked through
    return numbers;
  }
};

/// The two edges that see the same facet next to them are equal candidates. CGAL's queue takes the one with the lower
/// address first; this vertex makes it take the one that was queued first.
template <class Traits, class Base = CGAL::Triangulation_vertex_base_3<Traits>>
class FrontVertex : public CGAL::Advancing_front_surface_reconstruction_vertex_base_3<Traits, Base> {
  using Parent = CGAL::Advancing_front_surface_reconstruction_vertex_base_3<Traits, Base>;

 public:
  template <class Tds>
  struct Rebind_TDS {
    using Other = FrontVertex<Traits, typename Base::template Rebind_TDS<Tds>::Other>;
  };
  using Parent::Parent;

  struct Radius_ptr_type {
    typename Parent::criteria first;
    typename Parent::IO_edge_type* second;
    std::size_t number;

    Radius_ptr_type(typename Parent::criteria value, typename Parent::IO_edge_type* candidate)
        : first(value), second(candidate), number(BorderNumbers::of(candidate)) {}
    bool operator<(const Radius_ptr_type& o) const { return first != o.first ? first < o.first : number < o.number; }
  };
};

std::vector<Triangle> frontTriangles(const Points& points) {
  using Vertex = Stamped<FrontVertex<Kernel>>;
  using Cell = Stamped<CGAL::Advancing_front_surface_reconstruction_cell_base_3<Kernel>>;
  using Delaunay = CGAL::Delaunay_triangulation_3<Kernel, CGAL::Triangulation_data_structure_3<Vertex, Cell>>;
  std::vector<std::pair<Kernel::Point_3, std::size_t>> numbered;
  numbered.reserve(points.size());
  // Grids are full of equal candidates: a shift far below their spacing, the same in every run, tells them apart.
  const double shift = 1e-4 * boundsOf(points).diagonal() / std::sqrt(static_cast<double>(points.size()));
  std::mt19937 random(1);
  const auto shifted = [&](double x) { return x + shift * (static_cast<double>(random()) / 4294967296.0 - 0.5); };
  for (const Vec3& p : points) {
    const double x = shifted(p.x()), y = shifted(p.y()), z = shifted(p.z());
    numbered.emplace_back(Kernel::Point_3(x, y, z), numbered.size());
  }
  Delaunay delaunay(numbered.begin(), numbered.end());
  CGAL::Advancing_front_surface_reconstruction<Delaunay> front(delaunay);
  BorderNumbers::clear();
  front.run();
  BorderNumbers::clear();
  std::vector<std::array<std::size_t, 3>> faces;
  CGAL::write_triple_indices(std::back_inserter(faces), front);
  std::vector<Triangle> triangles;
  for (const auto& f : faces)
    triangles.push_back({static_cast<Index>(f[0]), static_cast<Index>(f[1]), static_cast<Index>(f[2])});
  // Their order and side come from addresses too.
  if (signedVolume(points, triangles) < 0.0)
    for (Triangle& t : triangles) std::swap(t[1], t[2]);
  sort(triangles);
  return triangles;
}

/// Cohen-Steiner and Da 2004; small holes are closed. Empty where the result is no embedded solid.
TriangleMesh advancingFront(const Points& points) {
  if (points.size() < 4 || !(flatness(points) > kFlat)) return {};
  const TriangleMesh mesh = {points, frontTriangles(points), {}};
  Result<RepairedMesh> repaired = repairMesh(withoutCrumbs(mesh));
  if (!repaired.ok() || !repaired->solid || repaired->self_intersecting) return {};
  sort(repaired->mesh.triangles);
  return std::move(repaired->mesh);
}

#if CGAL_VERSION_NR >= 1050500000
TriangleMesh wrapped(const std::vector<Kernel::Point_3>& points, double alpha, double offset) {
  CGAL::Surface_mesh<Kernel::Point_3> surface;
  CGAL::alpha_wrap_3(points, alpha, offset, surface);
  TriangleMesh mesh;
  for (const auto v : surface.vertices()) {
    const Kernel::Point_3& p = surface.point(v);
    mesh.vertices.emplace_back(p.x(), p.y(), p.z());
  }
  for (const auto f : surface.faces()) {
    Triangle t;
    int k = 0;
    for (const auto v : CGAL::vertices_around_face(surface.halfedge(f), surface))
      t[k++] = static_cast<Index>(static_cast<std::size_t>(v));
    mesh.triangles.push_back(t);
  }
  return mesh;
}

/// Portaneri et al. 2022. A ball of radius alpha that fits between the samples leaks in and leaves a thin shell: alpha
/// is doubled until that adds little volume.
TriangleMesh wrap(const Points& points, double spacing) {
  const std::vector<Kernel::Point_3> converted = toCgal(points);
  const double offset = 0.15 * spacing, largest = boundsOf(points).diagonal();
  double alpha = 2.5 * spacing;
  TriangleMesh mesh = wrapped(converted, alpha, offset);
  for (alpha *= 2.0; alpha < largest; alpha *= 2.0) {
    TriangleMesh wider = wrapped(converted, alpha, offset);
    if (signedVolume(mesh) > 0.7 * signedVolume(wider)) break;
    mesh = std::move(wider);
  }
  Result<RepairedMesh> repaired = repairMesh(withoutCrumbs(mesh));
  if (!repaired.ok() || !repaired->solid) return {};
  return std::move(repaired->mesh);
}
#endif

void measure(const Points& cloud, SurfaceFromPoints& surface) {
  const SolidQuery query(surface.mesh);
  surface.max_distance = surface.mean_distance = 0.0;
  for (const Vec3& p : cloud) {
    const double distance = query.distance(p);
    surface.max_distance = std::max(surface.max_distance, distance);
    surface.mean_distance += distance / static_cast<double>(cloud.size());
  }
}

}  // namespace

Result<SurfaceFromPoints> surfaceFromPoints(const Points& cloud) {
  for (std::size_t k = 0; k < cloud.size(); ++k)
    if (!cloud[k].allFinite())
      return refuse("point " + std::to_string(k) + " is not finite; every coordinate must be a finite number");
  const Points points = unique(cloud);
  if (points.size() < 4)
    return refuse("the cloud has " + std::to_string(points.size()) +
                  " different points; a closed surface needs at least 4");
  const double flat = flatness(points);
  if (!(flat > kFlat))
    return refuse("the points lie in a plane (thickness over width " + std::to_string(flat) +
                  ", at least 0.000001 is needed); they enclose nothing");

  const unsigned neighbours = static_cast<unsigned>(std::min<std::size_t>(6, points.size() - 1));
  const std::vector<Kernel::Point_3> converted = toCgal(points);
  const double spacing = CGAL::compute_average_spacing<CGAL::Sequential_tag>(converted, neighbours);
  SurfaceFromPoints surface;
  for (const double cell : {0.0, 1.5, 2.0, 2.5, 3.0, 4.0}) {  // spacings; beyond, details of the shape go first
    surface.mesh = advancingFront(cell > 0.0 ? averaged(points, cell * spacing) : points);
    if (surface.mesh.empty()) continue;
    measure(points, surface);
    if (!(surface.max_distance <= std::max(kFarthest, cell) * spacing)) continue;
    surface.method = "advancing front through the points";
    if (cell > 0.0)
      surface.method = "advancing front through their means in cells of " + std::to_string(cell * spacing) + " m";
    return surface;
  }
#if CGAL_VERSION_NR >= 1050500000
  surface.mesh = wrap(points, spacing);
  if (!surface.mesh.empty()) {
    measure(points, surface);
    surface.method = "alpha wrapping";
    return surface;
  }
  return refuse("no closed surface was found through the " + std::to_string(points.size()) + " points");
#else
  return refuse("no closed surface was found through the " + std::to_string(points.size()) +
                " points by the advancing front; wrapping them needs CGAL 5.5 or newer");
#endif
}

}  // namespace meshless
