#include "dynamics/rotation.h"

#include <gtest/gtest.h>

#include <Eigen/SVD>

#include "support/random.h"

namespace meshless {
namespace rotation_test {

using test::Random;

// The maximiser of tr(R^T a) by singular values, the textbook way (Kabsch).
Mat3 bySvd(const Mat3& a) {
  const Eigen::JacobiSVD<Mat3> svd(a, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Mat3 flip = Mat3::Identity();
  flip(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1.0 : 1.0;
  return svd.matrixU() * flip * svd.matrixV().transpose();
}

double angleBetween(const Mat3& a, const Mat3& b) { return (a - b).norm() / std::sqrt(2.0); }

void expectRotation(const Quat& q) {
  EXPECT_TRUE(q.coeffs().allFinite());
  EXPECT_NEAR(q.norm(), 1.0, 1e-12);
}

TEST(NearestRotation, IsThatOfTheSingularValuesForRandomMatricesOfAnyScale) {
  Random random(1);
  for (int k = 0; k < 20000; ++k) {
    const double scale = std::pow(10.0, random.uniform(-12, 12));
    const Mat3 a = random.matrix(1.0) * scale;
    const Eigen::JacobiSVD<Mat3> svd(a);
    const Vec3 s = svd.singularValues();
    if (a.determinant() < 0 && s[1] - s[2] < 1e-3 * s[0]) continue;  // hardly unique
    if (s[1] + (a.determinant() < 0 ? -s[2] : s[2]) < 1e-3 * s[0]) continue;
    for (const RotationResult& r : {nearestRotation(a, random.rotation()), nearestRotationExact(a, random.rotation())}) {
      expectRotation(r.rotation);
      EXPECT_TRUE(r.unique);
      EXPECT_LT(angleBetween(r.rotation.toRotationMatrix(), bySvd(a)), 1e-9) << "case " << k;
    }
  }
}

TEST(NearestRotation, WarmStartNearbyNeedsNoExactSolve) {
  Random random(2);
  for (int k = 0; k < 2000; ++k) {
    const Quat truth = random.rotation();
    const Mat3 stretch = Vec3(random.uniform(0.5, 2), random.uniform(0.5, 2), random.uniform(0.5, 2)).asDiagonal();
    const Quat v = random.rotation();
    const Mat3 a = truth.toRotationMatrix() * (v * (stretch * v.toRotationMatrix().transpose()));
    const Quat guess = truth * Quat(Eigen::AngleAxisd(0.3, random.unit()));
    const RotationResult r = nearestRotation(a, guess);
    EXPECT_TRUE(r.warm);
    EXPECT_LT(angleBetween(r.rotation.toRotationMatrix(), truth.toRotationMatrix()), 1e-12);
  }
}

TEST(NearestRotation, WhatTheMatrixDoesNotDetermineStaysAsItWas) {
  Random random(3);
  for (int k = 0; k < 500; ++k) {
    const Quat guess = random.rotation();
    const RotationResult zero = nearestRotation(Mat3::Zero(), guess);
    EXPECT_FALSE(zero.unique);
    EXPECT_LT(angleBetween(zero.rotation.toRotationMatrix(), guess.toRotationMatrix()), 1e-12);
    // Rank 1: the direction is aligned (no torque), the turn about it is kept from the guess as far as it goes.
    const Vec3 p = random.unit(), q = random.unit();
    const RotationResult line = nearestRotation(p * q.transpose(), guess);
    EXPECT_FALSE(line.unique);
    expectRotation(line.rotation);
    EXPECT_LT((line.rotation * q - p).norm(), 1e-7);
    const Quat aligned = guess * Quat::FromTwoVectors(q, guess.conjugate() * p);
    EXPECT_LE(line.rotation.angularDistance(guess), aligned.angularDistance(guess) + 1e-7);
  }
}

TEST(NearestRotation, PlanarInvertedAndHostileInputGivesRotations) {
  Random random(4);
  for (int k = 0; k < 2000; ++k) {
    const Mat3 u = random.rotation().toRotationMatrix(), v = random.rotation().toRotationMatrix();
    const double scale = std::pow(10.0, random.uniform(-12, 12));
    for (const Vec3& s : {Vec3(1, 0.5, 0), Vec3(1, 1, -1), Vec3(-1, -1, -1), Vec3(1, 1e-9, 1e-9), Vec3(1, 0.7, -0.2)}) {
      const Mat3 a = scale * u * s.asDiagonal() * v.transpose();
      const RotationResult r = nearestRotation(a, random.rotation());
      expectRotation(r.rotation);
      // The best trace there is, whichever of the equally good rotations was taken.
      const double best = (bySvd(a).transpose() * a).trace();
      EXPECT_NEAR((r.rotation.toRotationMatrix().transpose() * a).trace() / scale, best / scale, 1e-9);
    }
  }
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (double bad : {nan, inf, -inf}) {
    Mat3 a = Mat3::Identity();
    a(1, 2) = bad;
    const RotationResult r = nearestRotation(a, Quat::Identity());
    EXPECT_FALSE(r.unique);
    EXPECT_EQ(r.rotation.coeffs(), Quat::Identity().coeffs());
  }
}

}  // namespace rotation_test
}  // namespace meshless
