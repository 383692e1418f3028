#include "meshless_surgery/dynamics/material.h"

#include <gtest/gtest.h>

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

TEST(StiffnessGain, IsAlphaAtTheReferenceStepBoundedAndOfOneStiffnessBelow) {
  for (double alpha : {0.0, 0.1, 0.5, 0.9, 1.0}) EXPECT_NEAR(stiffnessGain(alpha, 1.0 / 60.0), alpha, 1e-15);
  for (double alpha : {0.1, 0.5, 0.9})
    for (double h : {1e-5, 1e-3, 1.0 / 60.0, 0.1, 1.0}) {
      EXPECT_GT(stiffnessGain(alpha, h), 0.0);
      EXPECT_LE(stiffnessGain(alpha, h), 1.0);
    }
  // gain / h^2 is the squared frequency: it settles as the step shrinks.
  const auto frequency = [](double h) { return stiffnessGain(0.5, h) / (h * h); };
  EXPECT_NEAR(frequency(1e-4) / frequency(1e-5), 1.0, 1e-3);
  EXPECT_EQ(stiffnessGain(1.0, 1e-3), 1.0);
}

}  // namespace material_test
}  // namespace meshless
