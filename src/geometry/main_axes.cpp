#include "meshless_surgery/geometry/main_axes.h"

#include <cmath>

#include <Eigen/Dense>

namespace meshless {
namespace {

constexpr int kMostSteps = 200;
constexpr double kBetter = 0.01;  // of the area: by so much other axes have to be better than the mesh's own

// Directions [m^2] whose lengths are the areas of the faces.
Points faceAreas(const TriangleMesh& mesh) {
  Points areas;
  for (const Triangle& t : mesh.triangles) {
    const Vec3& a = mesh.vertices[t[0]];
    areas.push_back(0.5 * (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a));
  }
  return areas;
}

double fitOf(const Points& areas, const Mat3& axes) {
  double sum = 0.0;
  for (const Vec3& area : areas) {
    const double size = area.norm();
    if (size > 0.0) sum += (axes.transpose() * area).array().pow(4).sum() / (size * size * size);
  }
  return sum;
}

// The fit is convex in the entries of the axes: the rotation nearest to its slope is never worse.
Mat3 climbed(const Points& areas, Mat3 axes) {
  for (int step = 0; step < kMostSteps; ++step) {
    Mat3 slope = Mat3::Zero();
    for (const Vec3& area : areas) {
      const double size = area.norm();
      if (size > 0.0)
        slope += area * (axes.transpose() * area).array().cube().matrix().transpose() / (size * size * size);
    }
    const Eigen::JacobiSVD<Mat3> svd(slope, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Mat3 next = svd.matrixU() * svd.matrixV().transpose();
    if (next.determinant() < 0.0) return axes;
    const double moved = (next - axes).norm();
    axes = next;
    if (moved < 1e-13) break;
  }
  return axes;
}

}  // namespace

Mat3 mainAxes(const TriangleMesh& mesh) {
  const Points areas = faceAreas(mesh);
  double total = 0.0;
  for (const Vec3& area : areas) total += area.norm();
  Mat3 best = Mat3::Identity();
  double most = fitOf(areas, best) + kBetter * total;
  // From a few directions, since a climb ends at the nearest top.
  for (const Vec3& turn : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1), Vec3(1, 1, 0), Vec3(0, 1, 1),
                           Vec3(1, 0, 1), Vec3(1, 1, 1), Vec3(1, -1, 0), Vec3(0, 1, -1), Vec3(-1, 0, 1)}) {
    const Mat3 start =
        turn.isZero() ? Mat3(Mat3::Identity()) : Eigen::AngleAxisd(M_PI / 4.0, turn.normalized()).toRotationMatrix();
    const Mat3 axes = climbed(areas, start);
    const double fit = fitOf(areas, axes);
    if (!(fit > most)) continue;
    most = fit + 1e-9 * total;
    best = axes;
  }
  return best;
}

}  // namespace meshless
