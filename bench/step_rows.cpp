#include "step_rows.h"

#include <cmath>

namespace meshless::bench {

double uniform(Engine& engine, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(engine);
}
Vec3 randomVector(Engine& engine, double size) {
  const double x = uniform(engine, -size, size), y = uniform(engine, -size, size), z = uniform(engine, -size, size);
  return Vec3(x, y, z);
}

namespace {

void pause() {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#endif
}

}  // namespace

TwoThreads::~TwoThreads() {
  stop_ = true;
  worker_.join();
}

void TwoThreads::operator()(std::size_t count, const std::function<void(std::size_t)>& work) {
  work_ = &work;
  finished_.store(0, std::memory_order_relaxed);
  left_.store(count, std::memory_order_release);
  while (take(true)) {
  }
  while (finished_.load(std::memory_order_acquire) != count) pause();
}

bool TwoThreads::take(bool front) {
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

void TwoThreads::run() {
  for (int idle = 0; !stop_; ++idle) {
    if (take(false)) idle = 0;
    if (idle > 20000) std::this_thread::yield();
    pause();
  }
}

Loop::Loop(bool two_threads) : for_each_(oneAfterAnother) {
  if (!two_threads) return;
  threads_ = std::make_unique<TwoThreads>();
  for_each_ = [this](std::size_t count, const std::function<void(std::size_t)>& work) { (*threads_)(count, work); };
}

void Plain::finish() {
  model.match_masses = model.masses;
  model.fixed.assign(model.rest.size(), false);
  for (double m : model.masses) model.mass += m;
  model.shape = makeRestShape(model.rest, model.masses, model.clusters);
  state.positions = model.rest;
  state.velocities.assign(model.rest.size(), Vec3::Zero());
  state.poses.resize(model.clusters.size());
}

void Plain::step(const Material& material, const BatchStep& s) {
  matchAndMove(model, material, s.gravity, s.h, state, scratch, counters);
  velocitiesFromPositions(s.h, state, scratch);
}

void addLattice(int n, BodyModel& model) {
  for (int z = 0; z < n; ++z)
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x) model.rest.push_back(kSpacing * Vec3(x, y, z));
  model.masses.assign(model.rest.size(), 1000.0 * kSpacing * kSpacing * kSpacing);
}

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

Material appearanceOf(MatchMode mode) {
  Material material;
  material.mode = mode;
  material.alpha = 0.5;
  material.beta = 0.5;
  material.damping = 0.5;
  return material;
}
BatchStep stepOf(const Material& material) { return batchStep(material, kStep); }

double farthest(const Points& a, const Points& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    if (!((a[i] - b[i]).norm() <= largest)) largest = (a[i] - b[i]).norm();
  return largest;
}

void settle(benchmark::internal::Benchmark* b) {
  b->MinTime(0.05)->Repetitions(9)->ReportAggregatesOnly()->Unit(benchmark::kMillisecond)->UseRealTime();
}

}  // namespace meshless::bench
