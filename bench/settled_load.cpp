#include "settled_load.h"

#include <chrono>
#include <cmath>

#include <Eigen/Geometry>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/body/filled_cells.h"
#include "meshless_surgery/geometry/measures.h"
#include "meshless_surgery/world/world.h"
#include "truth_surface.h"

namespace meshless::bench {
namespace {

constexpr double kAtRest = 2e-4;  // of the largest displacement, in a time constant: then it is at rest
constexpr int kMostTimes = 60;    // time constants

HeldRegion heldBy(const TruthCase& truth) {
  Plane plane;
  if (truth.has("held_plane_point")) {
    plane = {truth.vector("held_plane_normal").normalized(), truth.vector("held_plane_point")};
  } else {  // of the organ
    plane = {Vec3::UnitX(), Vec3(truth.number("fixed_below"), 0.0, 0.0)};
  }
  return {Region::below(plane), false};
}

Pose placingOf(const TruthCase& truth) {
  Pose pose;
  if (!truth.has("placed_rpy_degrees")) return pose;
  const Vec3 rpy = M_PI / 180.0 * truth.vector("placed_rpy_degrees");
  pose.rotation = Eigen::AngleAxisd(rpy.z(), Vec3::UnitZ()) * Eigen::AngleAxisd(rpy.y(), Vec3::UnitY()) *
                  Eigen::AngleAxisd(rpy.x(), Vec3::UnitX());
  pose.translation = Vec3(0.1, -0.2, 0.3);
  return pose;
}

// Where the rest shape lies, from the body's own frame.
Pose restFrame(const Points& own, const Points& rest) {
  Eigen::Matrix3Xd from(3, own.size()), to(3, own.size());
  for (std::size_t v = 0; v < own.size(); ++v) {
    from.col(static_cast<Eigen::Index>(v)) = own[v];
    to.col(static_cast<Eigen::Index>(v)) = rest[v];
  }
  const Eigen::Matrix4d motion = Eigen::umeyama(from, to, false);
  return {Quat(Mat3(motion.topLeftCorner<3, 3>())), motion.topRightCorner<3, 1>()};
}

SurfaceBinding bindSamples(const BodyModel& model, const Points& places) {
  if (!model.lattice)
    return bindSurface(model.rest, model.graph, model.clusters, places, std::vector<Index>(places.size(), kNoIndex));
  const CellFinder finder(*model.lattice);
  std::vector<Index> cells;
  for (const Vec3& p : places) cells.push_back(finder.carrier(p));
  return bindToCells(*model.lattice, places, cells);
}

}  // namespace

Result<SettledResult> settle(const TruthCase& truth, const std::string& folder, const SettledOptions& options) {
  Result<TriangleMesh> surface = readSurface(folder + "/" + truth.text("surface"));
  if (!surface) return surface.error();
  double largest = 0.0;
  std::size_t tip = 0;
  for (std::size_t s = 0; s < truth.displacement.size(); ++s)
    if (truth.displacement[s].norm() > largest) {
      largest = truth.displacement[s].norm();
      tip = s;
    }
  std::vector<double> areas(truth.rest.size(), 1.0);
  if (truth.rest.size() == surface->vertices.size()) {  // the samples are its vertices
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
  def.cells = options.cells;
  def.fixed = {heldBy(truth)};
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
      std::max(1.0, highestFrequencyNow(*model, body->state) / settings.step_rate / settings.max_substeps);
  rate /= slower;
  body->def.material.damping = 2.0 * rate;
  settings.ground.reset();
  settings.gravity = pose.rotation * gravity;
  settings.contact = ContactMethod::kNone;
  settings.sleep = false;
  World world(settings);
  const Result<SpawnReply> added = world.addSceneBody(std::make_shared<const PreparedBody>(std::move(*body)));
  if (!added) return added.error();

  SettledResult result;
  result.spacing = model->spacing;
  result.particles = model->rest.size();
  SnapshotWants wants;
  wants.particles = true;
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

  const Pose rest_frame = restFrame(surface->vertices, model->surface.vertices);
  Points places;
  for (const Vec3& p : truth.rest) places.push_back(rest_frame * p);
  const SurfaceBinding samples = bindSamples(*model, places);
  std::vector<ClusterPose> poses(model->clusters.size());
  fitClusters(matchInput(*model), after.particles, poses);  // for levers
  double squares = 0.0, area = 0.0;
  for (Index s = 0; s < truth.rest.size(); ++s) {
    const Vec3 now = embeddedPosition(samples, after.particles, poses, s);
    const Vec3 moved = pose.rotation.conjugate() * (now - pose.translation) - truth.rest[s];
    squares += areas[s] * (moved - truth.displacement[s]).squaredNorm();
    area += areas[s];
    if (s == tip) result.tip = moved.dot(truth.displacement[s]) / (largest * largest);
  }
  result.error = std::sqrt(squares / area) / largest;
  return result;
}

}  // namespace meshless::bench
