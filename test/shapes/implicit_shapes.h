// What implicit organs are made of: distances, blends, unevenness. Private to this room.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "meshless_surgery/base/types.h"

namespace meshless {

/// Union with a fillet about k [m] wide.
inline double blend(double a, double b, double k) {
  const double h = std::max(k - std::abs(a - b), 0.0) / k;
  return std::min(a, b) - 0.25 * k * h * h;
}

/// Distance to an ellipsoid, to first order near its surface.
inline double ellipsoid(const Vec3& p, const Vec3& radii) {
  const Vec3 scaled = p.cwiseQuotient(radii);
  const double norm = scaled.norm();
  const double slope = scaled.cwiseQuotient(radii).norm();
  return slope > 0.0 ? (norm - 1.0) * norm / slope : -radii.minCoeff();
}

/// Smooth, seeded, about -1..1: a few plane waves of wavelengths near `wavelength` [m].
class Unevenness {
 public:
  Unevenness(unsigned seed, double wavelength) {
    constexpr double kTurn = 2.0 * 3.14159265358979323846;
    // mt19937's numbers are the same everywhere, those of the standard distributions are not.
    std::mt19937 random(seed);
    const auto unit = [&] { return static_cast<double>(random()) / 4294967296.0; };
    for (Wave& wave : waves_) {
      const double z = 2.0 * unit() - 1.0, angle = kTurn * unit(), r = std::sqrt(1.0 - z * z);
      wave.number = kTurn / (wavelength * (0.7 + 0.6 * unit())) * Vec3(r * std::cos(angle), r * std::sin(angle), z);
      wave.phase = kTurn * unit();
    }
  }
  double at(const Vec3& p) const {
    double sum = 0.0;
    for (const Wave& wave : waves_) sum += std::sin(wave.number.dot(p) + wave.phase);
    return sum / std::sqrt(static_cast<double>(waves_.size()) * 2.0);
  }

 private:
  struct Wave {
    Vec3 number;
    double phase;
  };
  std::array<Wave, 8> waves_;
};

}  // namespace meshless
