#include "smoothness.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>

namespace meshless {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kMostFrequency = 10.0, kLeastMagnitude = 0.05;
constexpr int kPadding = 4;  // powers of two

// In place, of a power of two.
void transform(std::vector<std::complex<double>>& x) {
  const std::size_t n = x.size();
  for (std::size_t i = 1, j = 0; i < n; ++i) {
    std::size_t bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) std::swap(x[i], x[j]);
  }
  for (std::size_t length = 2; length <= n; length <<= 1) {
    const double angle = -2.0 * M_PI / static_cast<double>(length);
    for (std::size_t k = 0; k < length / 2; ++k) {
      const std::complex<double> turn = std::polar(1.0, angle * static_cast<double>(k));
      for (std::size_t at = k; at < n; at += length) {
        const std::complex<double> even = x[at], odd = turn * x[at + length / 2];
        x[at] = even + odd;
        x[at + length / 2] = even - odd;
      }
    }
  }
}

}  // namespace

double spectralArcLength(const std::vector<double>& speeds, double rate) {
  std::size_t size = 1;
  while (size < speeds.size()) size <<= 1;
  size <<= kPadding;
  std::vector<std::complex<double>> spectrum(size);
  std::copy(speeds.begin(), speeds.end(), spectrum.begin());
  transform(spectrum);
  const double step = rate / static_cast<double>(size);
  std::vector<double> magnitude;
  for (std::size_t k = 0; k < size && static_cast<double>(k) * step <= kMostFrequency; ++k)
    magnitude.push_back(std::abs(spectrum[k]));
  double most = 0.0;
  for (std::size_t k = 0; k < size; ++k) most = std::max(most, std::abs(spectrum[k]));
  if (!(most > 0.0)) return kNone;
  std::size_t last = 0, first = magnitude.size();
  for (std::size_t k = 0; k < magnitude.size(); ++k) {
    magnitude[k] /= most;
    if (magnitude[k] < kLeastMagnitude) continue;
    first = std::min(first, k);
    last = k;
  }
  if (!(last > first)) return kNone;
  double length = 0.0;
  for (std::size_t k = first; k < last; ++k)
    length += std::hypot(1.0 / static_cast<double>(last - first), magnitude[k + 1] - magnitude[k]);
  return -length;
}

double logDimensionlessJerk(const Points& velocities, double rate) {
  if (velocities.size() < 4) return kNone;
  double peak = 0.0, squares = 0.0;
  for (const Vec3& v : velocities) peak = std::max(peak, v.norm());
  if (!(peak > 0.0)) return kNone;
  for (std::size_t k = 1; k + 1 < velocities.size(); ++k)
    squares += ((velocities[k + 1] - 2.0 * velocities[k] + velocities[k - 1]) * rate * rate).squaredNorm() / rate;
  const double duration = static_cast<double>(velocities.size()) / rate;
  const double jerk = duration * duration * duration / (peak * peak) * squares;
  return jerk > 0.0 ? -std::log(jerk) : kNone;
}

double bandAmplitude(const Points& positions, double rate, double from, double to) {
  const std::size_t n = positions.size();
  if (n < 4) return 0.0;
  // Least squares of a straight line over even samples.
  const double middle = 0.5 * static_cast<double>(n - 1);
  Vec3 mean = Vec3::Zero(), slope = Vec3::Zero();
  double spread = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    const double t = static_cast<double>(k) - middle;
    mean += positions[k] / static_cast<double>(n);
    slope += t * positions[k];
    spread += t * t;
  }
  slope /= spread;
  std::vector<double> window(n);
  double power = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    window[k] = 0.5 - 0.5 * std::cos(2.0 * M_PI * static_cast<double>(k) / static_cast<double>(n));
    power += window[k] * window[k];
  }
  double squares = 0.0;  // of all axes
  const double step = rate / static_cast<double>(n);
  for (auto bin = static_cast<std::size_t>(std::ceil(from / step - 1e-9));
       static_cast<double>(bin) * step <= to + 1e-9 && 2 * bin < n; ++bin) {
    const double angle = 2.0 * M_PI * static_cast<double>(bin) / static_cast<double>(n);
    Vec3 real = Vec3::Zero(), imaginary = Vec3::Zero();
    for (std::size_t k = 0; k < n; ++k) {
      const Vec3 p = window[k] * (positions[k] - mean - (static_cast<double>(k) - middle) * slope);
      real += std::cos(angle * static_cast<double>(k)) * p;
      imaginary += std::sin(angle * static_cast<double>(k)) * p;
    }
    squares += 2.0 * (real.squaredNorm() + imaginary.squaredNorm()) / (static_cast<double>(n) * power);
  }
  return std::sqrt(2.0 * squares);
}

}  // namespace meshless
