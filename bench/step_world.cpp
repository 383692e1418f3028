// What the world adds to a body that uses nothing of it: the same body, in the same process, by World::step() with all
// that it can do switched on, and by the deformer alone (body/deform.h: match, integrate). Runs alternate, so that a
// machine that is busy for a while slows both, and the time is the processor's; `over` is the difference of their
// medians relative to the deformer's.
#include <time.h>

#include <algorithm>

#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/world/world.h"
#include "step_rows.h"

namespace meshless::bench {
namespace {

constexpr int kRuns = 201;
constexpr double kRunTime = 0.001;  // [s] of a run at the least

// A block that floats far above the ground and turns slowly, so that it never sleeps.
std::shared_ptr<const PreparedBody> makeBlock(int edge, bool elastic, int clusters) {
  BodyDef def;
  def.name = "block";
  def.mesh = boxMesh(Vec3::Constant((edge - 1) * kSpacing), edge - 1, edge - 1, edge - 1);
  def.spacing = kSpacing;
  def.pose.translation = Vec3(0.0, 0.0, 10.0);
  if (clusters == 1) def.clusters.kind = ClusterOptions::Kind::kOne;
  if (elastic) {
    def.material.youngs_modulus = 5000.0;
    def.material.poissons_ratio = 0.3;
  }
  Result<PreparedBody> body = prepareBody(std::move(def));
  if (!body) return nullptr;
  const RigidMotion at = rigidMotionOf(*body->model, body->state.positions, body->state.velocities);
  for (std::size_t i = 0; i < body->state.positions.size(); ++i)
    body->state.velocities[i] = Vec3(0.1, 0.2, 0.3).cross(body->state.positions[i] - at.centre);
  return std::make_shared<PreparedBody>(std::move(*body));
}

double now() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double seconds(int times, const std::function<void()>& step) {
  const double start = now();
  for (int n = 0; n < times; ++n) step();
  return (now() - start) / times;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void runBlocks(benchmark::State& state, const std::shared_ptr<const PreparedBody>& block, int bodies) {
  if (!block) return state.SkipWithError("the body could not be prepared");
  WorldSettings settings;
  settings.gravity.setZero();
  World world(settings);
  struct Bare {
    BodyState state;
    StepScratch scratch;
  };
  std::vector<Bare> bare(bodies);
  for (int b = 0; b < bodies; ++b) {
    PreparedBody one = *block;
    one.def.name = "block" + std::to_string(b);
    const Vec3 shift(b % 32, b / 32, 0.0);
    for (Points* points : {&one.state.positions, &one.state.surface})
      for (Vec3& p : *points) p += shift;
    for (ClusterPose& pose : one.state.poses) pose.centre += shift;
    bare[b].state = one.state;
    const Result<SpawnReply> reply = world.addSceneBody(std::make_shared<PreparedBody>(std::move(one)));
    if (!reply) return state.SkipWithError(reply.error().detail.c_str());
  }
  world.step();
  const int substeps = static_cast<int>(world.snapshot({}).report.substeps);
  const double h = 1.0 / settings.step_rate / substeps;
  const BodyModel& model = *block->model;
  const Material& material = block->def.material;
  MatchCounters counters;
  // Many small bodies are matched side by side, as in the world.
  std::vector<MatchInput> inputs;
  std::vector<BatchBody> views;
  for (Bare& body : bare) {
    inputs.push_back(matchInput(model));
    views.push_back({body.state.positions.data(), body.state.velocities.data(), &body.state.poses[0].rotation});
  }
  std::unique_ptr<BodyBatch> batch;
  if (bodies > 1) batch = std::make_unique<BodyBatch>(inputs, false);
  BatchStep batch_step = batchStep(material, h);
  batch_step.gravity = settings.gravity;
  const auto deform = [&] {
    for (int n = 0; n < substeps; ++n) {
      if (batch) {
        for (Bare& body : bare) body.scratch.previous = body.state.positions;
        batch->step(views, batch_step, counters);
      } else {
        matchAndMove(model, material, settings.gravity, h, bare[0].state, bare[0].scratch, counters);
      }
      for (Bare& body : bare) velocitiesFromPositions(h, body.state, body.scratch);
    }
  };
  const auto step = [&] { world.step(); };
  const int times = std::max(1, static_cast<int>(kRunTime / seconds(3, deform)));
  for (auto _ : state) {
    std::vector<double> in_world, alone;
    for (int run = 0; run < kRuns; ++run) {
      in_world.push_back(seconds(times, step));
      alone.push_back(seconds(times, deform));
    }
    state.SetIterationTime(median(in_world));
    state.counters["deformer_ms"] = 1e3 * median(alone);
    state.counters["over"] = median(in_world) / median(alone) - 1.0;
    state.counters["particles"] = static_cast<double>(model.rest.size());
    state.counters["substeps"] = substeps;
    if (world.snapshot({}).report.asleep > 0) state.SkipWithError("a body fell asleep");
  }
}

}  // namespace

void registerWorld() {
  const auto add = [](const std::string& name, const std::shared_ptr<const PreparedBody>& block, int bodies) {
    benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& s) { runBlocks(s, block, bodies); })
        ->Unit(benchmark::kMillisecond)
        ->UseManualTime()
        ->Iterations(1);
  };
  for (const int edge : {13, 20}) {
    const std::string particles = std::to_string(edge * edge * edge);
    add("world/one/" + particles, makeBlock(edge, false, 1), 1);
    add("world/looks/" + particles, makeBlock(edge, false, 0), 1);
    add("world/elastic/" + particles, makeBlock(edge, true, 0), 1);
  }
  add("world/bodies27/1000", makeBlock(3, false, 1), 1000);
}

}  // namespace meshless::bench
