#include "meshless_surgery/body/binding.h"

#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/bodies.h"

namespace meshless {
namespace binding_test {

Points moved(const Points& points, const Mat3& map, const Vec3& shift) {
  Points result;
  for (const Vec3& p : points) result.push_back(map * p + shift);
  return result;
}

TEST(FewerCarriers, VerticesStayWhereTheyAreUnderEveryAffineMotion) {
  Mat3 map;
  map << 1.2, 0.1, 0, -0.1, 0.9, 0.05, 0, 0.1, 1.1;
  const Vec3 shift(1, -2, 3);
  std::vector<shapes::Shape> all_shapes = shapes::simpleShapes();
  all_shapes.push_back({"fine sphere", sphereMesh(0.1, 0.0042)});
  for (const shapes::Shape& shape : all_shapes) {
    SCOPED_TRACE(shape.name);
    const double size = boundsOf(shape.mesh.vertices).diagonal();
    BodyDef def = test::defOf(shape.mesh);
    def.spacing = std::min(size / 12.0, 2.0 * signedVolume(shape.mesh) / surfaceArea(shape.mesh));
    const PreparedBody body = test::prepared(def);
    const BodyModel& m = *body.model;
    const SurfaceBinding& all = m.binding;
    ASSERT_GT(all.size(), 0u);
    const SurfaceBinding few = fewerCarriers(all, m.rest, m.spacing);
    ASSERT_EQ(few.offsets.size(), all.offsets.size());
    const Points positions = moved(m.rest, map, shift);
    std::size_t many = 0;
    for (Index r = 0; r < all.size(); ++r) {
      double magnitude = 0.0, before = 0.0;
      for (Index k = few.offsets[r]; k < few.offsets[r + 1]; ++k) magnitude += std::abs(few.weights[k]);
      for (Index k = all.offsets[r]; k < all.offsets[r + 1]; ++k) before += std::abs(all.weights[k]);
      EXPECT_LT(magnitude, 1.5 * before) << "what carries a vertex far outside throws it";
      many += few.offsets[r + 1] - few.offsets[r] > 8;
      EXPECT_LT((few.place(r, positions) - all.place(r, positions)).norm(),
                1e-9 * size);
    }
    EXPECT_LE(20 * many, all.size());
  }
}

TEST(OwnVertices, AreWhereTheirParticlesAre) {
  const Points particles = {{0.1, 0.2, 0.3}, {-1.0, 1e-9, 7.0}, {3.0, 3.0, 3.0}};
  Points places, forces(3, Vec3::Zero());
  carriedPlaces(ownVertices(3), particles, places);
  EXPECT_EQ(places, particles);
  addToParticles(ownVertices(3), particles, forces);
  EXPECT_EQ(forces, particles);
}

}  // namespace binding_test
}  // namespace meshless
