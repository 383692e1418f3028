#include "truth_samples.h"

#include <cmath>

#include <Eigen/Geometry>

#include "meshless_surgery/body/cell_blend.h"
#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/body/filled_cells.h"

namespace meshless::bench {
namespace {

SurfaceBinding bindSamples(const BodyModel& model, const Points& places) {
  const CellFinder finder(*model.lattice);
  std::vector<Index> cells;
  for (const Vec3& p : places) cells.push_back(finder.nearest(p));
  return bindToCells(*model.lattice, places, cells);
}

}  // namespace

std::vector<HeldRegion> heldBy(const TruthCase& truth) {
  std::vector<HeldRegion> held;
  std::string number;
  for (int k = 2; truth.has("held_plane_point" + number); number = "_" + std::to_string(k++))
    held.push_back({Region::below({truth.vector("held_plane_normal" + number).normalized(),
                                   truth.vector("held_plane_point" + number)}),
                    false});
  if (held.empty()) {  // by the package's own solver
    const Vec3 axis = truth.text("fixed_axis") == "z" ? Vec3::UnitZ() : Vec3::UnitX();
    held.push_back({Region::below({axis, Vec3(truth.number("fixed_below") * axis)}), false});
  }
  return held;
}

Pose placingOf(const TruthCase& truth) {
  Pose pose;
  if (!truth.has("placed_rpy_degrees")) return pose;
  const Vec3 rpy = M_PI / 180.0 * truth.vector("placed_rpy_degrees");
  pose.rotation = Eigen::AngleAxisd(rpy.z(), Vec3::UnitZ()) * Eigen::AngleAxisd(rpy.y(), Vec3::UnitY()) *
                  Eigen::AngleAxisd(rpy.x(), Vec3::UnitX());
  pose.translation = Vec3(0.1, -0.2, 0.3);
  return pose;
}

Pose restFrame(const Points& own, const Points& rest) {
  Eigen::Matrix3Xd from(3, own.size()), to(3, own.size());
  for (std::size_t v = 0; v < own.size(); ++v) {
    from.col(static_cast<Eigen::Index>(v)) = own[v];
    to.col(static_cast<Eigen::Index>(v)) = rest[v];
  }
  const Eigen::Matrix4d motion = Eigen::umeyama(from, to, false);
  return {Quat(Mat3(motion.topLeftCorner<3, 3>())), motion.topRightCorner<3, 1>()};
}

Points movedSamples(const TruthCase& truth, const BodyModel& model, const Points& own, const Pose& placed,
                    const Points& particles) {
  const Pose rest_frame = restFrame(own, model.surface.vertices);
  Points places;
  for (const Vec3& p : truth.rest) places.push_back(rest_frame * p);
  const SurfaceBinding samples = bindSamples(model, places);
  Points moved;
  for (Index s = 0; s < truth.rest.size(); ++s) {
    const Vec3 now = samples.place(s, particles);
    moved.push_back(placed.rotation.conjugate() * (now - placed.translation) - truth.rest[s]);
  }
  return moved;
}

double largestOf(const TruthCase& truth, std::size_t& sample) {
  double largest = 0.0;
  for (std::size_t s = 0; s < truth.displacement.size(); ++s)
    if (truth.displacement[s].norm() > largest) {
      largest = truth.displacement[s].norm();
      sample = s;
    }
  return largest;
}

double distanceTo(const TruthCase& truth, const Points& moved, const std::vector<double>& areas, double scale) {
  double squares = 0.0, area = 0.0, largest = 0.0;
  for (std::size_t s = 0; s < moved.size(); ++s) {
    const double here = areas.empty() ? 1.0 : areas[s];
    squares += here * (moved[s] - scale * truth.displacement[s]).squaredNorm();
    area += here;
    largest = std::max(largest, scale * truth.displacement[s].norm());
  }
  return std::sqrt(squares / area) / largest;
}

}  // namespace meshless::bench
