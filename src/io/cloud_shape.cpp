#include "meshless_surgery/io/cloud_shape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <sstream>
#include <utility>

#include <pcl/filters/statistical_outlier_removal.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/kdtree/kdtree_flann.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include "meshless_surgery/base/number_text.h"
#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;

constexpr std::size_t kMostRaw = 2000000;
constexpr std::size_t kMostLeft = 50000;  // points: several seconds of reconstruction
constexpr double kSmallest = 1e-3;        // [m] of the bounds' diagonal
constexpr double kLargest = 10.0;
constexpr double kCells = 60.0;        // along the diagonal, where no voxel is given
constexpr double kMostCells = 1000.0;  // along it, whatever is given: PCL counts cells in 32 bits
constexpr int kNeighbours = 16;
constexpr double kLink = 1.5;  // cell of a part, in distances to the 16th neighbour: parts are one to two cells apart
constexpr double kLeastPart = 0.05;   // of the largest part's points; groups with fewer are strays
constexpr std::size_t kAsked = 2000;  // points whose neighbours are looked up
constexpr double kOnIt = 1e-9;        // of the bounds' diagonal: a rounding
constexpr double kFar = 1e6;          // [m] from the middle: no unit of length makes that a body

Error refuse(const std::string& why) { return {ErrorCode::kUnsuitableShape, why}; }

/// The middle along each axis by rank: strays do not move it.
Vec3 medianOf(const Points& points) {
  Vec3 middle;
  std::vector<double> along(points.size());
  for (int d = 0; d < 3; ++d) {
    for (std::size_t k = 0; k < points.size(); ++k) along[k] = points[k][d];
    std::nth_element(along.begin(), along.begin() + along.size() / 2, along.end());
    middle[d] = along[along.size() / 2];
  }
  return middle;
}

/// The distance to the 16th neighbour that three quarters of the points stay below.
double neighbourDistance(const Points& points, const Vec3& middle) {
  Cloud::Ptr cloud(new Cloud);
  for (const Vec3& p : points) {
    const Eigen::Vector3f q = (p - middle).cast<float>();
    cloud->emplace_back(q.x(), q.y(), q.z());
  }
  pcl::KdTreeFLANN<pcl::PointXYZ> tree;
  tree.setInputCloud(cloud);
  std::vector<float> distances, squares(kNeighbours + 1);
  std::vector<int> indices(kNeighbours + 1);
  const std::size_t every = 1 + points.size() / kAsked;
  for (std::size_t k = 0; k < points.size(); k += every) {
    tree.nearestKSearch((*cloud)[k], kNeighbours + 1, indices, squares);
    distances.push_back(std::sqrt(squares[kNeighbours]));
  }
  const auto at = distances.begin() + static_cast<std::ptrdiff_t>(3 * distances.size() / 4);
  std::nth_element(distances.begin(), at, distances.end());
  return *at;
}

}  // namespace

Points withoutStrays(const Points& cloud, std::vector<std::string>& notes) {
  if (cloud.size() <= static_cast<std::size_t>(kNeighbours)) return cloud;
  const Vec3 middle = medianOf(cloud);
  Points near;
  for (const Vec3& p : cloud)
    if ((p - middle).norm() < kFar) near.push_back(p);
  if (near.size() <= static_cast<std::size_t>(kNeighbours)) return cloud;
  const double cell = kLink * neighbourDistance(near, middle);
  if (!(cell > 0.0)) return cloud;  // most points are doubled: nothing says how far apart they are

  // Cells that touch are of one part.
  std::map<std::array<double, 3>, std::size_t> cells;
  std::vector<std::size_t> cell_of(near.size());
  for (std::size_t k = 0; k < near.size(); ++k) {
    const Vec3 key = ((near[k] - middle) / cell).array().floor();
    cell_of[k] = cells.emplace(std::array<double, 3>{{key.x(), key.y(), key.z()}}, cells.size()).first->second;
  }
  std::vector<std::size_t> root(cells.size());
  std::iota(root.begin(), root.end(), std::size_t{0});
  const auto find = [&](std::size_t c) {
    while (root[c] != c) c = root[c] = root[root[c]];
    return c;
  };
  for (const auto& [key, number] : cells)
    for (int k = 0; k < 27; ++k) {
      const auto other = cells.find({{key[0] + k % 3 - 1, key[1] + k / 3 % 3 - 1, key[2] + k / 9 - 1}});
      if (other != cells.end()) root[find(number)] = find(other->second);
    }
  std::vector<std::size_t> points_of(cells.size(), 0);
  for (const std::size_t c : cell_of) ++points_of[find(c)];
  const double least = kLeastPart * static_cast<double>(*std::max_element(points_of.begin(), points_of.end()));
  const auto isPart = [&](std::size_t n) { return static_cast<double>(n) >= least; };
  Points kept;
  for (std::size_t k = 0; k < near.size(); ++k)
    if (isPart(points_of[find(cell_of[k])])) kept.push_back(near[k]);
  const auto parts = std::count_if(points_of.begin(), points_of.end(), isPart);
  std::ostringstream note;
  if (kept.size() < cloud.size()) {
    note << cloud.size() - kept.size() << " stray points were dropped, which lie more than " << cell
         << " m from the others, in groups of fewer than " << std::ceil(least);
    notes.push_back(note.str());
  }
  if (parts > 1) {
    note.str("");
    note << "the cloud has " << parts << " parts that lie more than " << cell << " m apart; all of them are kept";
    notes.push_back(note.str());
  }
  return kept;
}

