// Run time of a complete substep (predict, match, restore momentum, gravity, ground): the vectorised batches in float,
// beside the plain double path in the same process (reference/...) and Bullet's soft bodies (bullet/pose: pose matching
// without links). One substep an iteration; of the repetitions, the median counts. `error` is the largest distance of
// a particle from where the plain path puts it in one substep from the same state, relative to the body's width.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <benchmark/benchmark.h>

#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/contact/sphere_and_ground.h"
#include "meshless_surgery/dynamics/match_batch.h"

#ifdef HAVE_BULLET
#include <BulletSoftBody/btSoftBody.h>
#include <BulletSoftBody/btSoftBodyRigidBodyCollisionConfiguration.h>
#include <BulletSoftBody/btSoftRigidDynamicsWorld.h>
#include <btBulletDynamicsCommon.h>
#endif

namespace meshless {
namespace {

constexpr int kBodies = 1000;
constexpr double kSpacing = 0.02;  // [m]
constexpr double kStep = 1.0 / 120.0;
constexpr int kRestart = 120;  // steps: the bodies fall, land and come to rest, over and over
const char* const kModeNames[] = {"rigid", "linear", "quadratic"};

using Engine = std::mt19937;
double uniform(Engine& engine, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(engine);
}
Vec3 randomVector(Engine& engine, double size) {
  const double x = uniform(engine, -size, size), y = uniform(engine, -size, size), z = uniform(engine, -size, size);
  return Vec3(x, y, z);
}

// One worker beside the caller. The caller takes chunks from the front and the worker from the back, so that each finds
// in its cache what it left there in the last substep. The worker spins for a while, because a substep is over in less
// time than it takes to wake a thread; the caller waits for what the worker took, not for the worker.
class TwoThreads {
 public:
  TwoThreads() : worker_([this] { run(); }) {}
  ~TwoThreads() {
    stop_ = true;
    worker_.join();
  }
  void operator()(std::size_t count, const std::function<void(std::size_t)>& work) {
    work_ = &work;
    finished_.store(0, std::memory_order_relaxed);
    left_.store(count, std::memory_order_release);
    while (take(true)) {
    }
    while (finished_.load(std::memory_order_acquire) != count) pause();
  }

 private:
  bool take(bool front) {
    constexpr std::uint64_t kOneFront = std::uint64_t{1} << 32;
    std::uint64_t left = left_.load(std::memory_order_relaxed);  // begin in the upper half, end in the lower
    do {
      if (left / kOneFront >= left % kOneFront) return false;
    } while (!left_.compare_exchange_weak(left, front ? left + kOneFront : left - 1, std::memory_order_acquire,
                                          std::memory_order_relaxed));
    (*work_)(front ? left / kOneFront : left % kOneFront - 1);
    finished_.fetch_add(1, std::memory_order_release);
    return true;
  }
  static void pause() {
#if defined(__x86_64__)
    __builtin_ia32_pause();
#endif
  }
  void run() {
    for (int idle = 0; !stop_; ++idle) {
      if (take(false)) idle = 0;
      if (idle > 20000) std::this_thread::yield();
      pause();
    }
  }

  const std::function<void(std::size_t)>* work_ = nullptr;
  alignas(64) std::atomic<std::uint64_t> left_{0};
  alignas(64) std::atomic<std::size_t> finished_{0};
  std::atomic<bool> stop_{false};
  std::thread worker_;
};

// A body as the world steps it, with the plain code.
struct Plain {
  BodyModel model;
  BodyState state;
  StepScratch scratch;
  MatchCounters counters;

