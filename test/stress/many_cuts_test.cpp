// A hundred cuts of one body, and up to a thousand incisions: what is left stays finite and bounded, and what is
// refused has changed nothing.
#include <gtest/gtest.h>

#include "support/stress.h"

namespace meshless::stress {
namespace many_cuts_test {

/// Through the middle of the largest body, and through that alone.
CutCommand cutLargest(World& world, test::Random& random) {
  CutCommand command;
  command.blades.x_axis = random.unit();
  command.blades.y_axis = command.blades.x_axis.unitOrthogonal();
  double largest = 0.0;
  for (const BodySnapshot& body : world.snapshot({false, false, true, false}).bodies) {
    if (!(body.measures.volume > largest)) continue;
    largest = body.measures.volume;
    command.blades.origin = body.measures.centre_of_mass;
    command.bodies = {body.name};
  }
  return command;
}

TEST(ManyCuts, AHundredInOnePlaceWhilePicked) {
  const int cuts = std::max(10, static_cast<int>(100.0 * std::min(1.0, share())));
  WorldSettings settings;
  settings.ground = -0.06;
  Twins twins(settings);
  Kind coarse;
  coarse.bodies = 36;
  twins.spawn(test::shared(blockOf(coarse, "block", -Vec3(0.1, 0.05, 0.05))));
  PickCommand pick;
  pick.point = Vec3(0.1, 0.05, 0.05);
  pick.max_distance = 1.0;
  const PickId held = test::replyOf<PickReply>(twins.apply(pick)).pick;
  test::Random random(31);
  std::size_t accepted = 0, refused = 0;
  for (int cut = 0; cut < cuts; ++cut) {
    (void)twins.apply(MovePickCommand{held, Vec3(0.1, 0.05, 0.05) + random.vector(0.02)});
    const CutCommand command = cutLargest(twins.world(), random);
    const std::uint64_t before = twins.world().stateHash();
    if (twins.apply(command).ok()) {
      ++accepted;
    } else {
      ++refused;
      EXPECT_EQ(twins.world().stateHash(), before) << "cut " << cut;
    }
    ASSERT_TRUE(twins.step(Vec3::Zero(), 20.0)) << "cut " << cut;
  }
  EXPECT_GE(accepted, static_cast<std::size_t>(cuts) / 4);
  RecordProperty("accepted", static_cast<int>(accepted));
  RecordProperty("refused", static_cast<int>(refused));
  RecordProperty("bodies", static_cast<int>(twins.world().bodyCount()));
}

// A blade without end through everything, again and again: the crumbs would double with each cut.
TEST(ManyCuts, CrumbsAreBounded) {
  WorldSettings settings = test::weightless();
  settings.contact = ContactMethod::kNone;
  World world(settings);
  Kind coarse;
  coarse.bodies = 36;
  ASSERT_TRUE(world.addSceneBody(test::shared(blockOf(coarse, "block", -Vec3(0.1, 0.05, 0.05)))).ok());
  test::Random random(41);
  std::string refusal;
  std::size_t bodies = 1;
  for (int cut = 0; cut < 60 && refusal.empty(); ++cut) {
    CutCommand command;
    command.blades.x_axis = random.unit();
    command.blades.y_axis = command.blades.x_axis.unitOrthogonal();
    command.blades.origin = random.vector(0.03) - 1.0 * command.blades.x_axis;
    const std::uint64_t before = world.stateHash();
    const Result<Reply> reply = world.apply(command);
    if (reply.ok()) {
      bodies = world.bodyCount();
      continue;
    }
    EXPECT_EQ(world.stateHash(), before);
    if (reply.error().code == ErrorCode::kFailed) refusal = reply.error().detail;
  }
  EXPECT_NE(refusal.find("accepted: up to 1000"), std::string::npos) << refusal;
  EXPECT_LE(bodies, 1000u);
  EXPECT_GT(bodies, 300u);
  ASSERT_TRUE(world.apply(UndoCutCommand{}).ok());
  EXPECT_LT(world.bodyCount(), bodies);
}

void inciseOneBody(int incisions, ContactMethod contact) {
  WorldSettings settings = test::weightless();
  settings.contact = contact;
  Twins twins(settings);
  twins.spawn(test::shared(blockOf(Kind{}, "block", -Vec3(0.1, 0.05, 0.05))));
  test::Random random(37);
  std::size_t accepted = 0;
  for (int n = 0; n < incisions; ++n) {
    // Most of them into the surface somewhere, at any angle; of what has come apart the largest piece is the body.
    const std::vector<BodySnapshot> bodies = twins.world().snapshot({true, false, true, false}).bodies;
    const BodySnapshot& body = *std::max_element(
        bodies.begin(), bodies.end(),
        [](const BodySnapshot& a, const BodySnapshot& b) { return a.measures.volume < b.measures.volume; });
    const Vec3 at =
        body.surface[static_cast<std::size_t>(random.integer(0, static_cast<int>(body.surface.size()) - 1))];
    InciseCommand incise;
    incise.blade.y_axis = ((at - body.measures.centre_of_mass).normalized() + random.vector(0.7)).normalized();
    incise.blade.x_axis = incise.blade.y_axis.cross(random.unit()).normalized();
    incise.blade.length = random.uniform(0.005, 0.05);
    incise.blade.depth = random.uniform(0.005, 0.05);
    incise.blade.origin = at - 0.5 * incise.blade.length * incise.blade.x_axis +
                          random.uniform(-0.2, 0.5) * incise.blade.depth * incise.blade.y_axis;
    const std::uint64_t before = twins.world().stateHash();
    incise.bodies = {body.name};
    if (twins.apply(incise).ok())
      ++accepted;
    else
      EXPECT_EQ(twins.world().stateHash(), before) << "incision " << n;
    if (n % 10 == 9) ASSERT_TRUE(twins.step(Vec3::Zero(), 20.0)) << "incision " << n;
  }
  EXPECT_GE(accepted, static_cast<std::size_t>(incisions) / 4);
  testing::Test::RecordProperty("accepted", static_cast<int>(accepted));
  testing::Test::RecordProperty("bodies", static_cast<int>(twins.world().bodyCount()));
}

// 60 in the whole table: each takes longer than the one before, and 120 more than ten minutes.
TEST(ManyCuts, UpToAThousandIncisionsOfOneBody) {
  inciseOneBody(std::clamp(static_cast<int>(60.0 * share()), 20, 1000), ContactMethod::kNone);
}
// Short ones all over a slab, at any angle, many across others, as a class of trainees leaves it.
TEST(ManyCuts, AThousandShortIncisionsOfASlab) {
  const int incisions = std::max(50, static_cast<int>(1000.0 * std::min(1.0, share())));
  Twins twins(test::weightless());
  BodyDef slab = test::defOf(boxMesh(Vec3(0.3, 0.3, 0.03), 15, 15, 2), "slab");
  slab.spacing = 0.03;
  twins.spawn(test::shared(slab));
  test::Random random(53);
  std::size_t accepted = 0;
  for (int n = 0; n < incisions; ++n) {
    InciseCommand incise;
    incise.blade.y_axis = (Vec3::UnitZ() + random.vector(0.3)).normalized();
    incise.blade.x_axis = incise.blade.y_axis.cross(random.unit()).normalized();
    incise.blade.length = random.uniform(0.003, 0.012);
    incise.blade.depth = random.uniform(0.003, 0.012);
    incise.blade.origin = Vec3(random.uniform(-0.14, 0.14), random.uniform(-0.14, 0.14), 0.017);
    const std::uint64_t before = twins.world().stateHash();
    if (twins.apply(incise).ok())
      ++accepted;
    else
      EXPECT_EQ(twins.world().stateHash(), before) << "incision " << n;
    if (n % 10 == 9) ASSERT_TRUE(twins.step(Vec3::Zero(), 20.0)) << "incision " << n;
  }
  EXPECT_GE(accepted, static_cast<std::size_t>(incisions) / 2);
  RecordProperty("accepted", static_cast<int>(accepted));
  RecordProperty("triangles", static_cast<int>(twins.world().snapshot({}).bodies[0].model->surface.triangles.size()));
}

// Deep ones across each other: the triangles of 36 are 20,000, those of 60 are 170,000, and each step of these takes
// minutes.
TEST(ManyCuts, IncisionsOfABodyThatMeetsItself) {
  inciseOneBody(std::max(20, static_cast<int>(36.0 * std::min(1.0, share()))), ContactMethod::kSurface);
}

}  // namespace many_cuts_test
}  // namespace meshless::stress
