// Seeded random values: the same on every machine, which those of the standard's distributions are not.
#pragma once

#include <cmath>
#include <random>

#include "meshless_surgery/base/types.h"

namespace meshless {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  /// A sequence of its own for each purpose of one seed: what one purpose draws does not change the others.
  Random(std::uint64_t seed, std::uint64_t purpose) : Random(mixed(seed + mixed(purpose))) {}

  std::uint64_t bits() { return engine_(); }
  double between(double from, double to) {
    return from + (to - from) * static_cast<double>(engine_() >> 11) * 0x1.0p-53;
  }
  /// Evenly spread in their logarithm; from and to above 0.
  double logBetween(double from, double to) { return std::exp(between(std::log(from), std::log(to))); }
  int whole(int from, int to) {
    return from + static_cast<int>(engine_() % (static_cast<std::uint64_t>(to - from) + 1));
  }
  bool chance(double share) { return between(0.0, 1.0) < share; }
  Vec3 inCube(double half) {
    const double x = between(-half, half), y = between(-half, half), z = between(-half, half);
    return {x, y, z};
  }
  Vec3 direction() {
    for (;;) {
      const Vec3 p = inCube(1.0);
      const double squared = p.squaredNorm();
      if (squared > 1e-4 && squared <= 1.0) return p / std::sqrt(squared);
    }
  }
  Quat rotation() {
    const Vec3 axis = direction();
    return Quat(Eigen::AngleAxisd(between(0.0, 3.14159265358979323846), axis));
  }

 private:
  /// splitmix64 (Steele et al. 2014).
  static std::uint64_t mixed(std::uint64_t x) {
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
  }

  std::mt19937_64 engine_;
};

}  // namespace meshless
