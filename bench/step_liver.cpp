// Frames of the world: a liver with its ligament held, and a body with and without a fine surface embedded in it.
#include <algorithm>

#include "shapes/organs.h"
#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/world/world.h"
#include "step_rows.h"

namespace meshless::bench {
namespace {

constexpr double kFrameRate = 60.0;  // [Hz]
constexpr int kSettle = 30;          // frames before time is taken

Material tissue(bool elastic) {
  Material material;
  if (elastic) material.youngs_modulus = 5000.0;
  material.poissons_ratio = 0.45;
  material.density = 1060.0;
  material.damping = 4.0;
  return material;
}

std::shared_ptr<const PreparedBody> prepared(BodyDef def) {
  Result<PreparedBody> body = prepareBody(std::move(def));
  return body ? std::make_shared<PreparedBody>(std::move(*body)) : nullptr;
}

std::shared_ptr<const PreparedBody> makeLiver() {
  BodyDef def;
  def.name = "liver";
  def.mesh = liverMesh();
  for (Vec3& p : def.mesh.vertices) p *= 0.5;
  def.pose.translation = Vec3(0.0, 0.0, 0.03);
  def.spacing = 0.005;
  def.material = tissue(true);
  def.fixed = {{Vec3(-0.06, 0.0225, 0.0275), Vec3(0.06, 0.05, 0.06)}};
  return prepared(std::move(def));
}

// About 1,000 particles in a ball with a surface of about 10,000 triangles; `surface` leaves it on.
std::shared_ptr<const PreparedBody> makeBall(bool elastic, bool surface) {
  BodyDef def;
  def.name = "ball";
  def.mesh = sphereMesh(0.05, 0.0025);
  def.pose.translation = Vec3(0.0, 0.0, 1.0);
  def.spacing = 0.0102;
  def.clusters.kind = ClusterOptions::Kind::kCells;
  def.material = tissue(elastic);
  const std::shared_ptr<const PreparedBody> with = prepared(std::move(def));
  if (surface || !with) return with;
  PreparedBody without = *with;
  BodyModel model = *with->model;
  model.surface = TriangleMesh();
  model.binding = ownVertices(0);
  model.solid = false;
  without.model = std::make_shared<BodyModel>(std::move(model));
  without.state.surface.clear();
  return std::make_shared<PreparedBody>(std::move(without));
}

WorldSettings settingsOf(std::optional<double> ground) {
  WorldSettings settings;
  settings.step_rate = kFrameRate;
  settings.ground = ground;
  return settings;
}

// wants: what a viewer would ask for after each frame.
void runFrames(benchmark::State& state, const std::shared_ptr<const PreparedBody>& body, const WorldSettings& settings,
               const SnapshotWants& wants) {
  if (!body) return state.SkipWithError("the body could not be prepared");
  World world(settings);
  const Result<SpawnReply> reply = world.addSceneBody(body);
  if (!reply) return state.SkipWithError(reply.error().detail.c_str());
  for (int frame = 0; frame < kSettle; ++frame) world.step();
  double substeps = 0.0, frames = 0.0;
  WorldSnapshot seen;
  for (auto _ : state) {
    world.step();
    if (wants.surfaces) benchmark::DoNotOptimize(seen = world.snapshot(wants));
    state.PauseTiming();
    substeps += static_cast<double>(world.snapshot({}).report.substeps);
    frames += 1.0;
    state.ResumeTiming();
  }
  state.counters["substeps"] = substeps / frames;
  state.counters["particles"] = static_cast<double>(body->model->rest.size());
  state.counters["triangles"] = static_cast<double>(body->model->surface.triangles.size());
  state.counters["riders"] = static_cast<double>(body->model->binding.size());
}

// The same frames without vectors: a material that may flow takes the plain path, and this one never does.
void runPlainLiver(benchmark::State& state, const std::shared_ptr<const PreparedBody>& liver) {
  if (!liver) return state.SkipWithError("the body could not be prepared");
  auto plain = std::make_shared<PreparedBody>(*liver);
  plain->def.material.plasticity.creep = 1e-300;
  World vectors(settingsOf(0.0)), reference(settingsOf(0.0));
  if (!vectors.addSceneBody(liver) || !reference.addSceneBody(plain))
    return state.SkipWithError("the body could not be added");
  for (int n = 0; n < kSettle; ++n) {
    vectors.step();
    reference.step();
  }
  const auto particles = [](World& world) { return world.snapshot({false, true, false}).bodies[0].particles; };
  const double apart = farthest(particles(vectors), particles(reference));
  runFrames(state, plain, settingsOf(0.0), {});
  state.counters["error"] = apart / 0.1;  // of the liver's width, after kSettle frames
}

}  // namespace

void registerLiver() {
  const auto liver = makeLiver();
  const auto add = [](const std::string& name, const auto& run) {
    settle(benchmark::RegisterBenchmark(name.c_str(), run));
  };
  add("liver_frame", [=](benchmark::State& s) { runFrames(s, liver, settingsOf(0.0), {}); });
  add("liver_frame/seen", [=](benchmark::State& s) { runFrames(s, liver, settingsOf(0.0), {true, false, false}); });
  add("reference/liver_frame", [=](benchmark::State& s) { runPlainLiver(s, liver); });
  for (bool elastic : {true, false})
    for (bool surface : {true, false}) {
      const auto ball = makeBall(elastic, surface);
      add(std::string("riders10k/") + (elastic ? "elastic/" : "looks/") + (surface ? "with" : "without"),
          [=](benchmark::State& s) {
            runFrames(s, ball, settingsOf(std::nullopt), {true, false, false});
          });
    }
}

}  // namespace meshless::bench
