#include "meshless_surgery/geometry/mesh/main_axes.h"

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/primitives.h"
#include "support/random.h"

namespace meshless {
namespace main_axes_test {

// The same directions, in any order and with any sign.
double off(const Mat3& axes, const Mat3& wanted) {
  return ((axes.transpose() * wanted).cwiseAbs().array().round().matrix() - (axes.transpose() * wanted).cwiseAbs())
      .cwiseAbs()
      .maxCoeff();
}

TEST(MainAxes, OfABoxAreItsEdgesHoweverItIsTurned) {
  test::Random random(5);
  for (const Vec3& size : {Vec3(0.2, 0.05, 0.05), Vec3(0.1, 0.1, 0.1), Vec3(0.1, 0.04, 0.01)})
    for (int n = 0; n < 20; ++n) {
      const Mat3 turn = random.rotation().toRotationMatrix();
      TriangleMesh mesh = boxMesh(size, 2, 2, 2);
      for (Vec3& v : mesh.vertices) v = turn * v;
      const Mat3 axes = mainAxes(mesh);
      EXPECT_NEAR(axes.determinant(), 1.0, 1e-12);
      EXPECT_LT(off(axes, turn), 1e-9) << size.transpose();
    }
}

TEST(MainAxes, WhatLiesAlongItsOwnAxesKeepsThemToTheBit) {
  EXPECT_EQ(mainAxes(boxMesh(Vec3(0.2, 0.05, 0.05), 4, 2, 2)), Mat3(Mat3::Identity()));
  EXPECT_EQ(mainAxes(sphereMesh(0.1, 0.02)), Mat3(Mat3::Identity()));
}

}  // namespace main_axes_test
}  // namespace meshless