  void finish() {
    model.match_masses = model.masses;
    model.fixed.assign(model.rest.size(), false);
    for (double m : model.masses) model.mass += m;
    model.shape = makeRestShape(model.rest, model.masses, model.clusters);
    state.positions = model.rest;
    state.velocities.assign(model.rest.size(), Vec3::Zero());
    state.poses.resize(model.clusters.size());
  }
  void step(const Material& material, const BatchStep& s) {
    matchAndMove(model, material, s.gravity, s.h, state, scratch, counters);
    scratch.touched.clear();
    scratch.before_contact = state.positions;
    for (Index i = 0; i < model.rest.size(); ++i) {
      Vec3& x = state.positions[i];
      const Projection out = projectOutOfGround(x, *s.ground);
      if (!out.inside) continue;
      x += out.depth * out.normal;
      x += frictionCorrection(x - scratch.previous[i], out.normal, out.depth, s.friction);
      scratch.touched.push_back({i, out.normal, 0.0});
    }
    velocitiesFromPositions(model, s.h, state, scratch);
  }
};

void addLattice(int n, BodyModel& model) {
  for (int z = 0; z < n; ++z)
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x) model.rest.push_back(kSpacing * Vec3(x, y, z));
  model.masses.assign(model.rest.size(), 1000.0 * kSpacing * kSpacing * kSpacing);
}

// In the air, turned and in motion, a little out of shape.
void throwIn(Plain& body, Engine& engine, double height, double spin) {
  const Quat turn = Quat(Eigen::AngleAxisd(uniform(engine, 0.0, 3.0), randomVector(engine, 1.0).normalized()));
  Vec3 centre = Vec3::Zero();
  for (const Vec3& x : body.model.rest) centre += x / static_cast<double>(body.model.rest.size());
  const Vec3 at(uniform(engine, -5, 5), uniform(engine, -5, 5), height), velocity = randomVector(engine, 0.3);
  const Vec3 turning = randomVector(engine, spin);
  for (std::size_t i = 0; i < body.model.rest.size(); ++i) {
    const Vec3 r = turn * (body.model.rest[i] - centre) + randomVector(engine, 0.05 * kSpacing);
    body.state.positions[i] = at + r;
    body.state.velocities[i] = velocity + turning.cross(r);
  }
  for (ClusterPose& pose : body.state.poses) pose.rotation = turn;
}

Material lookOf(MatchMode mode) {
  Material material;
  material.mode = mode;
  material.alpha = 0.5;
  material.beta = 0.5;
  material.damping = 0.5;
  return material;
}
BatchStep stepOf(const Material& material) {
  BatchStep step = batchStep(material, kStep);
  step.ground = 0.0;
  return step;
}

double farthest(const Points& a, const Points& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    if (!((a[i] - b[i]).norm() <= largest)) largest = (a[i] - b[i]).norm();
  return largest;
}

// --- 1,000 bodies of 27 particles, one cluster each

struct Pile {
  std::vector<Plain> bodies;
  std::unique_ptr<BodyBatch> batch;

