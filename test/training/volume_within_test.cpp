#include "training/volume_within.h"

#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/plane_cut.h"
#include "support/shapes.h"

namespace meshless {
namespace volume_within_test {

constexpr double kWithin = 1e-3;  // of the solid's volume

TEST(VolumeWithin, OfABoxIsThatOfItsFormula) {
  const TriangleMesh box = boxMesh(Vec3(0.2, 0.1, 0.06), 0.01);
  const double whole = 0.2 * 0.1 * 0.06;
  EXPECT_NEAR(whole, volumeWithin(box, Region(Vec3::Constant(-1.0), Vec3::Constant(1.0))), 1e-12);
  EXPECT_EQ(0.0, volumeWithin(box, Region(Vec3::Constant(0.5), Vec3::Constant(1.0))));
  EXPECT_NEAR(0.03 * 0.02 * 0.01, volumeWithin(box, Region(Vec3(0.01, 0.01, 0.01), Vec3(0.04, 0.03, 0.02))),
              kWithin * whole);
  EXPECT_NEAR(0.05 * 0.02 * 0.02, volumeWithin(box, Region(Vec3(0.05, 0.03, 0.01), Vec3(1, 1, 1))), kWithin * whole);
  EXPECT_NEAR(4.0 / 3.0 * M_PI * 8e-6, volumeWithin(box, Region::sphere(Vec3(0.03, 0.01, 0), 0.02)), kWithin * whole);
  EXPECT_NEAR(2.0 / 3.0 * M_PI * 8e-6, volumeWithin(box, Region::sphere(Vec3(0.1, 0.0, 0), 0.02)), kWithin * whole);
  for (const Vec3& normal : {Vec3(1, 0, 0), Vec3(0, -1, 0), Vec3(0, 0, 1), Vec3(0, 0, -1)})
    EXPECT_NEAR(0.5 * whole, volumeWithin(box, Region::below({normal, Vec3::Zero()})), kWithin * whole);
}

TEST(VolumeWithin, BelowAPlaneIsThatOfTheCut) {
  for (const shapes::Shape& shape : shapes::simpleShapes()) {
    const Vec3 normal = Vec3(0.3, -0.5, 0.8).normalized(), middle = solidCentroid(shape.mesh);
    const auto cut = cutByPlane(shape.mesh, {normal, middle});
    if (!cut) continue;
    double below = 0.0;
    for (const CutPiece& piece : cut->pieces)
      if (piece.side < 0) below += signedVolume(piece.mesh);
    EXPECT_NEAR(below, volumeWithin(shape.mesh, Region::below({normal, middle})), kWithin * signedVolume(shape.mesh))
        << shape.name;
  }
}

}  // namespace volume_within_test
}  // namespace meshless
