#include "meshless_surgery/dynamics/rotation_batch.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>
#include <vector>

#include <gtest/gtest.h>

#include <Eigen/SVD>

#include "dynamics/rotation.h"
#include "support/random.h"

namespace meshless {
namespace rotation_batch_test {

using test::Random;

template <class Scalar>
constexpr double either(double of_float, double of_double) {
  return std::is_same_v<Scalar, float> ? of_float : of_double;
}
template <class Scalar>
constexpr double kAllowedAngle = either<Scalar>(3e-7, 1e-9);  // [rad]; float: mostly of storing q
template <class Scalar>
constexpr double kAllowedNorm = either<Scalar>(1e-6, 1e-14);

const char* const kClasses[] = {
    "random",   "well conditioned", "stretched",           "near singular",           "planar", "near a line", "line",
    "inverted", "inverted, any",    "symmetric inversion", "near symmetric inversion"};
constexpr int kClassCount = 11;
constexpr int kLineClass = 6, kSymmetricInversion = 9;
const double kScales[] = {1e-12, 1.0, 1e12};

Mat3 example(int kind, Random& random) {
  const auto power = [&](double low, double high) { return std::pow(10.0, random.uniform(low, high)); };
  Vec3 s = Vec3::Ones();
  switch (kind) {
    case 0:
      return random.matrix(1.0);
    case 1:
      s = Vec3(random.uniform(0.5, 2), random.uniform(0.5, 2), random.uniform(0.5, 2));
      break;
    case 2:
      s = Vec3(power(0, 3), power(0, 3), power(0, 3));
      break;
    case 3:
      s = Vec3(1, random.uniform(0.1, 1), power(-8, -3));
      break;
    case 4:
      s = Vec3(1, random.uniform(0.1, 1), 0);
      break;
    case 5:
      s = Vec3(1, power(-7, -1), power(-7, -1));
      break;
    case 6:
      s = Vec3(1, 0, 0);
      break;
    case 7:
      s = Vec3(1, random.uniform(0.5, 1), -random.uniform(0.01, 0.45));
      break;
    case 8:
      s = Vec3(random.uniform(0.1, 1), random.uniform(0.1, 1), -random.uniform(0.1, 1));
      break;
    case 9:
      s = Vec3(1, 1, -1);
      break;
    default:
      s = Vec3(1 + power(-7, -2), 1 + power(-7, -2), -1);
      break;
  }
  return random.rotation().toRotationMatrix() * s.asDiagonal() * random.rotation().toRotationMatrix().transpose();
}

// A batch that owns its arrays. The strides are wider than the count, as in the middle of a larger array.
template <class Scalar>
struct Arrays {
  explicit Arrays(std::size_t n)
      : count(n),
        stride(n + 3),
        matrices(9 * stride),
        quaternions(4 * stride),
        rotations(9 * stride),
        flags(n + 1, 77) {
    for (std::size_t i = 0; i < n; ++i) setGuess(i, Quat::Identity());
  }
  void setMatrix(std::size_t i, const Mat3& a) {
    for (int k = 0; k < 9; ++k) matrices[k * stride + i] = static_cast<Scalar>(a(k / 3, k % 3));
  }
  void setGuess(std::size_t i, const Quat& q) {
    for (int k = 0; k < 4; ++k) quaternions[k * stride + i] = static_cast<Scalar>(q.coeffs()[k]);
  }
  void copyItem(std::size_t to, const Arrays& other, std::size_t from) {
    for (int k = 0; k < 9; ++k) matrices[k * stride + to] = other.matrices[k * other.stride + from];
    for (int k = 0; k < 4; ++k) quaternions[k * stride + to] = other.quaternions[k * other.stride + from];
  }
  Mat3 matrix(std::size_t i) const {
    Mat3 a;
    for (int k = 0; k < 9; ++k) a(k / 3, k % 3) = matrices[k * stride + i];
    return a;
  }
  Mat3 rotation(std::size_t i) const {
    Mat3 a;
    for (int k = 0; k < 9; ++k) a(k / 3, k % 3) = rotations[k * stride + i];
    return a;
  }
  Quat quaternion(std::size_t i) const {
    return Quat(quaternions[3 * stride + i], quaternions[i], quaternions[stride + i], quaternions[2 * stride + i]);
  }
  bool unique(std::size_t i) const { return flags[i] & kRotationUnique; }
  void solve(bool warm, InstructionSet set) {
    RotationBatch<Scalar> batch;
    batch.count = count;
    batch.matrices = matrices.data();
    batch.matrix_stride = stride;
    batch.quaternions = quaternions.data();
    batch.quaternion_stride = stride;
    batch.rotations = rotations.data();
    batch.rotation_stride = stride;
    batch.flags = flags.data();
    warm ? nearestRotationsWarm(batch, set) : nearestRotationsCold(batch, set);
    EXPECT_EQ(flags[count], 77);  // nothing is written past the end
  }

