#include "training/smoothness.h"

#include <cmath>

#include <gtest/gtest.h>

namespace meshless {
namespace {

// Flash and Hogan 1985: x = D (10 u^3 - 15 u^4 + 6 u^5), u = t / T.
std::vector<double> minimumJerkSpeeds(double distance, double duration, double rate) {
  std::vector<double> speeds;
  for (int k = 0; k <= static_cast<int>(std::round(duration * rate)); ++k) {
    const double u = k / (duration * rate);
    speeds.push_back(distance / duration * 30.0 * u * u * (1.0 - u) * (1.0 - u));
  }
  return speeds;
}

Points along(const std::vector<double>& speeds) {
  Points velocities;
  for (const double speed : speeds) velocities.push_back(speed * Vec3(0.6, 0.0, -0.8));
  return velocities;
}

TEST(LogDimensionlessJerk, OfMinimumJerkIsThatOfItsFormula) {
  // integral of jerk^2 = 720 D^2 / T^5, v_peak = 1.875 D / T.
  const double expected = -std::log(720.0 / (1.875 * 1.875));
  for (const double duration : {0.5, 1.0, 3.0})
    for (const double distance : {0.01, 0.3})
      EXPECT_NEAR(expected, logDimensionlessJerk(along(minimumJerkSpeeds(distance, duration, 1000.0)), 1000.0), 0.03)
          << duration << " s";
}

TEST(SpectralArcLength, IsThatOfThePublishedProgram) {
  // sparc(speeds, 100) of S. Balasubramanian's smoothness.py, padlevel 4, fc 10, amp_th 0.05.
  EXPECT_NEAR(-1.405829324, spectralArcLength(minimumJerkSpeeds(0.1, 1.0, 100.0), 100.0), 1e-6);
  EXPECT_NEAR(-1.405829324, spectralArcLength(minimumJerkSpeeds(0.4, 1.0, 100.0), 100.0), 1e-6);
  std::vector<double> rough = minimumJerkSpeeds(0.1, 1.0, 100.0);
  for (std::size_t k = 0; k < rough.size(); ++k)
    rough[k] += 0.05 * std::sin(2.0 * M_PI * 8.0 * 0.01 * static_cast<double>(k));
  EXPECT_NEAR(-2.310787078, spectralArcLength(rough, 100.0), 1e-6);
}

TEST(Smoothness, OfNothingIsUnknown) {
  EXPECT_TRUE(std::isnan(spectralArcLength(std::vector<double>(50, 0.0), 100.0)));
  EXPECT_TRUE(std::isnan(logDimensionlessJerk(Points(50, Vec3::Zero()), 100.0)));
  EXPECT_TRUE(std::isnan(spectralArcLength({}, 100.0)));
  EXPECT_TRUE(std::isnan(logDimensionlessJerk({}, 100.0)));
}

TEST(BandAmplitude, IsThatOfASineAndNotOfTheWay) {
  for (const double frequency : {5.0, 8.0, 8.3, 12.0}) {
    Points positions;
    for (int k = 0; k < 240; ++k) {
      const double t = k / 120.0;
      positions.push_back(
          Vec3(0.05 * t, 0.03 * std::sin(0.5 * M_PI * t), 0.001 * std::sin(2.0 * M_PI * frequency * t)));
    }
    EXPECT_NEAR(0.001, bandAmplitude(positions, 120.0, 4.0, 14.0), 2e-5) << frequency << " Hz";
  }
}

}  // namespace
}  // namespace meshless
