#include "shapes/random_organ.h"

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "meshless_surgery/geometry/mesh/primitives.h"

namespace meshless {
namespace random_organ_test {

void expectWhatWasAskedFor(std::uint64_t first_seed, std::uint64_t last_seed,
                           const std::vector<std::size_t>& all_triangles) {
  for (int genus = 0; genus <= 3; ++genus)
    for (const std::size_t triangles : all_triangles)
      for (std::uint64_t seed = first_seed; seed <= last_seed; ++seed) {
        SCOPED_TRACE(testing::Message() << "genus " << genus << ", " << triangles << " triangles, seed " << seed);
        const auto mesh = randomOrgan(seed, genus, 0.2, triangles);
        ASSERT_TRUE(mesh.ok()) << mesh.error().detail;
        const MeshReport report = inspectMesh(*mesh);
        EXPECT_TRUE(report.closed());
        EXPECT_EQ(report.components, 1u);
        EXPECT_EQ(report.self_intersections, 0u);
        EXPECT_GT(report.signed_volume, 0.0);
        EXPECT_EQ(genusOf(*mesh), genus);
        const Box box = boundsOf(mesh->vertices);
        EXPECT_NEAR((box.max - box.min).maxCoeff(), 0.2, 1e-9);
        EXPECT_LT((box.max + box.min).norm(), 1e-9);
        // Where so few would not show its rings it has more.
        EXPECT_GT(mesh->triangles.size(), triangles * 2 / 3);
        EXPECT_LT(mesh->triangles.size(), 3 * triangles + 1500);
      }
}

TEST(RandomOrgan, IsClosedEmbeddedAndOfItsGenusAndSize) { expectWhatWasAskedFor(2, 2, {500}); }
TEST(RandomOrgan, IsClosedEmbeddedAndOfItsGenusAndSize_Long) { expectWhatWasAskedFor(1, 3, {500, 3000}); }

TEST(RandomOrgan, IsTheSameForTheSameSeedAndAnotherForAnother) {
  const auto a = randomOrgan(5, 1, 0.1, 800), b = randomOrgan(5, 1, 0.1, 800), c = randomOrgan(6, 1, 0.1, 800);
  ASSERT_TRUE(a.ok() && b.ok() && c.ok());
  EXPECT_EQ(a->vertices, b->vertices);
  EXPECT_EQ(a->triangles, b->triangles);
  EXPECT_NE(a->vertices, c->vertices);
}

TEST(RandomOrgan, RefusesWhatIsOutOfRange) {
  for (const auto& mesh : {randomOrgan(1, 4, 0.1, 1000), randomOrgan(1, -1, 0.1, 1000), randomOrgan(1, 0, 0.0, 1000),
                           randomOrgan(1, 0, 0.1, 50)}) {
    ASSERT_FALSE(mesh.ok());
    EXPECT_EQ(mesh.error().code, ErrorCode::kInvalidArgument);
    EXPECT_NE(mesh.error().detail.find("accepted"), std::string::npos);
  }
}

TEST(GenusOf, KnowsBallsAndRings) {
  EXPECT_EQ(genusOf(sphereMesh(0.1, 0.03)), 0);
  EXPECT_EQ(genusOf(boxMesh(Vec3(1, 1, 1), 3, 3, 3)), 0);
  EXPECT_EQ(genusOf(torusMesh(0.1, 0.03, 0.02)), 1);
}

}  // namespace random_organ_test
}  // namespace meshless
