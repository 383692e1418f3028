// Nearest rotations of many 3x3 matrices at once, vectorised, for the widest instructions that the machine has.
#pragma once

#include <cstddef>
#include <cstdint>

namespace meshless {

/// Matrices and rotations as structures of arrays. Component (row, column) of matrix i lies at
/// matrices[(3 * row + column) * matrix_stride + i], component k of x y z w of quaternion i at
/// quaternions[k * quaternion_stride + i]. A stride is at least `count`. Nothing needs to be aligned, no two arrays
/// may overlap.
template <class Scalar>
struct RotationBatch {
  std::size_t count = 0;
  const Scalar* matrices = nullptr;
  std::size_t matrix_stride = 0;
  Scalar* quaternions = nullptr;
  std::size_t quaternion_stride = 0;
  Scalar* rotations = nullptr;  // the same rotations as matrices, laid out as `matrices`; null: not wanted
  std::size_t rotation_stride = 0;
  std::uint8_t* flags = nullptr;  // kRotationUnique | kRotationWarm of each item; null: not wanted
};

constexpr std::uint8_t kRotationUnique = 1;  // the matrix determines its rotation
constexpr std::uint8_t kRotationWarm = 2;    // found from the guess, without a cold solution

/// The rotation is called unique where the largest two eigenvalues of Horn's profile matrix are farther apart than
/// this, relative to |a| (Frobenius). In terms of the singular values, the smallest with the sign of det a:
/// 2 (s2 + s3) > gap |a|. Below it, rounding the matrix to its own precision already turns the rotation by over 0.1
/// rad.
template <class Scalar>
inline constexpr double kRotationUniqueGap = 0.0;
template <>
inline constexpr double kRotationUniqueGap<float> = 1e-6;
template <>
inline constexpr double kRotationUniqueGap<double> = 1e-9;

/// What a batch is computed with. The sets differ in the last bits, so a run that must be repeated on another machine
/// to the bit names kBaseline.
enum class InstructionSet : std::uint8_t { kBaseline, kAvx2, kAvx512 };
bool instructionSetAvailable(InstructionSet set);
InstructionSet widestInstructionSet();

/// Maximisers of tr(R^T a) over rotations, as nearestRotation() in rotation.h: valid for inverted matrices, scale-free
/// (float: all normal numbers, double: 1e-280..1e280). Where a maximiser is unique it is found to 3e-7 rad (float: what
/// storing the quaternion costs; double: 1e-9 rad + 5e-15 |a| / gap) for the matrix as given; where it is not, the
/// maximiser nearest to the guess is returned, and a zero or non-finite matrix keeps the guess to the bit. Always a
/// unit quaternion. An item's result depends neither on its place in the batch nor on its neighbours. Works on the
/// stack alone (64 KB); reentrant.
///
/// Warm: `quaternions` holds the guesses (one that is no quaternion counts as the identity) and is replaced. Two Newton
/// steps on the rotation vector (three for double; Kugelstadt et al. 2018) that verify themselves; what fails goes the
/// cold way. Solves nearly all guesses up to 0.1 rad off, and costs more than cold beyond.
void nearestRotationsWarm(const RotationBatch<float>& batch);
void nearestRotationsWarm(const RotationBatch<double>& batch);
void nearestRotationsWarm(const RotationBatch<float>& batch, InstructionSet set);
void nearestRotationsWarm(const RotationBatch<double>& batch, InstructionSet set);

/// Cold: `quaternions` is only written; the guess is the identity. The largest root of the profile matrix's
/// characteristic quartic and its eigenvector (Horn 1987), verified by its residual; what fails, the ill-conditioned
/// and the not unique, by Jacobi rotations of the profile matrix.
void nearestRotationsCold(const RotationBatch<float>& batch);
void nearestRotationsCold(const RotationBatch<double>& batch);
void nearestRotationsCold(const RotationBatch<float>& batch, InstructionSet set);
void nearestRotationsCold(const RotationBatch<double>& batch, InstructionSet set);

}  // namespace meshless
