// The memory that a world says it holds, beside what the allocator has given out.
#include <malloc.h>

#include "support/bodies.h"

namespace meshless {
namespace memory_test {

BodyDef block(int edge, const std::string& name, const Vec3& at, bool elastic) {
  BodyDef def = test::defOf(boxMesh(Vec3::Constant(0.1), edge, edge, edge), name);
  def.spacing = 0.1 / edge;
  def.pose.translation = at;
  if (elastic) {
    def.material.youngs_modulus = 5000.0;
    def.material.poissons_ratio = 0.3;
  }
  return def;
}

/// Two blocks that lie on the ground, one on the other, after some steps.
World stacked(int edge, bool elastic) {
  World world{WorldSettings()};
  for (int k = 0; k < 2; ++k) {
    BodyDef def = block(edge, "block" + std::to_string(k), Vec3(0.002 * k, 0.001 * k, 0.0501 + 0.1002 * k), elastic);
    EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  }
  for (int step = 0; step < 30; ++step) world.step();
  return world;
}

TEST(Memory, GrowsWithTheParticlesAndHardlyForEachOfThem) {
  for (const bool elastic : {false, true}) {
    SCOPED_TRACE(elastic ? "elastic" : "appearance");
    MemoryUse last;
    for (const int edge : {6, 9, 13}) {
      const MemoryUse use = stacked(edge, elastic).memory();
      EXPECT_GE(use.particles, 2u * static_cast<unsigned>(edge * edge * edge));
      EXPECT_GT(use.models, last.models);
      EXPECT_GT(use.states, last.states);
      EXPECT_GT(use.contact, last.contact);
      EXPECT_GT(use.kept, last.kept);
      EXPECT_EQ(use.total(), use.models + use.states + use.contact + use.kept);
      RecordProperty((elastic ? "elastic_" : "looks_") + std::to_string(use.particles),
                     std::to_string(use.perParticle()));
      // Positions and velocities alone are 48 bytes.
      EXPECT_GT(use.perParticle(), 200.0);
      EXPECT_LT(use.perParticle(), 12000.0);
      if (last.particles) EXPECT_LT(use.perParticle(), 1.4 * last.perParticle());
      last = use;
    }
  }
}

TEST(Memory, CopiesOfAModelAreCountedOnce) {
  const auto shared = test::shared(block(8, "block", Vec3(0, 0, 1.0), false));
  const auto useOf = [&](int copies) {
    World world(test::weightless());
    for (int k = 0; k < copies; ++k) {
      const Pose pose{Quat::Identity(), Vec3(k, 0, 1.0)};
      auto body = std::make_shared<PreparedBody>(placedCopy(*shared, "block" + std::to_string(k), pose));
      EXPECT_TRUE(world.addSceneBody(body).ok());
    }
    world.step();
    return world.memory();
  };
  const MemoryUse one = useOf(1), five = useOf(5);
  EXPECT_EQ(five.models, one.models);
  EXPECT_EQ(five.particles, 5 * one.particles);
  const double states = static_cast<double>(five.states);
  EXPECT_NEAR(states, 5.0 * static_cast<double>(one.states), 0.05 * states);
  EXPECT_EQ(World(WorldSettings()).memory().particles, 0u);
  EXPECT_EQ(World(WorldSettings()).memory().perParticle(), 0.0);
}

#ifndef __SANITIZE_ADDRESS__  // which has an allocator of its own
TEST(Memory, IsWhatTheAllocatorHasGivenOut) {
  for (const bool elastic : {false, true}) {
    SCOPED_TRACE(elastic ? "elastic" : "appearance");
    stacked(9, elastic);  // what is made once for all worlds
    const struct mallinfo2 before = mallinfo2();
    const World world = stacked(13, elastic);
    const struct mallinfo2 after = mallinfo2();
    const double given =
        static_cast<double>(after.uordblks + after.hblkhd) - static_cast<double>(before.uordblks + before.hblkhd);
    const double told = static_cast<double>(world.memory().total());
    EXPECT_GT(told, 0.9 * given);
    EXPECT_LT(told, 1.1 * given);
    RecordProperty(elastic ? "elastic" : "looks", std::to_string(told / given));
  }
}
#endif

}  // namespace memory_test
}  // namespace meshless