  std::size_t count, stride;
  std::vector<Scalar> matrices, quaternions, rotations;
  std::vector<std::uint8_t> flags;
};

// Of the profile matrix's largest two eigenvalues, relative to |a|.
double uniqueGap(const Mat3& a) {
  const Vec3 s = Eigen::JacobiSVD<Mat3>(a).singularValues();
  return 2.0 * (s[1] + (a.determinant() < 0.0 ? -s[2] : s[2])) / a.norm();
}

// The second term is double precision times the condition number, of ours and of what it is compared with.
template <class Scalar>
double allowedAngle(const Mat3& a) {
  return kAllowedAngle<Scalar> + 5e-15 / uniqueGap(a);
}

double angleBetween(const Quat& p, const Quat& q) {
  return 2.0 * std::min((p.coeffs() - q.coeffs()).norm(), (p.coeffs() + q.coeffs()).norm());
}

// Whatever was found is a rotation, and none has a larger tr(R^T a).
template <class Scalar>
void expectMaximiser(const Arrays<Scalar>& arrays, std::size_t i) {
  const Quat q = arrays.quaternion(i);
  ASSERT_NEAR(q.norm(), 1.0, kAllowedNorm<Scalar>);
  ASSERT_LT((arrays.rotation(i) - q.normalized().toRotationMatrix()).norm(), 4 * kAllowedNorm<Scalar>);
  const Mat3 a = arrays.matrix(i);
  const Mat3 best = nearestRotationExact(a, q).rotation.toRotationMatrix();
  const double lost = ((best - q.normalized().toRotationMatrix()).transpose() * a).trace();
  ASSERT_LT(lost, 2 * kRotationUniqueGap<Scalar> * a.norm());
}

std::vector<InstructionSet> instructionSets() {
  std::vector<InstructionSet> sets;
  for (InstructionSet set : {InstructionSet::kBaseline, InstructionSet::kAvx2, InstructionSet::kAvx512})
    if (instructionSetAvailable(set)) sets.push_back(set);
  return sets;
}

template <class Scalar>
class RotationBatchTest : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(RotationBatchTest, Scalars, );

TYPED_TEST(RotationBatchTest, IsThatOfTheExactMethodInEveryClassAtEveryScale) {
  using Scalar = TypeParam;
  Random random(1);
  for (InstructionSet set : instructionSets())
    for (int kind = 0; kind < kClassCount; ++kind)
      for (double scale : kScales)
        for (double turn : {-1.0, 0.0, 1e-3, 0.1, 1.0}) {  // of the guess from the truth [rad]; -1: cold
          SCOPED_TRACE(testing::Message() << kClasses[kind] << ", scale " << scale << ", guess " << turn << ", set "
                                          << static_cast<int>(set));
          Arrays<Scalar> arrays(500);
          std::vector<Quat> guesses(arrays.count, Quat::Identity());
          for (std::size_t i = 0; i < arrays.count; ++i) {
            arrays.setMatrix(i, scale * example(kind, random));
            if (turn < 0.0) continue;
            const Quat truth = nearestRotationExact(arrays.matrix(i), random.rotation()).rotation;
            arrays.setGuess(i, truth * Quat(Eigen::AngleAxisd(turn, random.unit())));
            guesses[i] = arrays.quaternion(i);
          }
          arrays.solve(turn >= 0.0, set);
          int not_unique = 0;
          for (std::size_t i = 0; i < arrays.count; ++i) {
            expectMaximiser(arrays, i);
            const RotationResult exact = nearestRotationExact(arrays.matrix(i), guesses[i]);
            not_unique += arrays.unique(i) ? 0 : 1;
            if (!arrays.unique(i)) continue;
            ASSERT_TRUE(exact.unique);
            ASSERT_LT(angleBetween(arrays.quaternion(i), exact.rotation), allowedAngle<Scalar>(arrays.matrix(i)))
                << "item " << i;
            ASSERT_GE(arrays.quaternion(i).dot(guesses[i]), turn > 0.5 ? -1.0 : -1e-6);
          }
          if (kind == kLineClass || kind == kSymmetricInversion) {
            EXPECT_EQ(not_unique, 500);
          }
          if (kind <= 4 || kind == 7) {
            EXPECT_EQ(not_unique, 0);
          }
        }
}

TYPED_TEST(RotationBatchTest, AFarOrHostileGuessChangesNothing) {
  using Scalar = TypeParam;
  Random random(2);
  for (InstructionSet set : instructionSets())
    for (int kind : {0, 1, 2, 3, 4, 5, 7, 8, 10}) {
      Arrays<Scalar> arrays(4000);
      for (std::size_t i = 0; i < arrays.count; ++i) {
        arrays.setMatrix(i, example(kind, random));
        arrays.setGuess(i, random.rotation());
      }
      arrays.setGuess(0, Quat(0, 0, 0, 0));
      arrays.setGuess(1, Quat(std::nan(""), 0, 0, 1));
      arrays.setGuess(2, Quat(1e9, 2e9, 0, 1e9));
      arrays.setGuess(3, Quat(std::numeric_limits<double>::infinity(), 0, 0, 1));
      arrays.solve(true, set);
      for (std::size_t i = 0; i < arrays.count; ++i) {
        expectMaximiser(arrays, i);
        if (!arrays.unique(i)) continue;
        const Quat exact = nearestRotationExact(arrays.matrix(i), Quat::Identity()).rotation;
        ASSERT_LT(angleBetween(arrays.quaternion(i), exact), allowedAngle<Scalar>(arrays.matrix(i)))
            << kClasses[kind] << " " << i;
      }
    }
}

TYPED_TEST(RotationBatchTest, AGuessNearbyNeedsNoColdSolution) {
  using Scalar = TypeParam;
  Random random(3);
  for (InstructionSet set : instructionSets()) {
    Arrays<Scalar> arrays(1000);
    for (std::size_t i = 0; i < arrays.count; ++i) {
      arrays.setMatrix(i, example(1, random));
      const Quat truth = nearestRotationExact(arrays.matrix(i), Quat::Identity()).rotation;
      arrays.setGuess(i, truth * Quat(Eigen::AngleAxisd(0.05, random.unit())));
    }
    arrays.solve(true, set);
    for (std::size_t i = 0; i < arrays.count; ++i) ASSERT_EQ(arrays.flags[i], kRotationUnique | kRotationWarm);
    arrays.solve(false, set);
    for (std::size_t i = 0; i < arrays.count; ++i) ASSERT_EQ(arrays.flags[i], kRotationUnique);
  }
}

TYPED_TEST(RotationBatchTest, WhatTheMatrixDoesNotDetermineStaysAsItWas) {
  using Scalar = TypeParam;
  Random random(4);
  const double tolerance = either<Scalar>(5e-6, 1e-8);
  for (InstructionSet set : instructionSets())
    for (int kind : {kLineClass, kSymmetricInversion})
      for (double scale : kScales) {
        Arrays<Scalar> arrays(300);
        std::vector<Quat> guesses;
        for (std::size_t i = 0; i < arrays.count; ++i) {
          arrays.setMatrix(i, scale * example(kind, random));
          arrays.setGuess(i, random.rotation());
          guesses.push_back(arrays.quaternion(i));
        }
        arrays.solve(true, set);
        for (std::size_t i = 0; i < arrays.count; ++i) {
          ASSERT_FALSE(arrays.unique(i));
          expectMaximiser(arrays, i);
          // No maximiser is closer to the guess: project it onto the space of the best, made wide enough for rounding.
          const Mat3 a = arrays.matrix(i) / scale;
          Vec3 along = Vec3::Zero();
          for (int c = 0; c < 3; ++c)
            if (a.col(c).norm() > along.norm()) along = a.col(c);
          if (kind != kLineClass) continue;
          const Vec3 p = along.normalized(), q = (a.transpose() * p).normalized();
          const Quat nearest = guesses[i] * Quat::FromTwoVectors(q, guesses[i].conjugate() * p);
          if ((guesses[i] * q).dot(p) < -0.99) continue;  // nearly opposite: any half turn is as near
          ASSERT_LT((arrays.quaternion(i).normalized() * q - p).norm(), tolerance);
          ASSERT_LT(angleBetween(arrays.quaternion(i), nearest.normalized()), 20 * tolerance);
        }
        // Solved again from its own answer, nothing moves.
        std::vector<Quat> before;
        for (std::size_t i = 0; i < arrays.count; ++i) before.push_back(arrays.quaternion(i));
        arrays.solve(true, set);
        for (std::size_t i = 0; i < arrays.count; ++i)
          ASSERT_LT(angleBetween(arrays.quaternion(i), before[i]), tolerance);
      }
}

TYPED_TEST(RotationBatchTest, ZeroAndNonFiniteMatricesKeepTheGuessToTheBit) {
  using Scalar = TypeParam;
  Random random(5);
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (InstructionSet set : instructionSets())
    for (double bad : {0.0, nan, inf, -inf}) {
      Arrays<Scalar> arrays(9);
      for (std::size_t i = 0; i < 9; ++i) {
        Mat3 a = bad == 0.0 ? Mat3(Mat3::Zero()) : random.matrix(1.0);
        a(i / 3, i % 3) = bad;
        arrays.setMatrix(i, a);
        arrays.setGuess(i, random.rotation());
      }
      const auto guesses = arrays.quaternions;
      arrays.solve(true, set);
      EXPECT_EQ(arrays.quaternions, guesses);
      EXPECT_EQ(arrays.flags, std::vector<std::uint8_t>({0, 0, 0, 0, 0, 0, 0, 0, 0, 77}));
      arrays.solve(false, set);
      for (std::size_t i = 0; i < 9; ++i) {
        EXPECT_EQ(arrays.quaternion(i).coeffs(), Quat::Identity().coeffs());
        EXPECT_EQ(arrays.rotation(i), Mat3(Mat3::Identity()));
      }
    }
}

TYPED_TEST(RotationBatchTest, TheSmallestAndTheLargestNumbersAreScaleFreeToo) {
  using Scalar = TypeParam;
  Random random(6);
  // Powers of two: the matrices are then scaled exactly.
  const double smallest = std::ldexp(1.0, static_cast<int>(either<Scalar>(-110, -900)));
  const double largest = std::ldexp(1.0, static_cast<int>(either<Scalar>(127, 900)));
  for (InstructionSet set : instructionSets())
    for (double scale : {smallest, largest})
      for (bool warm : {false, true}) {
        Arrays<Scalar> arrays(200), plain(200);
        for (std::size_t i = 0; i < 200; ++i) {
          const Mat3 a = example(0, random);
          const Quat guess = random.rotation();
          arrays.setMatrix(i, scale * a), plain.setMatrix(i, a);
          arrays.setGuess(i, guess), plain.setGuess(i, guess);
        }
        arrays.solve(warm, set), plain.solve(warm, set);
        for (std::size_t i = 0; i < 200; ++i) {
          ASSERT_TRUE(arrays.unique(i));
          ASSERT_LT(angleBetween(arrays.quaternion(i), plain.quaternion(i)), kAllowedAngle<Scalar>);
        }
      }
}

TYPED_TEST(RotationBatchTest, AnItemsBitsDependNeitherOnItsPlaceNorOnItsNeighbours) {
  using Scalar = TypeParam;
  Random random(7);
  const std::size_t n = 200;
  Arrays<Scalar> items(n);
  for (std::size_t i = 0; i < n; ++i) {
    Mat3 a = example(static_cast<int>(i) % kClassCount, random) * std::pow(10.0, random.uniform(-12, 12));
    if (i % 13 == 5) a(1, 1) = std::numeric_limits<double>::quiet_NaN();
    if (i % 17 == 5) a.setZero();
    if (i % 19 == 5) a(2, 0) = std::numeric_limits<double>::infinity();
    items.setMatrix(i, a);
    const Quat truth = nearestRotationExact(items.matrix(i), random.rotation()).rotation;
    items.setGuess(i, truth * Quat(Eigen::AngleAxisd(random.uniform(0, 0.2), random.unit())));
  }
  for (InstructionSet set : instructionSets())
    for (bool warm : {false, true}) {
      std::vector<Arrays<Scalar>> alone;
      for (std::size_t i = 0; i < n; ++i) {
        Arrays<Scalar> one(1);
        one.copyItem(0, items, i);
        one.solve(warm, set);
        alone.push_back(one);
      }
      for (std::size_t size :
           {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 63, 64, 65, 127, 128, 129, 200})
        for (int repeat = 0; repeat < 5; ++repeat) {
          Arrays<Scalar> batch(size);
          std::vector<std::size_t> from(size);
          for (std::size_t i = 0; i < size; ++i) {
            from[i] = static_cast<std::size_t>(random.integer(0, static_cast<int>(n) - 1));
            batch.copyItem(i, items, from[i]);
          }
          batch.solve(warm, set);
          for (std::size_t i = 0; i < size; ++i) {
            for (int k = 0; k < 4; ++k)
              ASSERT_EQ(std::memcmp(&batch.quaternions[k * batch.stride + i],
                                    &alone[from[i]].quaternions[k * alone[from[i]].stride], sizeof(Scalar)),
                        0)
                  << "item " << from[i] << " at " << i << " of " << size;
            for (int k = 0; k < 9; ++k)
              ASSERT_EQ(std::memcmp(&batch.rotations[k * batch.stride + i],
                                    &alone[from[i]].rotations[k * alone[from[i]].stride], sizeof(Scalar)),
                        0);
            ASSERT_EQ(batch.flags[i], alone[from[i]].flags[0]);
          }
        }
    }
}

TYPED_TEST(RotationBatchTest, ATurnedMatrixGivesATurnedRotation) {
  using Scalar = TypeParam;
  Random random(8);
  Arrays<Scalar> arrays(2000);
  std::vector<Quat> left, right;
  for (std::size_t i = 0; i < 2000; i += 2) {
    arrays.setMatrix(i, example(static_cast<int>(i / 2) % 2 ? 1 : 7, random));
    left.push_back(random.rotation()), right.push_back(random.rotation());
    const Mat3 turned = left.back().toRotationMatrix() * arrays.matrix(i) * right.back().toRotationMatrix();
    arrays.setMatrix(i + 1, turned);
  }
  arrays.solve(false, widestInstructionSet());
  for (std::size_t i = 0; i < 2000; i += 2)  // the turned matrix is rounded: times the condition number
    ASSERT_LT(angleBetween(left[i / 2] * arrays.quaternion(i) * right[i / 2], arrays.quaternion(i + 1)),
              either<Scalar>(2e-5, 1e-10));
}

TEST(RotationBatch, AnEmptyBatchAndMissingOutputsAreFine) {
  nearestRotationsCold(RotationBatch<float>());
  nearestRotationsWarm(RotationBatch<double>());
  const float matrices[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  float quaternions[4];
  RotationBatch<float> batch;
  batch.count = 1;
  batch.matrices = matrices;
  batch.matrix_stride = 1;
  batch.quaternions = quaternions;
  batch.quaternion_stride = 1;
  nearestRotationsCold(batch);
  EXPECT_FLOAT_EQ(quaternions[2], std::sqrt(0.5f));
  EXPECT_FLOAT_EQ(quaternions[3], std::sqrt(0.5f));
}

}  // namespace rotation_batch_test
}  // namespace meshless