  void putBack() {
    for (std::size_t i = 0; i < bodies.size(); ++i)
      batch->setState(i, bodies[i].state.positions, bodies[i].state.velocities, bodies[i].state.poses[0].rotation);
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

void runPile(benchmark::State& state, Pile& pile, MatchMode mode, InstructionSet set, bool two_threads) {
  const Material material = lookOf(mode);
  BatchStep step = stepOf(material);
  step.set = set;
  MatchCounters counters;
  std::unique_ptr<TwoThreads> threads;
  ForEach for_each = oneAfterAnother;
  if (two_threads) {
    threads = std::make_unique<TwoThreads>();
    for_each = [&](std::size_t count, const std::function<void(std::size_t)>& work) { (*threads)(count, work); };
  }
  pile.putBack();
  int steps = 0;
  for (auto _ : state) {
    pile.batch->step(step, counters, for_each);
    if (++steps % kRestart == 0) {
      state.PauseTiming();
      pile.putBack();
      state.ResumeTiming();
    }
  }
  double error = 0.0;
  pile.putBack();
  pile.batch->step(step, counters, for_each);
  for (std::size_t i = 0; i < pile.bodies.size(); ++i) {
    Plain expected = pile.bodies[i];
    Points positions, velocities;
    Quat rotation;
    expected.step(material, step);
    pile.batch->getState(i, positions, velocities, rotation);
    error = std::max(error, farthest(positions, expected.state.positions) / (2.0 * kSpacing));
  }
  state.counters["error"] = error;
  state.counters["cold"] = static_cast<double>(counters.cold_rotations) / static_cast<double>(counters.rotations);
}

void runPlainPile(benchmark::State& state, const Pile& pile, MatchMode mode) {
  const Material material = lookOf(mode);
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
// Without the ground, whose contacts cost Bullet far more than its matching, it is at its best.
void runBullet(benchmark::State& state, const Pile& pile, bool with_ground) {
  btSoftBodyRigidBodyCollisionConfiguration configuration;
  btCollisionDispatcher dispatcher(&configuration);
  btDbvtBroadphase broadphase;
  btSequentialImpulseConstraintSolver solver;
  btSoftRigidDynamicsWorld world(&dispatcher, &broadphase, &solver, &configuration);
  world.setGravity(btVector3(0, 0, -9.81f));
  world.getWorldInfo().m_gravity = btVector3(0, 0, -9.81f);
  world.getWorldInfo().air_density = 0;
  world.getWorldInfo().m_sparsesdf.Initialize();
  btStaticPlaneShape plane(btVector3(0, 0, 1), 0);
  btRigidBody ground(btRigidBody::btRigidBodyConstructionInfo(0, nullptr, &plane));
  if (with_ground) world.addRigidBody(&ground, 2, 1);
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
    body.m_cfg.collisions = with_ground ? btSoftBody::fCollision::SDF_RS : 0;
    body.setPose(false, true);
    world.addSoftBody(&body, 1, 2);  // meets the ground alone
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
  if (with_ground) world.removeRigidBody(&ground);
}
#endif

// --- a lattice of 20^3 particles with a cluster around each

std::shared_ptr<const Plain> makeLattice(int width) {
  constexpr int n = 20;
  auto body = std::make_shared<Plain>();
  addLattice(n, body->model);
  ClusterSet& set = body->model.clusters;
  std::vector<double> total(body->model.rest.size(), 0.0);
  set.offsets = {0};
  const auto from = [&](int i) { return std::max(0, i - width); };
  const auto to = [&](int i) { return std::min(n - 1, i + width); };
  for (int z = 0; z < n; ++z)
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x) {
        for (int c = from(z); c <= to(z); ++c)
          for (int b = from(y); b <= to(y); ++b)
            for (int a = from(x); a <= to(x); ++a) {
              set.members.push_back(static_cast<Index>((c * n + b) * n + a));
              total[set.members.back()] += 1.0;
            }
        set.offsets.push_back(static_cast<Index>(set.members.size()));
      }
  for (Index i : set.members) set.weights.push_back(1.0 / total[i]);
  body->finish();
  Engine engine(2);
  throwIn(*body, engine, 0.5, 2.0);
  return body;
}

void putBack(OverlapBatch& batch, const Plain& body) {
  std::vector<Quat> rotations;
  for (const ClusterPose& pose : body.state.poses) rotations.push_back(pose.rotation);
  batch.setState(body.state.positions, body.state.velocities, rotations);
}

void runLattice(benchmark::State& state, const Plain& body, InstructionSet set, bool two_threads) {
  const Material material = lookOf(MatchMode::kLinear);
  BatchStep step = stepOf(material);
  step.set = set;
  OverlapBatch batch(matchInput(body.model));
  putBack(batch, body);
  MatchCounters counters;
  std::unique_ptr<TwoThreads> threads;
  ForEach for_each = oneAfterAnother;
  if (two_threads) {
    threads = std::make_unique<TwoThreads>();
    for_each = [&](std::size_t count, const std::function<void(std::size_t)>& work) { (*threads)(count, work); };
  }
  int steps = 0;
  for (auto _ : state) {
    batch.step(step, counters, for_each);
    if (++steps % kRestart == 0) {
      state.PauseTiming();
      putBack(batch, body);
      state.ResumeTiming();
    }
  }
  putBack(batch, body);
  batch.step(step, counters);
  Plain expected = body;
  expected.step(material, step);
  Points positions, velocities;
  std::vector<Quat> rotations;
  batch.getState(positions, velocities, rotations);
  state.counters["error"] = farthest(positions, expected.state.positions) / (19.0 * kSpacing);
  state.counters["pairs"] = static_cast<double>(body.model.clusters.members.size());
}

void runPlainLattice(benchmark::State& state, const Plain& from) {
  const Material material = lookOf(MatchMode::kLinear);
  const BatchStep step = stepOf(material);
  Plain body = from;
  int steps = 0;
  for (auto _ : state) {
    body.step(material, step);
    if (++steps % kRestart == 0) {
      state.PauseTiming();
      body.state = from.state;
      state.ResumeTiming();
    }
  }
}

// --- rows

void settle(benchmark::internal::Benchmark* b) {
  b->MinTime(0.05)->Repetitions(9)->ReportAggregatesOnly()->Unit(benchmark::kMillisecond)->UseRealTime();
}

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
  settle(benchmark::RegisterBenchmark("bullet/pose", [=](benchmark::State& s) { runBullet(s, *pile, false); }));
  settle(benchmark::RegisterBenchmark("bullet/pose_ground", [=](benchmark::State& s) { runBullet(s, *pile, true); }));
#endif
}

void registerLattice() {
  const char* const set_names[] = {"baseline", "avx2", "avx512"};
  for (int width : {1, 2, 3}) {
    const auto body = makeLattice(width);
    const std::string row = "lattice20/general/w" + std::to_string(width);
    const InstructionSet widest = widestInstructionSet();
    settle(
        benchmark::RegisterBenchmark(row.c_str(), [=](benchmark::State& s) { runLattice(s, *body, widest, false); }));
    settle(benchmark::RegisterBenchmark((row + "/2threads").c_str(),
                                        [=](benchmark::State& s) { runLattice(s, *body, widest, true); }));
    settle(benchmark::RegisterBenchmark(("reference/" + row).c_str(),
                                        [=](benchmark::State& s) { runPlainLattice(s, *body); }));
    for (InstructionSet set : {InstructionSet::kBaseline, InstructionSet::kAvx2})
      if (instructionSetAvailable(set))
        settle(benchmark::RegisterBenchmark(("sets/" + row + "/" + set_names[static_cast<int>(set)]).c_str(),
                                            [=](benchmark::State& s) { runLattice(s, *body, set, false); }));
  }
}

}  // namespace
}  // namespace meshless

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  meshless::registerPile();
  meshless::registerLattice();
  // Further rows (lattice20/summed, lattice20/cells, liver_frame and their references) are registered here.
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
