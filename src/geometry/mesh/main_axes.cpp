#include "meshless_surgery/geometry/mesh/main_axes.h"

#include <array>
#include <cmath>

#include <Eigen/Dense>

namespace meshless {
namespace {

constexpr int kMostSteps = 200;
constexpr double kBetter = 0.01;  // of the area: by so much other axes have to be better than the mesh's own

// Of a surface: the sum of area * n n n n over its faces [m^2]. All that the fit of axes asks of it.
class Quartic {
 public:
  explicit Quartic(const TriangleMesh& mesh) {
    for (const Triangle& t : mesh.triangles) {
      const Vec3& a = mesh.vertices[t[0]];
      const Vec3 area = 0.5 * (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a);
      const double size = area.norm();
      if (!(size > 0.0)) continue;
      total_ += size;
      const Vec3 n = area / size;
      const Mat3 squares = n * n.transpose();
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) sums_[3 * i + j] += size * squares(i, j) * squares;
    }
  }

  double area() const { return total_; }
  /// Along an axis: the sum of area * (n . axis)^3 n.
  Vec3 slope(const Vec3& axis) const {
    Vec3 sum = Vec3::Zero();
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) sum[i] += axis[j] * axis.dot(sums_[3 * i + j] * axis);
    return sum;
  }
  double fit(const Mat3& axes) const {
    double sum = 0.0;
    for (int k = 0; k < 3; ++k) sum += axes.col(k).dot(slope(axes.col(k)));
    return sum;
  }

 private:
  std::array<Mat3, 9> sums_ = {Mat3::Zero(), Mat3::Zero(), Mat3::Zero(), Mat3::Zero(), Mat3::Zero(),
                               Mat3::Zero(), Mat3::Zero(), Mat3::Zero(), Mat3::Zero()};
  double total_ = 0.0;  // [m^2]
};

// The fit is convex in the entries of the axes: the rotation nearest to its slope is never worse.
Mat3 climbed(const Quartic& surface, Mat3 axes) {
  for (int step = 0; step < kMostSteps; ++step) {
    Mat3 slope;
    for (int k = 0; k < 3; ++k) slope.col(k) = surface.slope(axes.col(k));
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
  const Quartic surface(mesh);
  Mat3 best = Mat3::Identity();
  double most = surface.fit(best) + kBetter * surface.area();
  // From a few directions, since a climb ends at the nearest top.
  for (const Vec3& turn : {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1), Vec3(1, 1, 0), Vec3(0, 1, 1),
                           Vec3(1, 0, 1), Vec3(1, 1, 1), Vec3(1, -1, 0), Vec3(0, 1, -1), Vec3(-1, 0, 1)}) {
    const Mat3 start =
        turn.isZero() ? Mat3(Mat3::Identity()) : Eigen::AngleAxisd(M_PI / 4.0, turn.normalized()).toRotationMatrix();
    const Mat3 axes = climbed(surface, start);
    const double fit = surface.fit(axes);
    if (!(fit > most)) continue;
    most = fit + 1e-9 * surface.area();
    best = axes;
  }
  return best;
}

double alongAxes(const TriangleMesh& mesh) {
  const Quartic surface(mesh);
  return surface.area() > 0.0 ? surface.fit(Mat3::Identity()) / surface.area() : 0.0;
}

}  // namespace meshless
