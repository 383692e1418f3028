// The law of stress that clusters and cells share. Private to dynamics; elastic_batch_kernel.h has it in vectors.
#pragma once

#include <algorithm>
#include <cmath>

#include "cofactor.h"
#include "meshless_surgery/dynamics/elastic.h"

namespace meshless::elastic_law {

constexpr double kLeastVolume = -0.8;  // J below which the pressure does not grow
constexpr double kMostVolume = 1.5;    // J above which it falls
constexpr double kDrawnOut = 12.0;     // |F|^2, 3 at rest, above which the volume counts less and less

// Pressure over lambda, a function of J alone: so it has a potential, whatever the bounds. Above them it falls as cof F
// grows, or a torn cell would stiffen without end.
inline double volumeStrain(double j) {
  if (j > kMostVolume) return (kMostVolume - 1.0) * std::pow(kMostVolume / j, 2.0 / 3.0);
  return std::max(j, kLeastVolume) - 1.0;
}
inline double volumeEnergy(double j) {
  if (j > kMostVolume) {
    const double strain = kMostVolume - 1.0;
    return 0.5 * strain * strain + 3.0 * strain * kMostVolume * (std::cbrt(j / kMostVolume) - 1.0);
  }
  const double strain = std::max(j, kLeastVolume) - 1.0;
  return 0.5 * strain * strain + (j < kLeastVolume ? strain * (j - kLeastVolume) : 0.0);
}

// The volume that is held: J, and of what is drawn out far the share J s(|F|^2). Without it the pressure of a needle or
// a sheet stiffens with the square of its length, beyond what any step resolves: torn cells threw themselves apart.
struct HeldVolume {
  double j = 1.0;
  Mat3 slope = Mat3::Zero();  // by F
  double share = 1.0;
};
inline HeldVolume heldVolume(const Mat3& f) {
  HeldVolume held;
  held.slope = cofactor(f);
  held.j = f.determinant();
  const double beyond = f.squaredNorm() / kDrawnOut - 1.0;
  if (!(beyond > 0.0)) return held;
  const double base = 1.0 + beyond * beyond;
  held.share = 1.0 / (std::sqrt(base) * std::sqrt(std::sqrt(base)));  // base^(-3/4): J s stays bounded
  held.slope = held.share * (held.slope - (3.0 * beyond / (base * kDrawnOut) * held.j) * f);
  held.j *= held.share;
  return held;
}

// First Piola-Kirchhoff stress of the fixed-corotated law. `steepness`: the square of how much faster than at rest the
// pressure makes the cluster, times 3.
inline Mat3 stress(const ElasticParameters& material, const Mat3& f, const Mat3& rotation, double& steepness) {
  const HeldVolume held = heldVolume(f);
  const double strain = volumeStrain(held.j);
  steepness = held.slope.squaredNorm() + std::abs(strain) * held.share * f.norm();
  return 2.0 * material.mu * (f - rotation) + material.lambda * strain * held.slope;
}

// Its energy per volume.
inline double energyDensity(const ElasticParameters& material, const Mat3& f, const Mat3& rotation) {
  return material.mu * (f - rotation).squaredNorm() + material.lambda * volumeEnergy(heldVolume(f).j);
}

// Of a cell's hourglass mode in units of E: the product of the coordinates whose bits are set in `mode`.
constexpr int kHourglassModes[4] = {3, 5, 6, 7};
inline double hourglassStiffness(const Vec3& variance, int mode) {
  double least = variance.maxCoeff();
  for (int axis = 0; axis < 3; ++axis)
    if (mode >> axis & 1) least = std::min(least, variance[axis]);
  return 0.9 * least;
}

}  // namespace meshless::elastic_law
