#include "contact_after_cut.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <thread>
#include <vector>

#include "meshless_surgery/body/body.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/world/world.h"

namespace meshless::bench {
namespace {

constexpr int kFalling = 300, kUsual = 20, kNext = 5;  // frames

std::shared_ptr<const PreparedBody> prepared(const char* name, TriangleMesh mesh, double spacing, double height,
                                             double youngs_modulus) {
  BodyDef def;
  def.name = name;
  def.mesh = std::move(mesh);
  def.spacing = spacing;
  def.pose.translation = Vec3(0.0, 0.0, height);
  def.material.youngs_modulus = youngs_modulus;
  Result<PreparedBody> body = prepareBody(std::move(def));
  return body ? std::make_shared<const PreparedBody>(std::move(*body)) : nullptr;
}

double stepTime(World& world) {
  const auto start = std::chrono::steady_clock::now();
  world.step();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

double medianStep(World& world, int frames) {
  std::vector<double> times;
  for (int n = 0; n < frames; ++n) times.push_back(stepTime(world));
  std::nth_element(times.begin(), times.begin() + frames / 2, times.end());
  return times[static_cast<std::size_t>(frames / 2)];
}

}  // namespace

AfterCutTimes timeAfterCut(const AfterCut& of) {
  AfterCutTimes times;
  const auto bed = prepared("bed", boxMesh(Vec3(0.6, 0.6, 0.05), 24, 24, 2), 0.025, 0.03, of.elastic ? 2e4 : 0.0);
  const auto ball = prepared("ball", sphereMesh(0.12, 0.0062), 0.0155, 0.19, of.elastic ? 5e3 : 0.0);
  WorldSettings settings;
  settings.sleep = false;
  settings.threads = of.threads;
  World world(settings);
  if (!bed || !ball || !world.addSceneBody(bed).ok() || !world.addSceneBody(ball).ok()) return times;
  for (int n = 0; n < kFalling; ++n) world.step();
  const double before = medianStep(world, kUsual);
  CutCommand cut;
  cut.bodies = {"ball"};
  cut.blades.origin = Vec3(-10.0, of.upright ? 0.01 : 0.0, of.upright ? 0.1 : 0.17);
  cut.blades.x_axis = Vec3::UnitX();
  cut.blades.y_axis = (of.upright ? Vec3(0.0, 0.2, 1.0) : Vec3(0.0, 1.0, 0.1)).normalized();
  if (!world.apply(cut).ok()) return times;
  std::this_thread::sleep_for(std::chrono::microseconds(16667));
  times.first = stepTime(world);
  times.next = medianStep(world, kNext);
  times.before = before;
  return times;
}

}  // namespace meshless::bench
