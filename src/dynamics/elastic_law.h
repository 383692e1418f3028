// The law of stress that clusters and cells share. Private to dynamics; elastic_batch_kernel.h has it in vectors.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "cofactor.h"
#include "elastic_constants.h"
#include "meshless_surgery/dynamics/elastic.h"

namespace meshless::elastic_law {

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

// W(q) that begins as q and whose slope W' grows with `by` q, to kMostStiffening at most.
struct Stiffened {
  double energy, slope;  // W, W'
  double growth;         // W''
};
inline Stiffened stiffened(double by, double q) {
  const double rate = by / (kMostStiffening - 1.0), z = rate * q, grown = 1.0 / (1.0 + z);
  // The integral of W', by its series where the closed form cancels.
  const double excess = z < 1e-3 ? z * z * (0.5 - z * (1.0 / 3.0 - z * (0.25 - 0.2 * z))) : z - std::log1p(z);
  return {q + (rate > 0.0 ? (kMostStiffening - 1.0) * excess / rate : 0.0), 1.0 + by * q * grown, by * grown * grown};
}

// What shear and stretch cost without change of volume: over mu.
struct Distortion {
  double energy = 0.0;
  Mat3 slope = Mat3::Zero();  // by F
  double curvature = 2.0;     // its second derivative by the strain, at most
};
inline Distortion distortion(const ElasticParameters& material, const Mat3& f, const Mat3& rotation) {
  const Mat3 off = f - rotation;
  if (!material.stiffens()) return {off.squaredNorm(), 2.0 * off, 2.0};
  const double trace = rotation.cwiseProduct(off).sum();
  const Mat3 d = off - trace / 3.0 * rotation, strain = rotation.transpose() * d, square = d * strain;  // R d, d, R d^2
  const double m = d.squaredNorm(), c = square.cwiseProduct(d).sum(), a = material.asymmetry;
  const double level = 1.0 / (1.0 + a * a * m / kLevel), u = std::sqrt(level), fourth = kFourth * a * a * m * level;
  const double q = m + trace * trace / 3.0 - a * c * u + fourth * m;
  const double by_m = 1.0 + 0.5 * a * c * u * level * a * a / kLevel + fourth * (1.0 + level), by_c = -a * u;
  const Stiffened w = stiffened(material.stiffening, q);
  const Mat3 by_f = (2.0 / 3.0 * trace - by_c * m) * rotation + 2.0 * by_m * d + 3.0 * by_c * square;
  Distortion result;
  result.slope = w.slope * by_f;
  const double x = a * a * m;
  result.curvature = w.slope * (2.0 + (kCurved - 2.0) * x / (kCurvedFrom + x)) + w.growth * by_f.squaredNorm();
  result.energy = w.energy;
  return result;
}

// Relaxation: of mu times what the deviator d of the strain costs, each branch has its share of |d - what it has taken
// on|^2, and the law above has the rest. So energy never grows, as what a branch takes on follows d.
inline std::array<double, 6> deviatorOf(const Mat3& f, const Mat3& rotation) {
  const Mat3 strain = rotation.transpose() * f;
  const double mean = strain.trace() / 3.0;
  return {strain(0, 0) - mean,
          strain(1, 1) - mean,
          strain(2, 2) - mean,
          0.5 * (strain(0, 1) + strain(1, 0)),
          0.5 * (strain(1, 2) + strain(2, 1)),
          0.5 * (strain(2, 0) + strain(0, 2))};
}
inline Mat3 symmetric(const std::array<double, 6>& v) {
  Mat3 m;
  m << v[0], v[3], v[5], v[3], v[1], v[4], v[5], v[4], v[2];
  return m;
}
// The slope by F of sum of shares of (what a branch has taken on) : d. What was taken on need not have the axes of the
// strain, so that the rotation of F counts: without it stress would turn the cell.
inline Mat3 takenOn(const RelaxationStep& step, const RelaxedStrain& relaxed, const Mat3& f, const Mat3& rotation) {
  std::array<double, 6> sum{};
  for (int k = 0; k < step.branches; ++k)
    for (int c = 0; c < 6; ++c) sum[c] += step.shares[k] * relaxed.of[k][c];
  const Mat3 taken = symmetric(sum), stretch = rotation.transpose() * f, turning = stretch * taken;
  Mat3 k = stretch.trace() * Mat3::Identity() - stretch;
  k = 0.5 * (k + k.transpose()).eval();
  const double determinant = k.determinant(), trace = k.trace();
  Mat3 slope = taken;
  if (determinant > kTurns * trace * trace * trace) {  // else the rotation is of no use
    const Vec3 axis(turning(2, 1) - turning(1, 2), turning(0, 2) - turning(2, 0), turning(1, 0) - turning(0, 1));
    const Vec3 u = cofactor(k) * axis / determinant;
    slope(0, 1) -= u.z(), slope(0, 2) += u.y(), slope(1, 2) -= u.x();
    slope(1, 0) += u.z(), slope(2, 0) -= u.y(), slope(2, 1) += u.x();
  }
  return rotation * slope;
}
// What branches follow: d as far as a strain of 1. What was torn far and long would throw itself apart later.
inline std::array<double, 6> followed(std::array<double, 6> d) {
  if (const double size = symmetric(d).norm(); size > 1.0)
    for (double& component : d) component /= size;
  return d;
}
// Exact where d stays: so stress after it has changed falls as the series says, whatever the step is.
inline void takeOn(const RelaxationStep& step, const std::array<double, 6>& d, RelaxedStrain& relaxed) {
  const std::array<double, 6> goal = followed(d);
  for (int k = 0; k < step.branches; ++k)
    for (int c = 0; c < 6; ++c) relaxed.of[k][c] += step.taken[k] * (goal[c] - relaxed.of[k][c]);
  for (std::size_t k = static_cast<std::size_t>(step.branches); k < kMostRelaxations; ++k) relaxed.of[k] = {};
}

// First Piola-Kirchhoff stress of the fixed-corotated law. `steepness`: the square of how much faster than at rest the
// pressure makes the cluster, times 3.
inline Mat3 stress(const ElasticParameters& material, const Mat3& f, const Mat3& rotation, double& steepness,
                   const RelaxedStrain* relaxed = nullptr) {
  const HeldVolume held = heldVolume(f);
  const double strain = volumeStrain(held.j);
  steepness = held.slope.squaredNorm() + std::abs(strain) * held.share * f.norm();
  const Distortion distorted = distortion(material, f, rotation);
  if (material.stiffens())
    steepness = std::max(steepness, 3.0 * (material.lambda * steepness + material.mu * distorted.curvature) /
                                        (3.0 * material.lambda + 2.0 * material.mu));
  Mat3 slope = distorted.slope;
  if (relaxed) {
    const double all = material.relaxation.all;
    slope =
        (1.0 - all) * slope + 2.0 * all * (f - rotation) - 2.0 * takenOn(material.relaxation, *relaxed, f, rotation);
  }
  return material.mu * slope + material.lambda * strain * held.slope;
}

// Its energy per volume.
inline double energyDensity(const ElasticParameters& material, const Mat3& f, const Mat3& rotation,
                            const RelaxedStrain* relaxed = nullptr) {
  double distorted = distortion(material, f, rotation).energy;
  if (relaxed) {
    const std::array<double, 6> d = deviatorOf(f, rotation);
    const double trace = rotation.cwiseProduct(f).sum() - 3.0, all = material.relaxation.all;
    distorted = (1.0 - all) * distorted + all * trace * trace / 3.0;
    for (int k = 0; k < material.relaxation.branches; ++k) {
      std::array<double, 6> left{};
      for (int c = 0; c < 6; ++c) left[c] = d[c] - relaxed->of[k][c];
      distorted += material.relaxation.shares[k] * symmetric(left).squaredNorm();
    }
  }
  return material.mu * distorted + material.lambda * volumeEnergy(heldVolume(f).j);
}

// Fibres along a unit vector `along` at rest: k / 2 W((|F a| - 1)^2) where they are longer than at rest. Their slope by
// F is added to the stress, and to `steepness` what they may have grown steeper by than at rest.
inline void pullFibres(const ElasticParameters& material, const Mat3& f, const Vec3& along, Mat3& stress,
                       double& steepness) {
  const Vec3 drawn = f * along;
  const double length = drawn.norm(), longer = length - 1.0;
  if (!(longer > 0.0)) return;
  const Stiffened w = stiffened(material.fibre_stiffening, longer * longer);
  stress += material.fibres * longer * w.slope / length * drawn * along.transpose();
  steepness = std::max(steepness, 3.0 * (w.slope + 2.0 * longer * longer * w.growth));
}
inline double fibreEnergy(const ElasticParameters& material, const Mat3& f, const Vec3& along) {
  const double longer = std::max(0.0, (f * along).norm() - 1.0);
  return 0.5 * material.fibres * stiffened(material.fibre_stiffening, longer * longer).energy;
}

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
