#include "lanczos.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace meshless {
namespace {

constexpr int kSteps = 20;       // within 1 % from below; power iteration needs hundreds
constexpr int kBisections = 40;  // to 1e-12

double dot(const std::vector<double>& masses, const Points& a, const Points& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < masses.size(); ++i) sum += masses[i] * a[i].dot(b[i]);
  return sum;
}

struct Tridiagonal {
  std::array<double, kSteps> diagonal, beside;  // beside[n]: between n and n + 1
  int size = 0;

  // The pivots of T - x: all are negative above the largest eigenvalue.
  bool below(double x) const {
    double pivot = -1.0;
    for (int n = 0; n < size; ++n) {
      pivot = diagonal[n] - x - (n > 0 ? beside[n - 1] * beside[n - 1] / pivot : 0.0);
      if (!(pivot < 0.0)) return false;
    }
    return true;
  }
  double largest() const {
    double low = 0.0, high = 0.0;  // a row's disc reaches no farther
    for (int n = 0; n < size; ++n) {
      low = std::max(low, diagonal[n]);
      high = std::max(high, diagonal[n] + (n > 0 ? beside[n - 1] : 0.0) + (n + 1 < size ? beside[n] : 0.0));
    }
    for (int k = 0; k < kBisections; ++k) {
      const double middle = 0.5 * (low + high);
      (below(middle) ? high : low) = middle;
    }
    return low;
  }
};

}  // namespace

double highestFrequency(const std::vector<double>& masses,
                        const std::function<void(const Points& displacements, Points& accelerations)>& accelerate) {
  const std::size_t n = masses.size();
  // Neighbours against each other, as the highest modes are, and something of every other mode.
  Points mode(n), before(n, Vec3::Zero()), image(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double t = static_cast<double>(i);
    mode[i] = Vec3(std::sin(1.0 + 12.9898 * t), std::sin(2.0 + 78.233 * t), std::sin(3.0 + 37.719 * t));
  }
  Tridiagonal t;
  double length = std::sqrt(dot(masses, mode, mode)), back = 0.0;
  while (t.size < kSteps && length > 0.0) {
    for (Vec3& p : mode) p /= length;
    accelerate(mode, image);
    const double along = -dot(masses, mode, image);
    for (std::size_t i = 0; i < n; ++i) {
      const Vec3 next = -image[i] - along * mode[i] - back * before[i];
      before[i] = mode[i];
      mode[i] = next;
    }
    length = back = std::sqrt(dot(masses, mode, mode));
    t.diagonal[t.size] = along;
    t.beside[t.size++] = length;
    if (!(length > 1e-10 * along)) break;  // no other mode is reached from these
  }
  return std::sqrt(t.largest());
}

}  // namespace meshless
