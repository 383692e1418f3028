#include "law.h"

#include <cmath>

namespace meshless::truth {
namespace {

Mat3 crossMatrix(const Vec3& v) {
  Mat3 m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

Mat3 cofactor(const Mat3& f) {
  Mat3 c;
  c.col(0) = f.col(1).cross(f.col(2));
  c.col(1) = f.col(2).cross(f.col(0));
  c.col(2) = f.col(0).cross(f.col(1));
  return c;
}

}  // namespace

Response fixedCorotated(const Material& material, const Mat3& f, bool with_tangent) {
  const double mu = material.mu();
  const double lambda = material.lambda();

  const Eigen::JacobiSVD<Mat3> svd(f, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 u = svd.matrixU();
  Mat3 v = svd.matrixV();
  Vec3 stretches = svd.singularValues();
  // Reflections go to the smallest stretch: the rotation nearest to F.
  if (u.determinant() * v.determinant() < 0.0) {
    u.col(2) = -u.col(2);
    stretches[2] = -stretches[2];
  }
  const Mat3 rotation = u * v.transpose();
  const Mat3 cof = cofactor(f);
  const double volume_ratio = f.determinant();

  Response response;
  response.energy = mu * (f - rotation).squaredNorm() + 0.5 * lambda * (volume_ratio - 1.0) * (volume_ratio - 1.0);
  response.stress = 2.0 * mu * (f - rotation) + lambda * (volume_ratio - 1.0) * cof;
  if (!with_tangent) {
    return response;
  }

  // R^T dR = [w]x with (tr S - S) w = the axial vector of R^T dF - dF^T R.
  const Mat3 stretch = v * stretches.asDiagonal() * v.transpose();
  const Mat3 spin_inverse = (stretch.trace() * Mat3::Identity() - stretch).inverse();
  const Eigen::Map<const Eigen::Matrix<double, 9, 1>> cof_stacked(cof.data());
  for (int column = 0; column < 9; ++column) {
    const int row_of_f = column % 3;
    const int column_of_f = column / 3;
    Mat3 df = Mat3::Zero();
    df(row_of_f, column_of_f) = 1.0;
    const Mat3 m = rotation.transpose() * df;
    const Vec3 axial(m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1));
    const Mat3 d_rotation = rotation * crossMatrix(spin_inverse * axial);
    Mat3 d_cof;
    d_cof.col(0) = df.col(1).cross(f.col(2)) + f.col(1).cross(df.col(2));
    d_cof.col(1) = df.col(2).cross(f.col(0)) + f.col(2).cross(df.col(0));
    d_cof.col(2) = df.col(0).cross(f.col(1)) + f.col(0).cross(df.col(1));
    const Mat3 d_stress =
        2.0 * mu * (df - d_rotation) + lambda * cof_stacked[column] * cof + lambda * (volume_ratio - 1.0) * d_cof;
    response.tangent.col(column) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(d_stress.data());
  }
  return response;
}

double uniaxialStretch(const Material& material, double traction) {
  const double mu = material.mu();
  const double lambda = material.lambda();
  // Side stretch b of free sides at stretch a: 2 mu (b - 1) + lambda (a b^2 - 1) a b = 0, one root with b > 0.
  const auto side = [&](double a) {
    double low = 0.0, high = 2.0;
    for (int i = 0; i < 200; ++i) {
      const double b = 0.5 * (low + high);
      (2.0 * mu * (b - 1.0) + lambda * (a * b * b - 1.0) * a * b < 0.0 ? low : high) = b;
    }
    return 0.5 * (low + high);
  };
  double low = 0.5, high = 3.0;
  for (int i = 0; i < 200; ++i) {
    const double a = 0.5 * (low + high);
    const double b = side(a);
    (2.0 * mu * (a - 1.0) + lambda * (a * b * b - 1.0) * b * b < traction ? low : high) = a;
  }
  return 0.5 * (low + high);
}

}  // namespace meshless::truth
