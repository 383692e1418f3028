#include "settled_load.h"

#include <chrono>
#include <cmath>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/world/world.h"
#include "truth_samples.h"
#include "truth_surface.h"

namespace meshless::bench {
namespace {

constexpr double kAtRest = 2e-4;  // of the largest displacement, in a time constant: then it is at rest
constexpr int kMostTimes = 60;    // time constants

// What edges turn and stretch by: creases show here, however near to its place each vertex is. Edges from what is held
// are left out: strain is singular at the border of a clamp.
double slopeError(const std::vector<Triangle>& triangles, const TruthCase& truth, const Points& moved) {
  double wrong = 0.0, all = 0.0;
  for (const Triangle& t : triangles)
    for (int k = 0; k < 3; ++k) {
      const Index a = t[k], b = t[(k + 1) % 3];
      const double length = (truth.rest[b] - truth.rest[a]).norm();
      if (truth.displacement[a].isZero() || truth.displacement[b].isZero()) continue;
      const Vec3 apart = truth.displacement[b] - truth.displacement[a];
      wrong += (moved[b] - moved[a] - apart).squaredNorm() / (length * length);
      all += apart.squaredNorm() / (length * length);
    }
  return std::sqrt(wrong / all);
}

}  // namespace

Result<SettledResult> settle(const TruthCase& truth, const std::string& folder, const SettledOptions& options) {
  Result<TriangleMesh> surface = readSurface(folder + "/" + truth.text("surface"));
  if (!surface) return surface.error();
  std::size_t tip = 0;
  const double largest = largestOf(truth, tip);
  std::vector<double> areas;
  const bool of_surface = truth.rest.size() == surface->vertices.size();  // the samples are its vertices
  if (of_surface) {
    areas.assign(truth.rest.size(), 0.0);
    for (const Triangle& t : surface->triangles) {
      const Vec3 &a = surface->vertices[t[0]], &b = surface->vertices[t[1]], &c = surface->vertices[t[2]];
      for (const Index v : t) areas[v] += (b - a).cross(c - a).norm() / 6.0;
    }
  }
  // Damped as the slowest mode of a cantilever asks for: its frequency squared is 1.54 g / sag.
  const Vec3 gravity = options.stiffer * truth.vector("gravity");
  double rate = std::sqrt(1.54 * gravity.norm() / largest);

  BodyDef def;
  def.name = truth.text("case");
  def.mesh = *surface;
  def.pose = placingOf(truth);
  def.fixed = heldBy(truth);
  def.material.youngs_modulus = options.stiffer * truth.number("youngs_modulus");
  def.material.poissons_ratio = truth.number("poissons_ratio");
  def.material.density = truth.number("density");
  def.spacing = options.spacing;
  if (!(options.spacing > 0.0) && options.finer != 1.0) {
    const Result<PreparedBody> coarse = prepareBody(def);
    if (!coarse) return coarse.error();
    def.spacing = coarse->model->spacing / options.finer;
  }
  const Pose pose = def.pose;
  Result<PreparedBody> body = prepareBody(std::move(def));
  if (!body) return body.error();
  const BodyModelPtr model = body->model;

  WorldSettings settings;
  settings.max_substeps = options.max_substeps;
  const double slower =
      1.0 / std::sqrt(stiffnessFactor(*model, body->state, 1.0 / settings.step_rate / settings.max_substeps));
  rate /= slower;
  body->def.material.damping = options.sleeps ? 10.0 : 2.0 * rate;
  settings.ground.reset();
  settings.gravity = pose.rotation * gravity;
  settings.contact = ContactMethod::kNone;
  settings.sleep = options.sleeps;
  World world(settings);
  const Result<SpawnReply> added = world.addSceneBody(std::make_shared<const PreparedBody>(std::move(*body)));
  if (!added) return added.error();

  SettledResult result;
  result.spacing = model->spacing;
  result.particles = model->rest.size();
  SnapshotWants wants;
  wants.particles = wants.surfaces = true;
  const int between = static_cast<int>(std::ceil(settings.step_rate / rate));  // steps in a time constant
  BodySnapshot after = world.snapshot(wants).bodies[0];
  const auto start = std::chrono::steady_clock::now();
  result.moving = 1.0;
  int steps = 0;
  for (; steps < kMostTimes * between && result.moving > kAtRest; steps += between) {
    for (int step = 0; step < between; ++step) world.step();
    const Points before = std::move(after.particles);
    after = world.snapshot(wants).bodies[0];
    result.moving = 0.0;
    for (std::size_t i = 0; i < before.size(); ++i)
      result.moving = std::max(result.moving, (after.particles[i] - before[i]).norm() / largest);
  }
  result.step_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count() / steps;
  result.slower = 1.0 / std::sqrt(after.stiffness_factor);
  result.substeps = world.snapshot({}).report.substeps;

  Points moved;
  if (of_surface) {  // as a viewer gets them
    for (std::size_t v = 0; v < truth.rest.size(); ++v)
      moved.push_back(pose.rotation.conjugate() * (after.surface[v] - pose.translation) - truth.rest[v]);
    result.slope = slopeError(surface->triangles, truth, moved);
  } else {
    moved = movedSamples(truth, *model, surface->vertices, pose, after.particles);
  }
  result.error = distanceTo(truth, moved, areas);
  for (std::size_t s = 0; s < moved.size(); ++s)
    result.farthest = std::max(result.farthest, (moved[s] - truth.displacement[s]).norm() / largest);
  result.tip = moved[tip].dot(truth.displacement[tip]) / (largest * largest);
  return result;
}

}  // namespace meshless::bench
