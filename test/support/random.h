// Seeded random values for tests: the same in every run and on every machine.
#pragma once

#include <random>

#include "meshless_surgery/base/types.h"

namespace meshless::test {

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}

  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_()) / 4294967295.0);
  }
  int integer(int low, int high) { return low + static_cast<int>(engine_() % static_cast<unsigned>(high - low + 1)); }
  Vec3 vector(double size) { return Vec3(uniform(-size, size), uniform(-size, size), uniform(-size, size)); }
  Vec3 unit() {
    while (true) {
      const Vec3 v = vector(1.0);
      if (v.norm() > 0.1 && v.norm() <= 1.0) return v.normalized();
    }
  }
  Quat rotation() {
    while (true) {
      const Eigen::Vector4d q(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
      if (q.norm() > 0.1 && q.norm() <= 1.0) return Quat(q.normalized());
    }
  }
  Mat3 matrix(double size) {
    Mat3 m;
    for (int k = 0; k < 9; ++k) m(k / 3, k % 3) = uniform(-size, size);
    return m;
  }

 private:
  std::mt19937 engine_;
};

}  // namespace meshless::test
