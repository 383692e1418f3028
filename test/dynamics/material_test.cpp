#include "meshless_surgery/dynamics/material.h"

#include <gtest/gtest.h>

#include <complex>
#include <limits>

namespace meshless {
namespace material_test {

TEST(Material, RefusesEachValueOutOfRangeByNameAndRange) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(Material().validate().ok());
  struct Case {
    double Material::*member;
    const char* key;
    std::vector<double> bad;
  };
  for (const Case& c : {Case{&Material::alpha, "alpha", {-0.1, 1.1, nan}}, Case{&Material::beta, "beta", {-1, 2, nan}},
                        Case{&Material::density, "density", {0, -5, 2e6, nan}},
                        Case{&Material::damping, "damping", {-1, nan}}, Case{&Material::friction, "friction", {-1, 11, nan}}})
    for (double value : c.bad) {
      Material m;
      m.*c.member = value;
      const Status status = m.validate();
      ASSERT_FALSE(status.ok()) << c.key << " " << value;
      EXPECT_NE(status.error().detail.find(c.key), std::string::npos);
      EXPECT_NE(status.error().detail.find("accepted"), std::string::npos);
    }
}

// [1] where a mode whose goal is 0 is after a while, let go at 1.
double letGo(double alpha, double h, double time) {
  const GoalPull goal = goalPull(alpha, h);
  double before = 1.0, x = 1.0;
  for (int step = 0; step < std::lround(time / h); ++step) {
    const double v = (x - before) / h, there = x + h * v;
    before = x;
    x = there - goal.gain * (there + goal.lead * v);
  }
  return x;
}

TEST(GoalPull, SwingsAlikeWhateverTheStep) {
  for (double alpha : {0.1, 0.5, 0.9, 0.99, 0.9999})
    for (double time : {0.05, 0.2}) {
      const double rate = -std::log1p(-alpha) * 60.0, fine = letGo(alpha, 1e-5, time);
      const std::complex<double> root = std::sqrt(std::complex<double>(0.25 * rate * rate - 60.0 * rate));
      const std::complex<double> a = -0.5 * rate + root, b = -0.5 * rate - root;
      EXPECT_NEAR(fine, ((a * std::exp(b * time) - b * std::exp(a * time)) / (a - b)).real(), 1e-2) << alpha;
      for (double h : {1e-4, 1e-3, 1.0 / 480, 1.0 / 120}) EXPECT_NEAR(letGo(alpha, h, time), fine, 60.0 * h) << alpha << ", " << h;
    }
}

// As much as under the spring's own stiffness, or less.
TEST(GoalPull, CarriesASteadyLoadInAnyStep) {
  for (double alpha : {0.1, 0.5, 0.9, 0.99, 0.9999})
    for (double h : {1e-4, 1e-3, 1.0 / 480, 1.0 / 120, 1.0 / 60}) {
      const GoalPull goal = goalPull(alpha, h);
      double x = 0.0, v = 0.0;
      for (int step = 0; step < 10.0 / h; ++step) {
        v += h * 9.81;
        const double there = x + h * v, moved = there - goal.gain * (there + goal.lead * v);
        v = (moved - x) / h;
        x = moved;
      }
      const double sag = 9.81 / (-std::log1p(-alpha) * 3600.0);
      EXPECT_LT(x, 1.01 * sag) << alpha << ", " << h;
      if (h <= 1e-4) EXPECT_GT(x, 0.9 * sag) << alpha;
    }
}

TEST(GoalPull, NoStepMakesItSwingHigher) {
  for (double alpha : {0.0, 0.01, 0.5, 0.9, 1.0})
    for (double h : {1e-3, 1.0 / 60, 0.2, 1.0, 10.0}) {
      const GoalPull goal = goalPull(alpha, h);
      double x = 0.0, v = 1.0, fastest = 1.0;
      for (int step = 0; step < 1000; ++step) {
        const double there = x + h * v, moved = there - goal.gain * (there + goal.lead * v);
        v = (moved - x) / h;
        x = moved;
        fastest = std::max(fastest, std::abs(v));
      }
      EXPECT_LE(fastest, 1.0 + 1e-12) << alpha << ", " << h;
    }
}

}  // namespace material_test
}  // namespace meshless
