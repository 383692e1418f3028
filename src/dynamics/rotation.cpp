#include "rotation.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace meshless {
namespace {

constexpr int kMaxNewtonSteps = 6;
constexpr double kConvergedStep = 1e-8;   // [rad] Newton squares it: the error left is rounding
constexpr double kUniqueGap = 1e-9;       // of the eigenvalues, relative to |a|
constexpr double kLargestNewtonStep = 1.0;  // [rad] beyond it the quadratic model says nothing

Quat rotationVectorToQuat(const Vec3& w) {
  const double angle = w.norm();
  if (angle < 1e-4) return Quat(1.0 - angle * angle / 8.0, 0.5 * w.x(), 0.5 * w.y(), 0.5 * w.z()).normalized();
  const Vec3 v = w * (std::sin(0.5 * angle) / angle);
  return Quat(std::cos(0.5 * angle), v.x(), v.y(), v.z());
}

// Positive definite by its leading minors, each with a margin relative to the scale.
bool positiveDefinite(const Mat3& h, double scale) {
  const double margin = 1e-6;
  const double m1 = h(0, 0);
  const double m2 = h(0, 0) * h(1, 1) - h(0, 1) * h(1, 0);
  const double m3 = h.determinant();
  return m1 > margin * scale && m2 > margin * scale * scale && m3 > margin * scale * scale * scale;
}

}  // namespace

RotationResult nearestRotationExact(const Mat3& a, const Quat& guess) {
  RotationResult result;
  result.warm = false;
  result.rotation = guess;
  const double largest = a.cwiseAbs().maxCoeff();
  if (!(largest > 0.0 && largest < 1e300)) {
    result.unique = false;
    return result;
  }
  const Mat3 s = (a / largest).transpose();
  Eigen::Matrix4d n;
  n << s(0, 0) + s(1, 1) + s(2, 2), s(1, 2) - s(2, 1), s(2, 0) - s(0, 2), s(0, 1) - s(1, 0),  //
      s(1, 2) - s(2, 1), s(0, 0) - s(1, 1) - s(2, 2), s(0, 1) + s(1, 0), s(2, 0) + s(0, 2),   //
      s(2, 0) - s(0, 2), s(0, 1) + s(1, 0), -s(0, 0) + s(1, 1) - s(2, 2), s(1, 2) + s(2, 1),  //
      s(0, 1) - s(1, 0), s(2, 0) + s(0, 2), s(1, 2) + s(2, 1), -s(0, 0) - s(1, 1) + s(2, 2);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(n);
  if (solver.info() != Eigen::Success) {
    result.unique = false;
    return result;
  }
  // Every unit quaternion of the largest eigenvalue's space is as near; the one closest to the guess keeps what the
  // matrix does not determine, and still exerts no torque.
  const Eigen::Vector4d& values = solver.eigenvalues();
  const Eigen::Vector4d g(guess.w(), guess.x(), guess.y(), guess.z());
  Eigen::Vector4d q = Eigen::Vector4d::Zero();
  int dimensions = 0;
  for (int k = 3; k >= 0 && values[3] - values[k] <= kUniqueGap; --k, ++dimensions)
    q += solver.eigenvectors().col(k) * solver.eigenvectors().col(k).dot(g);
  result.unique = dimensions == 1;
  if (q.squaredNorm() < 1e-24) q = solver.eigenvectors().col(3);
  q.normalize();
  if (q.dot(g) < 0.0) q = -q;
  result.rotation = Quat(q[0], q[1], q[2], q[3]);
  return result;
}

RotationResult nearestRotation(const Mat3& a, const Quat& guess) {
  const double scale = a.norm();
  if (scale > 1e-150 && scale < 1e150) {
    Quat q = guess;
    const Mat3 unit = a / scale;
    for (int step = 0; step < kMaxNewtonSteps; ++step) {
      const Mat3 b = q.toRotationMatrix().transpose() * unit;
      const Vec3 gradient(b(2, 1) - b(1, 2), b(0, 2) - b(2, 0), b(1, 0) - b(0, 1));
      const Mat3 symmetric = 0.5 * (b + b.transpose());
      const Mat3 hessian = symmetric.trace() * Mat3::Identity() - symmetric;
      // Positive definite at a stationary point is the proof that it is the maximum: every pair of the symmetric
      // part's eigenvalues then adds up to more than zero.
      if (!positiveDefinite(hessian, 1.0)) break;
      const Vec3 w = hessian.inverse() * gradient;
      const double length = w.norm();
      if (!(length < kLargestNewtonStep)) break;
      q = (q * rotationVectorToQuat(w)).normalized();
      if (length < kConvergedStep) {
        RotationResult result;
        result.rotation = q;
        return result;
      }
    }
  }
  return nearestRotationExact(a, guess);
}

}  // namespace meshless
