// Where the tissue is that a pick holds, and what it does to the body, however the tissue turns and stretches.
#include <algorithm>
#include <cmath>

#include "shapes/organs.h"
#include "meshless_surgery/tools/grasp.h"
#include "support/bodies.h"

namespace meshless {
namespace picks_test {

using test::replyOf;

constexpr double kOneParticle = 1e-6;  // [m] radius of a grasp

struct Grip {
  std::string name;
  bool elastic, ray;
  double radius;  // [m] 0: the default
};
void PrintTo(const Grip& grip, std::ostream* out) { *out << grip.name; }

const std::vector<Grip> kGrips = {{"elastic", true, false, 0.0},
                                  {"elastic by a ray", true, true, 0.0},
                                  {"elastic by one particle", true, false, kOneParticle},
                                  {"elastic by a ray and one particle", true, true, kOneParticle},
                                  {"appearance", false, false, 0.0},
                                  {"appearance by a ray", false, true, 0.0},
                                  {"appearance by one particle", false, false, kOneParticle}};

WorldSettings space(double radius) {
  WorldSettings settings = test::weightless();
  settings.pick_radius = radius;
  settings.pick_stiffness = 2000.0;
  settings.sleep = false;
  return settings;
}

BodyDef block(bool elastic) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.08, 0.05, 0.05), 0.0061), "block");
  def.pose.translation = Vec3(0.01, 0.02, 0.03);
  def.material.damping = 40.0;
  if (elastic) {
    def.material.youngs_modulus = 1e4;
    def.material.poissons_ratio = 0.4;
    def.spacing = 0.01;
  }
  return def;
}

void run(World& world, double seconds) {
  for (int n = 0; n < seconds * world.settings().step_rate; ++n) world.step();
}

// From 5 cm outside of its face at `place`, straight; or the nearest particle.
PickReply take(World& world, const Vec3& place, const Vec3& outwards, bool ray) {
  PickCommand pick;
  pick.point = place;
  if (ray) {
    pick.point += 0.05 * outwards;
    pick.direction = -outwards;
  }
  return replyOf<PickReply>(world.apply(pick));
}

void moveTo(World& world, PickId pick, const Vec3& target) {
  MovePickCommand move;
  move.pick = pick;
  move.target = target;
  replyOf<Done>(world.apply(move));
}

std::vector<PickReply> takeThree(World& world, const Vec3& middle, bool ray) {
  return {take(world, middle + Vec3(0.04, 0.011, 0.004), Vec3::UnitX(), ray),
          take(world, middle + Vec3(-0.04, -0.009, 0.013), -Vec3::UnitX(), ray),
          take(world, middle + Vec3(0.003, -0.002, 0.025), Vec3::UnitZ(), ray)};
}

class Picks : public testing::TestWithParam<Grip> {};

TEST_P(Picks, TurnWithABlockAndPullAtNothing) {
  const Grip& grip = GetParam();
  World world(space(grip.radius));
  const BodyDef def = block(grip.elastic);
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  const double spacing = world.snapshot({}).bodies[0].model->spacing;
  const Vec3 middle = def.pose.translation;
  const std::vector<PickReply> taken = takeThree(world, middle, grip.ray);
  const Vec3 axis = Vec3(0.3, -0.8, 0.5).normalized();
  constexpr int kSteps = 240;
  for (int n = 1; n <= kSteps; ++n) {
    const Eigen::AngleAxisd turn(2.0 * n / kSteps, axis);
    for (const PickReply& one : taken) moveTo(world, one.pick, middle + turn * (one.position - middle));
    world.step();
  }
  run(world, 2.0);
  const WorldSnapshot shot = world.snapshot({true, true, false});
  for (std::size_t k = 0; k < taken.size(); ++k) {
    const Pick& pick = shot.picks[k];
    EXPECT_LT((pick.position - pick.target).norm(), 1e-2 * spacing) << k;
    EXPECT_LT(pick.force.norm(), 0.05) << k << ": nothing has to hold it there";
    // Of a ray the point that it met; in cells the particle can be a corner of the cell around it.
    EXPECT_LT((pick.position - shot.bodies[0].particles[pick.particle]).norm(),
              (grip.ray ? std::sqrt(3.0) : 1e-6) * spacing + 5e-3 * spacing)
        << k;
  }
}

// Nothing else acts on a free body at rest: what its picks say adds up to no force and no torque.
TEST_P(Picks, TurnABodyByTheirForceAtTheirPlace) {
  const Grip& grip = GetParam();
  World world(space(grip.radius));
  const BodyDef def = block(grip.elastic);
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  const Vec3 middle = def.pose.translation;
  const std::vector<PickReply> taken = takeThree(world, middle, grip.ray);
  // Pulled apart, each its own way, and turned.
  const Eigen::AngleAxisd turn(0.7, Vec3(0.3, -0.8, 0.5).normalized());
  const Vec3 apart[] = {{0.012, 0.004, -0.009}, {-0.011, 0.008, 0.003}, {0.002, -0.013, 0.009}};
  for (std::size_t k = 0; k < taken.size(); ++k)
    moveTo(world, taken[k].pick, middle + turn * (taken[k].position - middle + apart[k]));
  run(world, 16.0);  // what is held by single particles comes to rest slowly
  Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
  double forces = 0.0, torques = 0.0;
  for (const Pick& pick : world.snapshot({}).picks) {
    const Vec3 about = (pick.position - middle).cross(pick.force);
    force += pick.force;
    torque += about;
    forces += pick.force.norm();
    torques += about.norm();
  }
  ASSERT_GT(forces, 0.2);
  EXPECT_LT(force.norm(), 0.015 * forces);
  EXPECT_LT(torque.norm(), 0.02 * torques);
}

