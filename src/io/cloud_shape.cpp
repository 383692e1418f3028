#include "meshless_surgery/io/cloud_shape.h"

#include <algorithm>
#include <sstream>
#include <utility>

#include <pcl/filters/statistical_outlier_removal.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>

#include "meshless_surgery/geometry/measures.h"
#include "meshless_surgery/geometry/surface_from_points.h"

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

Error refuse(const std::string& why) { return {ErrorCode::kUnsuitableShape, why}; }

}  // namespace

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
  const Box box = boundsOf(finite);
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
  for (const Vec3& p : finite) {
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
       << finite.size() - thinned->size() << " were joined with others in cells of " << voxel << " m, "
       << thinned->size() - kept->size() << " were outliers";
  made.shape.notes.push_back(note.str());
  note.str("");
  note << "surface by " << surface->method << ", points from it at most " << surface->max_distance << " m, on average "
       << surface->mean_distance << " m";
  made.shape.notes.push_back(note.str());
  made.shape.notes.insert(made.shape.notes.end(), repaired->notes.begin(), repaired->notes.end());
  return made;
}

}  // namespace meshless
