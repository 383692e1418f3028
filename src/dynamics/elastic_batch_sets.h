// What ElasticBatch hands to its kernel: raw pointers into structures of arrays. One entry point for each instruction
// set; each is compiled in a file of its own.
#pragma once

#include <cstddef>
#include <cstdint>

#include "meshless_surgery/dynamics/rotation_batch.h"
#include "rotation_sets.h"

namespace meshless::elastic_sets {

constexpr int kBlock = 64;  // clusters at a time: what is known of them stays in the first-level cache
constexpr int kCorners = 8;

// Rows of kBlock values in Block::shape.
constexpr int kRestRow = 0;                         // q, corner by corner [m]
constexpr int kShareRow = kRestRow + 3 * kCorners;  // m_ic / M_c
constexpr int kInverseRow = kShareRow + kCorners;   // (sum m q q^T / M)^-1: xx xy xz yy yz zz
constexpr int kSoftnessRow = kInverseRow + 6;       // 1 / spread [1/m^2]
constexpr int kShapeRows = kSoftnessRow + 1;

// Rows of kBlock values in Block::cells.
constexpr int kCentroidRow = 0;  // half edges
constexpr int kVarianceRow = kCentroidRow + 3;
constexpr int kCellRows = kVarianceRow + 3;

// Rows of kBlock values in Block::mixes.
constexpr int kOwnRow = 0;              // share of the material of the block
constexpr int kShearRow = kOwnRow + 1;  // what others add to `shear` over `youngs`, and to `pressure`
constexpr int kPressureRow = kShearRow + 1;
constexpr int kStiffeningRow = kPressureRow + 1;  // what others add to these
constexpr int kAsymmetryRow = kStiffeningRow + 1;
constexpr int kMixRows = kAsymmetryRow + 1;

constexpr int kStrainRows = 6;  // in Block::relaxed, of a branch: xx yy zz xy yz zx

// Rows of kBlock values in Block::unstressed.
constexpr int kUnstressedRow = 0;                // PlasticShape::inverse: xx xy xz yy yz zz
constexpr int kSteeperRow = kUnstressedRow + 6;  // the square of its stiffening
constexpr int kUnstressedRows = kSteeperRow + 1;

/// Clusters of at most eight members that span space, by their `shape`; or, where that is null, cubes of one size,
/// their corners in the order of the bits of x, y, z: filled in part as `cells` says, or whole and of the body's
/// material where that is null too. Lanes from count to kBlock repeat a cluster.
struct Block {
  int count = 0;
  const double* positions = nullptr;         // xyz of every particle
  const std::uint32_t* particles = nullptr;  // [kCorners][kBlock]
  const double* masses = nullptr;            // [kBlock]
  const double* shape = nullptr;             // [kShapeRows][kBlock]
  const double* cells = nullptr;             // [kCellRows][kBlock]
  const double* mixes = nullptr;             // [kMixRows][kBlock]; null where all is of the body's material
  const double* unstressed = nullptr;        // [kUnstressedRows][kBlock] of cubes; null: they are at rest without stress
  const double* fibres = nullptr;            // [3][kBlock] of cubes: x y z of their direction; null: there are none
  double fibre = 0.0;                        // their stiffness over rho
  double fibre_stiffening = 0.0;
  double half_edge = 1.0;                    // [m] of the cubes
  double shrink = 1.0;                       // strain is that of F times this
  double shear = 0.0;                        // 2 mu / rho
  double pressure = 0.0;                     // lambda / rho
  double hourglass = 0.0;                    // k E / rho
  double youngs = 0.0;                       // E / rho
  bool stiffens = false;                     // where not, the two below are not read
  double stiffening = 0.0;
  double asymmetry = 0.0;
  int branches = 0;                // of a relaxation; 0: nothing relaxes
  const double* shares = nullptr;  // of each, and their sum
  const double* taken = nullptr;
  double share = 0.0;
  double* relaxed = nullptr;    // [branches][kStrainRows][kBlock], read and written
  double* rotations = nullptr;  // [4][kBlock] x y z w, unit
  double* forces = nullptr;     // [3 * kCorners][kBlock], written
};

struct BlockResult {
  double most = 0.0;  // the largest steepness, see stress() in elastic.cpp
  std::size_t cold = 0;
};

namespace baseline {
BlockResult accelerate(const Block& block);
}
#if MESHLESS_ROTATION_X86
namespace avx2 {
BlockResult accelerate(const Block& block);
}
namespace avx512 {
BlockResult accelerate(const Block& block);
}
#endif

}  // namespace meshless::elastic_sets
