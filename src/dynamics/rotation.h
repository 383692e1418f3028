// The rotation nearest to a 3x3 matrix.
#pragma once

#include "meshless_surgery/base/types.h"

namespace meshless {

struct RotationResult {
  Quat rotation = Quat::Identity();
  bool unique = true;  // false: rank <= 1 or a symmetric inversion; the guess was kept
  bool warm = true;    // found from the guess, without the exact fallback
};

/// Maximises tr(R^T a) over rotations: the absolute-orientation problem, valid for inverted input too. First a few
/// Newton steps on the rotation vector from the guess (Kugelstadt et al. 2018), accepted where they verify themselves
/// as the maximum; else the eigenvector of the largest eigenvalue of the 4x4 profile matrix (Horn 1987). Scale-free:
/// tolerances are relative to |a|. A non-finite or zero matrix keeps the guess.
RotationResult nearestRotation(const Mat3& a, const Quat& guess);

/// The exact method alone.
RotationResult nearestRotationExact(const Mat3& a, const Quat& guess);

}  // namespace meshless
