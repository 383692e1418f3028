#include "meshless_surgery/body/binding.h"

#include "support/bodies.h"

namespace meshless {
namespace {

TEST(BindSurface, ParticlesAreThemselvesAndRidersHaveSharesOfOne) {
  const PreparedBody body = test::prepared(test::ball("b", Vec3::Zero()));
  const BodyModel& m = *body.model;
  std::vector<Index> vertex_particle = m.binding.particle;
  for (std::size_t v = 0; v < vertex_particle.size(); v += 2) vertex_particle[v] = kNoIndex;
  const SurfaceBinding binding =
      bindSurface(m.rest, m.match_masses, m.clusters, m.shape, m.surface.vertices, vertex_particle);
  EXPECT_EQ(binding.particle, vertex_particle);
  ASSERT_EQ(binding.riders.size(), (vertex_particle.size() + 1) / 2);
  ASSERT_EQ(binding.offsets.size(), binding.riders.size() + 1);
  ASSERT_EQ(binding.mobility.size(), binding.riders.size());
  for (std::size_t r = 0; r < binding.riders.size(); ++r) {
    EXPECT_EQ(vertex_particle[binding.riders[r]], kNoIndex);
    double share = 0.0;
    for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k) {
      EXPECT_LT(binding.clusters[k], m.clusters.size());
      share += binding.weights[k];
    }
    EXPECT_NEAR(share, 1.0, 1e-12);
    // Lighter than one particle, heavier than the whole body.
    EXPECT_GT(binding.mobility[r], 1.0 / m.mass);
  }
}

TEST(BindSurface, WithoutRidersThereIsNothingToFollow) {
  const PreparedBody body = test::prepared(test::ball());
  EXPECT_TRUE(body.model->binding.riders.empty());
  EXPECT_TRUE(body.model->binding.clusters.empty());
}

}  // namespace
}  // namespace meshless
