// What the rows of bench_step share: the plain double path, two threads, shapes and settings.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <thread>

#include <benchmark/benchmark.h>

#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/dynamics/match_batch.h"

namespace meshless::bench {

constexpr double kSpacing = 0.02;  // [m]
constexpr double kStep = 1.0 / 120.0;
constexpr int kRestart = 120;  // steps: the bodies fall, turn and calm down, over and over

using Engine = std::mt19937;
double uniform(Engine& engine, double low, double high);
Vec3 randomVector(Engine& engine, double size);

// One worker beside the caller. The caller takes chunks from the front and the worker from the back, so that each finds
// in its cache what it left there in the last substep. The worker spins for a while, because a substep is over in less
// time than it takes to wake a thread; the caller waits for what the worker took, not for the worker.
class TwoThreads {
 public:
  TwoThreads() : worker_([this] { run(); }) {}
  ~TwoThreads();
  void operator()(std::size_t count, const std::function<void(std::size_t)>& work);

 private:
  bool take(bool front);
  void run();

  const std::function<void(std::size_t)>* work_ = nullptr;
  alignas(64) std::atomic<std::uint64_t> left_{0};
  alignas(64) std::atomic<std::size_t> finished_{0};
  std::atomic<bool> stop_{false};
  std::thread worker_;
};

// A loop on one thread or, while this lives, on two.
class Loop {
 public:
  explicit Loop(bool two_threads);
  const ForEach& forEach() const { return for_each_; }

 private:
  std::unique_ptr<TwoThreads> threads_;
  ForEach for_each_;
};

// A body as the world steps it, with the plain code.
struct Plain {
  BodyModel model;
  BodyState state;
  StepScratch scratch;
  MatchCounters counters;

  void finish();
  void step(const Material& material, const BatchStep& s);
};

void addLattice(int n, BodyModel& model);
// In the air, turned and in motion, a little out of shape.
void throwIn(Plain& body, Engine& engine, double height, double spin);

Material appearanceOf(MatchMode mode);
BatchStep stepOf(const Material& material);

// The substep of matchAndMove() for an elastic material on elasticAccelerations(), and velocities from positions.
void plainElasticStep(Plain& body, const Material& material, const BatchStep& s);

double farthest(const Points& a, const Points& b);  // NaN where one is
// Median of repetitions, in ms of wall time.
void settle(benchmark::internal::Benchmark* b);

void registerPile();
void registerCells();
void registerLiver();
void registerWorld();

}  // namespace meshless::bench