std::string surfaceInWords(const SurfaceFromPoints& surface) {
  const std::string method = "surface by " + surface.method;
  if (surface.max_distance <= kOnIt * boundsOf(surface.mesh.vertices).diagonal())
    return method + "; all of them lie on it";
  return method + "; the points are up to " + numberText(surface.max_distance, 3) + " m from it, on average " +
         numberText(surface.mean_distance, 3) + " m";
}

Result<CloudShape> shapeOfCloud(const Points& cloud, const CloudFilter& filter) {
  if (cloud.size() > kMostRaw) {
    return refuse("the cloud has " + std::to_string(cloud.size()) + " points; accepted: up to " +
                  std::to_string(kMostRaw));
  }
  Points finite;
  for (const Vec3& p : cloud)
    if (p.allFinite()) finite.push_back(p);
  if (finite.size() < 4)
    return refuse("the cloud has " + std::to_string(finite.size()) + " finite points; accepted: at least 4");
  std::vector<std::string> strays;
  const Points body = withoutStrays(finite, strays);
  const Box box = boundsOf(body);
  const double diagonal = box.diagonal();
  if (!(diagonal >= kSmallest && diagonal <= kLargest)) {
    std::ostringstream text;
    text << "the cloud is " << diagonal << " m across; accepted: " << kSmallest << ".." << kLargest
         << " m (scale 0.001 is for a cloud in millimetres)";
    return refuse(text.str());
  }
  const double voxel = filter.voxel > 0.0 ? filter.voxel : diagonal / kCells;
  if (!(voxel >= diagonal / kMostCells && voxel <= 0.5 * diagonal)) {
    std::ostringstream text;
    text << "voxel is " << voxel << " m; accepted for this cloud: " << diagonal / kMostCells << ".." << 0.5 * diagonal
         << " m";
    return Error{ErrorCode::kInvalidArgument, text.str()};
  }

  // About the middle: they are single precision in there.
  const Vec3 middle = 0.5 * (box.min + box.max);
  Cloud::Ptr raw(new Cloud), thinned(new Cloud), kept(new Cloud);
  for (const Vec3& p : body) {
    const Eigen::Vector3f q = (p - middle).cast<float>();
    raw->emplace_back(q.x(), q.y(), q.z());
  }
  pcl::VoxelGrid<pcl::PointXYZ> grid;
  grid.setInputCloud(raw);
  const auto leaf = static_cast<float>(voxel);
  grid.setLeafSize(leaf, leaf, leaf);
  grid.filter(*thinned);
  if (thinned->size() > kMostLeft) {
    std::ostringstream text;
    text << thinned->size() << " points are left with a voxel of " << voxel << " m; accepted: up to " << kMostLeft
         << ", as with a larger voxel";
    return refuse(text.str());
  }
  pcl::StatisticalOutlierRemoval<pcl::PointXYZ> stray;
  stray.setInputCloud(thinned);
  stray.setMeanK(kNeighbours);
  stray.setStddevMulThresh(filter.outliers);
  stray.filter(*kept);

  Points points;
  for (const pcl::PointXYZ& p : *kept) points.push_back(middle + Vec3(p.x, p.y, p.z));
  Result<SurfaceFromPoints> surface = surfaceFromPoints(points);
  if (!surface.ok())
    return Error{surface.error().code,
                 "the cloud's " + std::to_string(points.size()) + " points that are left: " + surface.error().detail};
  Result<RepairedMesh> repaired = repairMesh(surface->mesh, MeshRepair::kMend);
  if (!repaired.ok()) return repaired.error();
  if (!repaired->solid)
    return refuse("no closed surface could be made of the cloud; accepted: points all around a body");
  CloudShape made;
  made.points = points.size();
  made.shape.mesh = std::move(repaired->mesh);
  std::ostringstream note;
  note << "of " << cloud.size() << " points " << cloud.size() - finite.size() << " were not finite, "
       << finite.size() - body.size() << " were strays, " << body.size() - thinned->size()
       << " were joined with others in cells of " << voxel << " m, " << thinned->size() - kept->size()
       << " were outliers";
  made.shape.notes.push_back(note.str());
  made.shape.notes.insert(made.shape.notes.end(), strays.begin(), strays.end());
  made.shape.notes.push_back(surfaceInWords(*surface));
  made.shape.notes.insert(made.shape.notes.end(), repaired->notes.begin(), repaired->notes.end());
  made.shape.warnings = std::move(repaired->warnings);
  return made;
}

}  // namespace meshless
