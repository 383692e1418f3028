// What should never be: coordinates that are not finite. They do not spread, and the body is there again.
#include <limits>

#include "support/bodies.h"

namespace meshless {
namespace not_finite_test {

struct Broken {
  const char* name;
  double value;
};

void breakAndStep(const Broken& broken, bool velocity, bool elastic) {
  SCOPED_TRACE(broken.name);
  World world{WorldSettings()};
  BodyDef def = test::ball("broken", Vec3(0.0, 0.0, 0.1));
  if (elastic) def.material.youngs_modulus = 5000.0;
  PreparedBody body = test::prepared(def);
  (velocity ? body.state.velocities : body.state.positions)[7].y() = broken.value;
  ASSERT_TRUE(world.addSceneBody(std::make_shared<const PreparedBody>(body)).ok());
  BodyDef beside = test::ball("whole", Vec3(0.19, 0.0, 0.1));
  ASSERT_TRUE(world.addSceneBody(test::shared(beside)).ok());
  std::size_t mended = 0;
  bool said = false;
  for (int step = 0; step < 60; ++step) {
    world.step();
    const WorldSnapshot shot = world.snapshot({true, true, true});
    mended += shot.report.mended;
    for (const BodySnapshot& now : shot.bodies) {
      ASSERT_TRUE(test::allFinite(now.particles)) << step;
      ASSERT_TRUE(test::allFinite(now.surface)) << step;
    }
    for (const Event& event : world.takeEvents())
      said = said || (event.type == EventType::kFault && event.body == "broken");
  }
  EXPECT_GE(mended, 1u);
  EXPECT_TRUE(said);
  const std::vector<BodySnapshot> bodies = world.snapshot({true, true, true}).bodies;
  ASSERT_EQ(bodies.size(), 2u);
  EXPECT_NEAR(bodies[0].measures.volume, bodies[0].model->rest_volume, 0.25 * bodies[0].model->rest_volume)
      << "soft, under its weight";
  EXPECT_LT(bodies[1].measures.velocity.norm(), 3.0) << "who was beside it";
}

TEST(NotFinite, ABodyStartsAnewAndOthersAreLeftAlone) {
  for (const Broken& broken : {Broken{"NaN", std::numeric_limits<double>::quiet_NaN()},
                               Broken{"infinity", std::numeric_limits<double>::infinity()}, Broken{"1e300", 1e300}})
    for (const bool velocity : {true, false})
      for (const bool elastic : {true, false}) breakAndStep(broken, velocity, elastic);
}

}  // namespace not_finite_test
}  // namespace meshless
