#include "meshless_surgery/geometry/mesh/measures.h"

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/primitives.h"
#include "support/shapes.h"

namespace meshless {
namespace measures_test {

TEST(Measures, OfABoxAreThoseOfTheFormula) {
  const TriangleMesh box = boxMesh(Vec3(0.2, 0.3, 0.5), 3, 4, 5);
  EXPECT_NEAR(signedVolume(box), 0.03, 1e-14);
  EXPECT_NEAR(surfaceArea(box), 2 * (0.06 + 0.10 + 0.15), 1e-14);
  EXPECT_LT(solidCentroid(box).norm(), 1e-14);
  EXPECT_EQ(signedVolume(TriangleMesh()), 0.0);
  EXPECT_EQ(surfaceArea(TriangleMesh()), 0.0);
  EXPECT_EQ(meanEdgeLength(TriangleMesh()), 0.0);
  EXPECT_TRUE(boundsOf({}).empty());
}

TEST(Measures, MoveTurnAndScaleWithTheShape) {
  const double scale = 3.0;
  for (const shapes::Shape& shape : shapes::allShapes()) {
    SCOPED_TRACE(shape.name);
    for (const double far : {0.0, 1000.0}) {
      Pose pose = shapes::anyPose();
      pose.translation += Vec3(far, -far, far);
      const TriangleMesh moved = shapes::moved(shape.mesh, pose, scale);
      const double volume = signedVolume(shape.mesh), area = surfaceArea(shape.mesh);
      EXPECT_GT(volume, 0.0);
      EXPECT_NEAR(signedVolume(moved) / (volume * scale * scale * scale), 1.0, far > 0.0 ? 1e-8 : 1e-12);
      EXPECT_NEAR(surfaceArea(moved) / (area * scale * scale), 1.0, far > 0.0 ? 1e-8 : 1e-12);
      EXPECT_NEAR(meanEdgeLength(moved) / (meanEdgeLength(shape.mesh) * scale), 1.0, far > 0.0 ? 1e-8 : 1e-12);
      const Vec3 centre = pose * Vec3(scale * solidCentroid(shape.mesh));
      EXPECT_LT((solidCentroid(moved) - centre).norm(), far > 0.0 ? 1e-7 : 1e-12);
    }
    EXPECT_NEAR(signedVolume(shapes::turnedInsideOut(shape.mesh)), -signedVolume(shape.mesh),
                1e-12 * signedVolume(shape.mesh));
  }
}

}  // namespace measures_test
}  // namespace meshless