TEST_P(Picks, GoOnWithThePieceThatHasTheirTissue) {
  const Grip& grip = GetParam();
  World world(space(grip.radius));
  const BodyDef def = block(grip.elastic);
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  const double spacing = world.snapshot({}).bodies[0].model->spacing;
  const Vec3 middle = def.pose.translation;
  const std::vector<PickReply> taken = takeThree(world, middle, grip.ray);
  const Eigen::AngleAxisd turn(0.9, Vec3::UnitY());
  for (const PickReply& one : taken) moveTo(world, one.pick, middle + turn * (one.position - middle));
  run(world, 2.0);
  const std::vector<Pick> before = world.snapshot({}).picks;
  CutCommand cut;  // 3 mm beside the last, through its grasp
  cut.blades.x_axis = turn * Vec3::UnitY();
  cut.blades.y_axis = turn * Vec3::UnitZ();
  cut.blades.origin = middle + turn * Vec3(0.006, 0.0, 0.0) - 10.0 * cut.blades.x_axis;
  ASSERT_EQ(replyOf<CutReply>(world.apply(cut)).new_bodies.size(), 2u);
  const auto nothingJumped = [&] {
    const std::vector<Pick> now = world.snapshot({}).picks;
    for (std::size_t k = 0; k < taken.size(); ++k) {
      EXPECT_LT((now[k].position - before[k].position).norm(), 0.01 * spacing) << k;
      EXPECT_LT((now[k].force - before[k].force).norm(), 0.01 * spacing * before[k].stiffness) << k;
    }
  };
  world.step();
  nothingJumped();
  // Turned on: the piece with the first alone, the other with two.
  for (const Pick& pick : before) moveTo(world, pick.id, middle + turn * (pick.target - middle));
  run(world, 3.0);
  const WorldSnapshot shot = world.snapshot({true, true, false});
  for (const Pick& pick : shot.picks) {
    EXPECT_LT((pick.position - pick.target).norm(), 0.05 * spacing);
    for (const BodySnapshot& body : shot.bodies)
      if (body.id == pick.body)
        EXPECT_LT((pick.position - body.particles[pick.particle]).norm(), 2.0 * spacing) << body.name;
  }
  ASSERT_TRUE(world.apply(UndoCutCommand{}).ok());
  EXPECT_EQ(world.snapshot({}).picks.size(), 3u);
  world.step();
  nothingJumped();
}

INSTANTIATE_TEST_SUITE_P(AllGrips, Picks, testing::ValuesIn(kGrips),
                         [](const auto& info) {
                           std::string name = info.param.name;
                           std::replace(name.begin(), name.end(), ' ', '_');
                           return name;
                         });

// A liver that lies and is held behind, lifted and drawn aside until what is held has turned.
TEST(PickOfAnOrgan, IsWhereItsParticleIs) {
  for (const Vec3& way : {Vec3(0, 0, 0.06), Vec3(0, 0.06, 0.08), Vec3(0, 0.11, 0.06)}) {
    WorldSettings settings;
    World world(settings);
    BodyDef def = test::defOf(liverMesh(), "liver");
    def.pose.translation.z() = 0.05;
    def.material.youngs_modulus = 3000.0;
    def.material.poissons_ratio = 0.45;
    def.material.damping = 10.0;
    def.fixed.push_back({Box{Vec3(0.02, -1, -1), Vec3(1, 1, 1)}});
    ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
    const double spacing = world.snapshot({}).bodies[0].model->spacing;
    run(world, 1.0);
    PickCommand take;
    take.point = Vec3(-0.06, -0.08, 0.03);
    take.max_distance = 0.1;
    const PickReply taken = replyOf<PickReply>(world.apply(take));
    for (int n = 1; n <= 360; ++n) {
      moveTo(world, taken.pick, taken.position + n / 360.0 * way);
      world.step();
    }
    run(world, 2.0);
    const WorldSnapshot shot = world.snapshot({true, true, false});
    const double apart = (shot.picks[0].position - shot.bodies[0].particles[taken.particle]).norm();
    RecordProperty("apart", std::to_string(apart / spacing));
    std::printf("%.3f spacings of %.1f mm apart\n", apart / spacing, 1e3 * spacing);
    EXPECT_LT(apart, spacing);
  }
}

}  // namespace picks_test
}  // namespace meshless
