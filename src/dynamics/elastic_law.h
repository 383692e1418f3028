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

constexpr double kModeSquare = 2.0 / 3.0;  // of an edge along each of two axes, in the mean over three

// Of a cell: how its energy per volume changes with the coefficients of the products of two or three coordinates, each
// named by the bits of its axes, and through what measures them with the gradient. Lengths in half edges.
struct Bending {
  Vec3 by_mode[8];
  Mat3 by_gradient;
  double energy = 0.0;
};

// The cell is three plates at once: how strain along two axes varies along the third costs what it costs a plate in
// plane stress. Strain is measured along the columns of F, over a length of the cell's edges, so that the energy turns
// with the cell and does not grow with its stretch. That length is nearly the longest stretch of F, and counts how the
// edges differ; and what all directions have in common needs no columns. So no state is much stiffer than rest, and
// none softens so much that the viscosity would feed what was crushed or thrown apart.
inline Bending bending(const ElasticParameters& material, const Mat3& f, const Vec3& variance, const Vec3 (&modes)[8]) {
  Bending result;
  const Mat3 products = f.transpose() * f;
  const double columns = f.squaredNorm(), longest = columns > 0.0 ? products.squaredNorm() / columns : 0.0;
  double square = longest;
  for (const int mode : {3, 5, 6}) square += kModeSquare * modes[mode].squaredNorm();
  const double scale = square > 0.0 ? 1.0 / std::sqrt(square) : 0.0;
  const double coupling = material.lambda / (material.lambda + 2.0 * material.mu);
  const double common = material.mu * variance.minCoeff();  // the least that any direction costs
  Vec3 b[8], slope[8];
  for (const int mode : {3, 5, 6}) {
    b[mode] = scale * (f.transpose() * modes[mode]);
    slope[mode] = -common * b[mode];
  }
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3, ik = 1 << i | 1 << k, jk = 1 << j | 1 << k;
    const double stiffness = 2.0 * material.mu * variance[k];
    const double both = coupling * (b[ik][i] + b[jk][j]), twist = 0.5 * stiffness * (b[jk][i] + b[ik][j]);
    slope[ik][i] += stiffness * (b[ik][i] + both);
    slope[jk][j] += stiffness * (b[jk][j] + both);
    slope[jk][i] += twist;
    slope[ik][j] += twist;
  }
  result.by_gradient.setZero();
  double twice = 0.0;
  for (const int mode : {3, 5, 6}) {
    result.by_gradient += scale * modes[mode] * slope[mode].transpose();
    twice += b[mode].dot(slope[mode]);
  }
  if (columns > 0.0) result.by_gradient -= twice / (square * columns) * (2.0 * f * products - longest * f);
  const double less = square > 0.0 ? kModeSquare * twice / square : 0.0;
  for (const int mode : {3, 5, 6}) {
    result.by_mode[mode] = scale * (f * slope[mode]) + (common - less) * modes[mode];
    result.energy += 0.5 * common * modes[mode].squaredNorm();
  }
  result.by_mode[7] = 2.0 * common * modes[7];
  result.energy += 0.5 * (twice + result.by_mode[7].dot(modes[7]));
  return result;
}

}  // namespace meshless::elastic_law
