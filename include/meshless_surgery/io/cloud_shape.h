// The points that a sensor saw of a body, made into its surface.
#pragma once

#include "meshless_surgery/geometry/mesh/surface_from_points.h"
#include "meshless_surgery/io/files.h"

namespace meshless {

struct CloudFilter {
  double voxel = 0.0;  // [m] of the points that fall into one cell their mean is kept; 0: 1/60 of the bounds' diagonal
  double outliers = 3.0;  // standard deviations above the mean; see below
};

struct CloudShape {
  LoadedShape shape;       // closed
  std::size_t points = 0;  // that were left
};

/// Without the groups of points that lie apart from the others and have fewer than 5 % of the points of the largest
/// group. How far apart is taken from the cloud: 1.5 times the distance to the 16th neighbour that three quarters of
/// the points stay below. Larger groups are kept. `notes` get how many were dropped, and how many groups there are.
Points withoutStrays(const Points& cloud, std::vector<std::string>& notes);

/// How it was made and how far the points are from it.
std::string surfaceInWords(const SurfaceFromPoints& surface);

/// Points that are not finite are dropped, then strays (withoutStrays), so that they do not choose the grid, then those
/// that PCL's voxel grid joins, then those whose mean distance to
/// 16 neighbours is above that of all by more standard deviations than `outliers` (PCL, StatisticalOutlierRemoval).
/// surfaceFromPoints closes the rest. Refuses kUnsuitableShape: a diagonal that is not 1 mm to 10 m, which are other
/// units than metres; more than 2,000,000 points, or more than 50,000 after the grid; what surfaceFromPoints refuses.
Result<CloudShape> shapeOfCloud(const Points& cloud, const CloudFilter& filter);

}  // namespace meshless
