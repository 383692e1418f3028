#include "meshless_surgery/contact/quadratic_map.h"

#include <cmath>

namespace meshless {
namespace {

constexpr int kMostSteps = 8;
constexpr double kLongestStep = 0.7;  // of the cluster's size: farther away the slope says nothing
constexpr double kClose = 1e-4;       // of the cluster's size: near enough, as what is left is corrected by the surface
constexpr double kFlattest = 1e-3;    // det of the slope: below, the map folds

}  // namespace

QuadraticMap::Basis QuadraticMap::basis(const Vec3& q) {
  Basis b;
  b << q.x(), q.y(), q.z(), q.x() * q.x(), q.y() * q.y(), q.z() * q.z(), q.x() * q.y(), q.y() * q.z(), q.z() * q.x();
  return b;
}

Vec3 QuadraticMap::at(const Vec3& r) const { return fit * (basis((r - rest) / scale) - mean) + centre; }

Mat3 QuadraticMap::slope(const Vec3& r) const {
  const Vec3 q = (r - rest) / scale;
  Mat3 s;
  s.col(0) = fit.col(0) + 2.0 * q.x() * fit.col(3) + q.y() * fit.col(6) + q.z() * fit.col(8);
  s.col(1) = fit.col(1) + 2.0 * q.y() * fit.col(4) + q.x() * fit.col(6) + q.z() * fit.col(7);
  s.col(2) = fit.col(2) + 2.0 * q.z() * fit.col(5) + q.y() * fit.col(7) + q.x() * fit.col(8);
  return s / scale;
}

bool QuadraticMap::invert(const Vec3& present, double most, Vec3& r, Mat3& to_rest) const {
  Vec3 guess = r;
  for (int step = 0; step < kMostSteps; ++step) {
    const Mat3 slope_here = slope(guess);
    if (!(std::abs(slope_here.determinant()) > kFlattest)) return false;
    to_rest = slope_here.inverse();
    const Vec3 missing = present - at(guess);
    Vec3 way = to_rest * missing;
    const double length = way.norm();
    if (!std::isfinite(length)) return false;
    if (length > kLongestStep * scale) way *= kLongestStep * scale / length;
    guess += way;
    if ((guess - r).squaredNorm() > most * most) return false;
    if (length < kClose * scale) {
      r = guess;
      return true;
    }
  }
  return false;
}

}  // namespace meshless
