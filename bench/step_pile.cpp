// 1,000 bodies of 27 particles, one cluster each, beside the plain path and Bullet's soft bodies.
#include <algorithm>

#include "step_rows.h"

#ifdef HAVE_BULLET
#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>
#endif

namespace meshless::bench {
namespace {

constexpr int kBodies = 1000;
const char* const kModeNames[] = {"rigid", "linear", "quadratic"};

struct Pile {
  std::vector<Plain> bodies;  // as they start
  std::vector<BodyState> now;
  std::unique_ptr<BodyBatch> batch;
  std::vector<BatchBody> states;  // views of now

  void putBack() {
    now.resize(bodies.size());
    states.clear();
    for (std::size_t i = 0; i < bodies.size(); ++i) {
      now[i] = bodies[i].state;
      states.push_back({now[i].positions.data(), now[i].velocities.data(), &now[i].poses[0].rotation});
    }
  }
};

std::shared_ptr<Pile> makePile() {
  auto pile = std::make_shared<Pile>();
  Engine engine(1);
  Plain body;
  addLattice(3, body.model);
  body.model.clusters.offsets = {0, 27};
  for (Index i = 0; i < 27; ++i) body.model.clusters.members.push_back(i);
  body.model.clusters.weights.assign(27, 1.0);
  body.finish();
  addQuadraticRest(body.model.rest, body.model.masses, body.model.clusters, body.model.shape);
  pile->bodies.assign(kBodies, body);
  std::vector<MatchInput> inputs;
  for (Plain& b : pile->bodies) {
    throwIn(b, engine, uniform(engine, 0.1, 0.5), 5.0);
    inputs.push_back(matchInput(b.model));
  }
  pile->batch = std::make_unique<BodyBatch>(inputs, true);
  pile->putBack();
  return pile;
}

// 1 where a fall comes out the same to the bit with this loop and on one thread.
int sameOnOneThread(Pile& pile, const BatchStep& step, const ForEach& for_each) {
  std::vector<Points> first;
  for (const ForEach& how : {for_each, ForEach(oneAfterAnother)}) {
    MatchCounters counters;
    pile.putBack();
    for (int n = 0; n < kRestart / 2; ++n) pile.batch->step(pile.states, step, counters, how);
    for (std::size_t i = 0, at = 0; i < pile.bodies.size(); ++i, at += 2) {
      const Points &positions = pile.now[i].positions, &velocities = pile.now[i].velocities;
      if (first.size() < 2 * pile.bodies.size()) {
        first.push_back(positions);
        first.push_back(velocities);
      } else if (positions != first[at] || velocities != first[at + 1]) {
        return 0;
      }
    }
  }
  return 1;
}

void runPile(benchmark::State& state, Pile& pile, MatchMode mode, InstructionSet set, bool two_threads) {
  const Material material = appearanceOf(mode);
  BatchStep step = stepOf(material);
  step.set = set;
  MatchCounters counters;
  const Loop loop(two_threads);
  const ForEach& for_each = loop.forEach();
  pile.putBack();
  int steps = 0;
  for (auto _ : state) {
    pile.batch->step(pile.states, step, counters, for_each);
    if (++steps % kRestart == 0) {
      state.PauseTiming();
      pile.putBack();
      state.ResumeTiming();
    }
  }
  if (two_threads) state.counters["same"] = sameOnOneThread(pile, step, for_each);
  double error = 0.0;
  pile.putBack();
  pile.batch->step(pile.states, step, counters, for_each);
  for (std::size_t i = 0; i < pile.bodies.size(); ++i) {
    Plain expected = pile.bodies[i];
    expected.step(material, step);
    error = std::max(error, farthest(pile.now[i].positions, expected.state.positions) / (2.0 * kSpacing));
  }
  state.counters["error"] = error;
  state.counters["cold"] = static_cast<double>(counters.cold_rotations) / static_cast<double>(counters.rotations);
}

void runPlainPile(benchmark::State& state, const Pile& pile, MatchMode mode) {
  const Material material = appearanceOf(mode);
  const BatchStep step = stepOf(material);
  std::vector<Plain> bodies = pile.bodies;
  int steps = 0;
  for (auto _ : state) {
    for (Plain& body : bodies) body.step(material, step);
    if (++steps % kRestart == 0) {
      state.PauseTiming();
      for (std::size_t i = 0; i < bodies.size(); ++i) bodies[i].state = pile.bodies[i].state;
      state.ResumeTiming();
    }
  }
}

#ifdef HAVE_BULLET
void runBullet(benchmark::State& state, const Pile& pile) {
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher(&configuration);
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btSoftRigidDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
  world.setGravity(btVector3(0, 0, -9.81f));
  world.getWorldInfo().m_gravity = btVector3(0, 0, -9.81f);
  world.getWorldInfo().air_density = 0;
  world.getWorldInfo().m_sparsesdf.Initialize();
  std::vector<std::unique_ptr<btSoftBody>> bodies;
  const auto at = [](const Vec3& p) { return btVector3(btScalar(p.x()), btScalar(p.y()), btScalar(p.z())); };
  const auto putBack = [&](std::size_t i) {
    const BodyState& from = pile.bodies[i].state;
    for (int k = 0; k < bodies[i]->m_nodes.size(); ++k) {
      btSoftBody::Node& node = bodies[i]->m_nodes[k];
      node.m_x = node.m_q = at(from.positions[k]);
      node.m_v = at(from.velocities[k]);
    }
  };
  for (const Plain& plain : pile.bodies) {
    std::vector<btVector3> rest;
    std::vector<btScalar> masses;
    for (std::size_t i = 0; i < plain.model.rest.size(); ++i) {
      rest.push_back(at(plain.model.rest[i]));
      masses.push_back(btScalar(plain.model.masses[i]));
    }
    bodies.push_back(std::make_unique<btSoftBody>(&world.getWorldInfo(), int(rest.size()), rest.data(), masses.data()));
    btSoftBody& body = *bodies.back();
    body.m_cfg.kMT = 0.5f;
    body.m_cfg.collisions = 0;
    body.setPose(false, true);
    world.addSoftBody(&body, 1, 2);  // meets nobody
    putBack(bodies.size() - 1);
  }
  int steps = 0;
  for (auto _ : state) {
    world.stepSimulation(btScalar(kStep), 0);
    if (++steps % kRestart == 0) {
      state.PauseTiming();
      for (std::size_t i = 0; i < bodies.size(); ++i) putBack(i);
      state.ResumeTiming();
    }
  }
  for (auto& body : bodies) world.removeSoftBody(body.get());
}
#endif

}  // namespace

void registerPile() {
  const auto pile = makePile();
  const char* const set_names[] = {"baseline", "avx2", "avx512"};
  for (MatchMode mode : {MatchMode::kRigid, MatchMode::kLinear, MatchMode::kQuadratic}) {
    const std::string row = std::string("bodies27/") + kModeNames[static_cast<int>(mode)];
    const InstructionSet widest = widestInstructionSet();
    for (bool two : {false, true})
      settle(benchmark::RegisterBenchmark((row + (two ? "/2threads" : "/1threads")).c_str(),
                                          [=](benchmark::State& s) { runPile(s, *pile, mode, widest, two); }));
    settle(benchmark::RegisterBenchmark(("reference/" + row).c_str(),
                                        [=](benchmark::State& s) { runPlainPile(s, *pile, mode); }));
    for (InstructionSet set : {InstructionSet::kBaseline, InstructionSet::kAvx2, InstructionSet::kAvx512})
      if (instructionSetAvailable(set))
        settle(benchmark::RegisterBenchmark(("sets/" + row + "/" + set_names[static_cast<int>(set)]).c_str(),
                                            [=](benchmark::State& s) { runPile(s, *pile, mode, set, false); }));
  }
#ifdef HAVE_BULLET
  settle(benchmark::RegisterBenchmark("bullet/pose", [=](benchmark::State& s) { runBullet(s, *pile); }));
#endif
}

}  // namespace meshless::bench
