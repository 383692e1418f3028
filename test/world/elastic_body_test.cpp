// Bodies of elastic materials, in the world.
#include <algorithm>

#include "meshless_surgery/body/deform.h"
#include "support/bodies.h"
#include "support/mesh_laws.h"
#include "support/random.h"

namespace meshless {
namespace elastic_body_test {

using test::prepared;
using test::replyOf;

BodyDef softBar(const std::string& name = "bar") {
  BodyDef def = test::defOf(boxMesh(Vec3(0.12, 0.04, 0.04), 12, 4, 4), name);
  def.material.youngs_modulus = 20000.0;
  def.material.poissons_ratio = 0.4;
  def.material.damping = 0.0;
  def.spacing = 0.01;
  return def;
}

double energyOf(const BodyModel& model, const Material& m, const BodyState& state) {
  return measureBody(model, state).kinetic_energy +
         elasticEnergy(*model.cells, elasticParameters(m.youngs_modulus, m.poissons_ratio, m.density), state.positions,
                       state.cells);
}

TEST(ElasticBody, IsALatticeOfCellsThatItsSurfaceRidesOn) {
  const PreparedBody body = prepared(softBar());
  const BodyModel& m = *body.model;
  EXPECT_EQ(m.groups(), 12u * 4u * 4u);
  EXPECT_EQ(m.rest.size(), 13u * 5u * 5u);
  EXPECT_EQ(m.binding.size(), m.surface.vertices.size());
  EXPECT_NEAR(m.mass, 1000.0 * 0.12 * 0.04 * 0.04, 1e-12);
  EXPECT_GT(m.highest_frequency, 0.0);
  for (std::size_t v = 0; v < m.surface.vertices.size(); ++v)
    EXPECT_LT((body.state.surface[v] - m.surface.vertices[v]).norm(), 1e-12);
  BodyDef clusters = softBar();
  clusters.clusters.kind = ClusterOptions::Kind::kOne;
  EXPECT_EQ(prepared(clusters).model->rest.size(), m.rest.size()) << "clusters are of appearance materials";
}

TEST(ElasticBody, FreeInSpaceKeepsItsMomentaAndNeverGainsEnergy) {
  for (const ClusterOptions::Kind kind : {ClusterOptions::Kind::kCells, ClusterOptions::Kind::kAuto}) {
    BodyDef def = softBar();
    def.clusters.kind = kind;
    const PreparedBody body = prepared(def);
    const BodyModel& m = *body.model;
    BodyState state = body.state;
    test::Random random(4);
    for (std::size_t i = 0; i < m.rest.size(); ++i) {
      state.positions[i] = 1.1 * m.rest[i] + random.vector(0.001);
      state.velocities[i] = Vec3(1, -2, 0.5) + Vec3(3, 5, 20).cross(m.rest[i]) + random.vector(0.2);
    }
    StepScratch scratch;
    MatchCounters counters;
    const double h = longestSubstep(m, state);
    const BodyMeasures before = measureBody(m, state);
    double energy = energyOf(m, def.material, state);
    const double start = energy;
    for (int step = 0; step < 3000; ++step) {
      matchAndMove(m, def.material, Vec3::Zero(), h, state, scratch, counters);
      if (step % 100 == 99) {
        const double now = energyOf(m, def.material, state);
        EXPECT_LT(now, energy * (1.0 + 1e-3)) << "step " << step;
        energy = now;
      }
    }
    const BodyMeasures after = measureBody(m, state);
    EXPECT_LT((after.linear_momentum - before.linear_momentum).norm(), 3000e-12 * before.linear_momentum.norm());
    EXPECT_LT((after.angular_momentum - before.angular_momentum).norm(), 3000e-12 * before.angular_momentum.norm());
    EXPECT_LT(energy, start);
  }
}

TEST(ElasticBody, GoesTheSameWayWhereRotationsStayBetweenSubsteps) {
  const BodyDef def = softBar();
  const PreparedBody body = prepared(def);
  const BodyModel& m = *body.model;
  BodyState states[2] = {body.state, body.state};
  for (const int row : {1, 7}) {
    BodyState& state = states[row == 7];
    for (std::size_t i = 0; i < m.rest.size(); ++i) state.velocities[i] = Vec3(3, 5, 20).cross(m.rest[i]);
    StepScratch scratch;
    MatchCounters counters;
    const double h = 0.5 * longestSubstep(m, state);
    for (int step = 1; step <= 70; ++step) {
      scratch.last = step % row == 0;
      matchAndMove(m, def.material, Vec3::Zero(), h, state, scratch, counters);
      // Between two rows poses may be others, as after a cut; and their rotations are read.
      if (step == 35) std::reverse(state.cells.begin(), state.cells.end());
    }
  }
  EXPECT_EQ(states[0].positions, states[1].positions);
  for (Index c = 0; c < m.groups(); ++c)
    EXPECT_EQ(states[0].cells[c].rotation.coeffs(), states[1].cells[c].rotation.coeffs());
}

// With the inertia that slowing gives to what deforms. It is strained by up to a half, so that its pace changes much.
TEST(ElasticBody, SlowedItKeepsItsMomentaAndNeverGainsEnergy) {
  for (const ClusterOptions::Kind kind : {ClusterOptions::Kind::kCells, ClusterOptions::Kind::kAuto})
    for (const double gain : {2.0, 10.0}) {
      BodyDef def = softBar();
      def.clusters.kind = kind;
      const PreparedBody body = prepared(def);
      const BodyModel& m = *body.model;
      BodyState state = body.state;
      for (std::size_t i = 0; i < m.rest.size(); ++i) {
        state.positions[i] = m.rest[i].cwiseProduct(Vec3(1.5, 0.8, 0.9));
        state.velocities[i] = Vec3(1, -2, 0.5) + Vec3(0.2, 0.3, 1.0).cross(m.rest[i]) + Vec3(5.0 * m.rest[i].x(), 0, 0);
      }
      StepScratch scratch;
      MatchCounters counters;
      const double h = gain * longestSubstep(m, state);
      const auto energy = [&] {
        const RigidMotion rigid = rigidMotionOf(m, state.positions, state.velocities);
        double together = 0.0, all = 0.0;
        for (std::size_t i = 0; i < m.rest.size(); ++i) {
          const Vec3 v = rigid.velocity + rigid.spin.cross(state.positions[i] - rigid.centre);
          together += 0.5 * m.masses[i] * v.squaredNorm();
          all += 0.5 * m.masses[i] * state.velocities[i].squaredNorm();
        }
        const double elastic = energyOf(m, def.material, state) - all;
        return together + (all - together) / (state.pace * state.pace) + elastic;
      };
      const BodyMeasures before = measureBody(m, state);
      matchAndMove(m, def.material, Vec3::Zero(), h, state, scratch, counters);
      const double start = energy();
      double most = 0.0, slowest = 1.0, quickest = 0.0;
      for (int step = 0; step < 3000; ++step) {
        matchAndMove(m, def.material, Vec3::Zero(), h, state, scratch, counters);
        most = std::max(most, energy());
        slowest = std::min(slowest, state.pace);
        quickest = std::max(quickest, state.pace);
      }
      EXPECT_LT(most, 1.05 * start) << gain;
      EXPECT_GT(quickest, 1.1 * slowest);
      EXPECT_LT(quickest, 0.6);
      const BodyMeasures after = measureBody(m, state);
      EXPECT_LT((after.linear_momentum - before.linear_momentum).norm(), 3000e-12 * before.linear_momentum.norm());
      EXPECT_LT((after.angular_momentum - before.angular_momentum).norm(), 3000e-12 * before.angular_momentum.norm());
    }
}

double sagAt(double step_rate, int substeps) {
  WorldSettings settings;
  settings.ground.reset();
  settings.step_rate = step_rate;
  settings.substeps = substeps;
  World world(settings);
  BodyDef def = softBar();
  def.material.damping = 20.0;
  Box end;
  end.extend(Vec3(-1, -1, -1));
  end.extend(Vec3(-0.0599, 1, 1));
  def.fixed.push_back(end);
  EXPECT_TRUE(world.addSceneBody(test::shared(def)).ok());
  for (int step = 0; step < 3.0 * step_rate; ++step) world.step();
  EXPECT_GE(world.snapshot({}).report.substeps, static_cast<std::size_t>(substeps));
  return world.snapshot({false, false, true}).bodies[0].measures.centre_of_mass.z();
}

TEST(ElasticBody, SagsTheSameAtEveryStep) {
  const double sag = sagAt(120.0, 1);
  EXPECT_LT(sag, -0.0005);
  EXPECT_NEAR(sagAt(60.0, 1), sag, 0.01 * -sag);
  EXPECT_NEAR(sagAt(120.0, 40), sag, 0.01 * -sag);
}

TEST(ElasticBody, TooFewSubstepsSlowItAndSaySo) {
  WorldSettings settings;
  settings.ground.reset();
  settings.max_substeps = 2;
  World world(settings);
  ASSERT_TRUE(world.addSceneBody(test::shared(softBar())).ok());
  world.takeEvents();
  for (int step = 0; step < 100; ++step) world.step();
  const BodySnapshot body = world.snapshot({false, true, false}).bodies[0];
  EXPECT_LT(body.stiffness_factor, 0.5);
  EXPECT_GT(body.stiffness_factor, 0.0);
  EXPECT_TRUE(test::allFinite(body.particles));
  int said = 0;
  for (const Event& e : world.takeEvents()) said += e.type == EventType::kOverBudget;
  EXPECT_EQ(said, 1) << "once, not at every step";
  settings.max_substeps = 64;
  World enough(settings);
  ASSERT_TRUE(enough.addSceneBody(test::shared(softBar())).ok());
  enough.step();
  EXPECT_EQ(enough.snapshot({}).bodies[0].stiffness_factor, 1.0);
}

TEST(ElasticBody, IsPickedPushedCutAndComesToRest) {
  WorldSettings settings;
  settings.contact = ContactMethod::kNone;  // crumbs in one another are slow, and not what is asked here
  World world(settings);
  BodyDef def = softBar();
  def.pose.translation = Vec3(0, 0, 0.05);
  def.material.damping = 5.0;
  ASSERT_TRUE(world.addSceneBody(test::shared(def)).ok());
  PickCommand pick;
  pick.point = Vec3(0.05, 0, 0.06);
  const PickReply picked = replyOf<PickReply>(world.apply(pick));
  replyOf<Done>(world.apply(MovePickCommand{picked.pick, Vec3(0.05, 0.02, 0.12)}));
  PushCommand push;
  push.radius = 0.015;
  push.position = Vec3(-0.05, 0, 0.12);
  replyOf<Done>(world.apply(push));
  push.position = Vec3(-0.05, 0, 0.02);
  push.speed = 0.2;
  replyOf<Done>(world.apply(push));
  for (int step = 0; step < 120; ++step) world.step();
  test::Random random(2);
  int cuts = 0;
  double mass = 0.0;
  for (int attempt = 0; attempt < 12; ++attempt) {
    const WorldSnapshot shot = world.snapshot({true, false, true});
    std::size_t largest = 0;
    for (std::size_t b = 1; b < shot.bodies.size(); ++b)
      if (shot.bodies[b].model->mass > shot.bodies[largest].model->mass) largest = b;
    const BodySnapshot& body = shot.bodies[largest];
    CutCommand cut;
    const Vec3 normal = random.unit();
    cut.blades.x_axis = normal.unitOrthogonal();
    cut.blades.y_axis = normal.cross(cut.blades.x_axis);
    cut.blades.origin = body.measures.centre_of_mass - 10.0 * cut.blades.x_axis;
    cut.bodies = {body.name};
    cuts += world.apply(cut).ok();
    for (int step = 0; step < 10; ++step) world.step();
  }
  EXPECT_GT(cuts, 8);
  for (int step = 0; step < 240; ++step) world.step();
  for (const BodySnapshot& body : world.snapshot({true, true, true}).bodies) {
    EXPECT_TRUE(test::allFinite(body.particles));
    EXPECT_TRUE(test::allFinite(body.surface));
    EXPECT_LT(body.measures.velocity.norm(), 0.4);  // [m/s] worst of 20 seeds: 0.098
    mass += body.model->mass;
    TriangleMesh mesh = body.model->surface;
    EXPECT_TRUE(laws::isClosedOriented(mesh));
  }
  EXPECT_NEAR(mass, 1000.0 * 0.12 * 0.04 * 0.04, 1e-9);
}

}  // namespace elastic_body_test
}  // namespace meshless
