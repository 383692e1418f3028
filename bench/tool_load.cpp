#include "tool_load.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/world/world.h"
#include "truth_samples.h"
#include "truth_surface.h"

namespace meshless::bench {
namespace {

constexpr double kPushedToRest = 2e-4;  // of the largest displacement, in a time constant
constexpr int kMostPushed = 80;         // time constants
constexpr double kBlockEdge = 0.0125;   // [m] as a user's model of a block could have it

struct Placed {
  Points own;  // vertices as they were given, in the world
  BodyModelPtr model;
  std::shared_ptr<const PreparedBody> body;
  double rate = 0.0;  // [1/s] of the slowest mode, as slowed by the substeps
};

Result<Placed> place(const TruthCase& truth, TriangleMesh mesh, const Vec3& at, const ToolOptions& options, double rate,
                     const WorldSettings& settings) {
  Placed placed;
  for (const Vec3& v : mesh.vertices) placed.own.push_back(v + at);
  BodyDef def;
  def.name = truth.text("case");
  def.mesh = std::move(mesh);
  def.pose.translation = at;
  for (HeldRegion held : heldBy(truth)) {
    held.in_world = true;  // the truth's places are those of the world
    def.fixed.push_back(held);
  }
  def.material.youngs_modulus = truth.number("youngs_modulus");
  def.material.poissons_ratio = truth.number("poissons_ratio");
  def.material.density = truth.number("density");
  def.material.friction = 0.0;  // the truth's sphere is slippery
  if (truth.has("ball_center")) {
    TissueRegion ball{Region::sphere(truth.vector("ball_center") - at, truth.number("ball_radius")), def.material};
    ball.material.youngs_modulus = truth.number("ball_youngs_modulus");
    def.regions.push_back(ball);
  }
  def.spacing = options.spacing;
  if (!(options.spacing > 0.0) && options.finer != 1.0) {
    const Result<PreparedBody> coarse = prepareBody(def);
    if (!coarse) return coarse.error();
    def.spacing = coarse->model->spacing / options.finer;
  }
  Result<PreparedBody> body = prepareBody(std::move(def));
  if (!body) return body.error();
  placed.model = body->model;
  const double slower =
      1.0 / std::sqrt(stiffnessFactor(*placed.model, body->state, 1.0 / settings.step_rate / settings.max_substeps));
  placed.rate = rate / slower;
  body->def.material.damping = 2.0 * placed.rate;
  placed.body = std::make_shared<const PreparedBody>(std::move(*body));
  return placed;
}

WorldSettings quietWorld() {
  WorldSettings settings;
  settings.ground.reset();
  settings.gravity.setZero();
  settings.sleep = false;
  return settings;
}

struct Rest {
  BodySnapshot body;
  double force = 0.0;  // mean of `measure` over the last time constant
  bool at_rest = false;
  double step_ms = 0.0;
};

// Steps until nothing moves by more than kPushedToRest * largest within a time constant.
template <typename Measure>
Rest untilAtRest(World& world, double rate, double largest, const Measure& measure) {
  Rest rest;
  SnapshotWants wants;
  wants.particles = wants.surfaces = true;
  const int between = static_cast<int>(std::ceil(world.settings().step_rate / rate));
  rest.body = world.snapshot(wants).bodies[0];
  const auto start = std::chrono::steady_clock::now();
  int steps = 0;
  for (; steps < kMostPushed * between && !rest.at_rest; steps += between) {
    rest.force = 0.0;
    for (int step = 0; step < between; ++step) {
      world.step();
      rest.force += measure(world) / between;
    }
    const Points before = std::move(rest.body.particles);
    rest.body = world.snapshot(wants).bodies[0];
    double moving = 0.0;
    for (std::size_t i = 0; i < before.size(); ++i)
      moving = std::max(moving, (rest.body.particles[i] - before[i]).norm() / largest);
    rest.at_rest = moving < kPushedToRest;
  }
  rest.step_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count() / steps;
  return rest;
}

ToolResult resultOf(const Placed& placed, const Rest& rest) {
  ToolResult result;
  result.spacing = placed.model->spacing;
  result.particles = placed.model->rest.size();
  result.force = rest.force;
  result.at_rest = rest.at_rest;
  result.step_ms = rest.step_ms;
  return result;
}

// A block's slowest mode is a shear wave of a quarter of its length in its height.
double blockRate(const TruthCase& truth, double height) {
  const double shear = truth.number("youngs_modulus") / (2.0 * (1.0 + truth.number("poissons_ratio")));
  return 0.5 * M_PI / height * std::sqrt(shear / truth.number("density"));
}

}  // namespace

Result<ToolResult> press(const TruthCase& truth, const ToolOptions& options) {
  const Vec3 low = truth.vector("box_min"), high = truth.vector("box_max");
  const double edge = options.edge > 0.0 ? options.edge : kBlockEdge;
  const WorldSettings settings = quietWorld();
  const Result<Placed> placed =
      place(truth,
            truth.text("body") == "cylinder" ? cylinderMesh(high.z() - low.z(), 0.5 * (high.x() - low.x()), edge)
                                             : boxMesh(high - low, edge),
            0.5 * (low + high), options, blockRate(truth, high.z() - low.z()), settings);
  if (!placed) return placed.error();
  World world(settings);
  if (const Result<SpawnReply> added = world.addSceneBody(placed->body); !added) return added.error();

  const double radius = truth.number("sphere_radius"), depth = truth.number("sphere_depth");
  const double at = truth.has("sphere_at") ? truth.number("sphere_at") : truth.vector("sphere_center").x();
  PushCommand push;
  push.radius = radius;
  push.position = Vec3(at, 0.0, high.z() + radius + 0.001) + options.beside;
  if (const Result<Reply> done = world.apply(push); !done) return done.error();
  push.position.z() = high.z() + radius - depth;
  push.speed = (depth + 0.001) * placed->rate / 10.0;  // in ten time constants
  if (const Result<Reply> done = world.apply(push); !done) return done.error();
  for (int step = 0; step < 11.0 / placed->rate * settings.step_rate; ++step) world.step();
  const Rest rest = untilAtRest(world, placed->rate, depth, [](const World& w) { return w.push().force.z(); });

  ToolResult result = resultOf(*placed, rest);
  result.ratio = rest.force / truth.number("indentation_force");
  const Points moved = movedSamples(truth, *placed->model, placed->own, Pose(), rest.body.particles);
  std::size_t tip = 0;
  const double largest = largestOf(truth, tip);
  result.error = distanceTo(truth, moved, {});
  result.tip = moved[tip].dot(truth.displacement[tip]) / (largest * largest);
  return result;
}

Result<ToolResult> pull(const TruthCase& truth, const ToolOptions& options) {
  const Vec3 low = truth.vector("box_min"), high = truth.vector("box_max");
  WorldSettings settings = quietWorld();
  settings.pick_radius = truth.number("grasp_radius");
  const Result<Placed> placed = place(truth, boxMesh(high - low, options.edge > 0.0 ? options.edge : kBlockEdge),
                                      0.5 * (low + high), options, blockRate(truth, high.z() - low.z()), settings);
  if (!placed) return placed.error();
  World world(settings);
  if (const Result<SpawnReply> added = world.addSceneBody(placed->body); !added) return added.error();

  std::size_t tip = 0;
  const double largest = largestOf(truth, tip);
  PickCommand pick;
  pick.point = Vec3(0.5 * (low.x() + high.x()), 0.5 * (low.y() + high.y()), high.z());
  const Result<Reply> picked = world.apply(pick);
  if (!picked) return picked.error();
  const PickReply& reply = std::get<PickReply>(*picked);
  MovePickCommand move;
  move.pick = reply.pick;
  move.target = reply.position + (largest + truth.number("pull_force") / settings.pick_stiffness) * Vec3::UnitZ();
  if (const Result<Reply> done = world.apply(move); !done) return done.error();
  const Rest rest = untilAtRest(world, placed->rate, largest,
                                [](const World& w) { return w.heldPick() ? w.heldPick()->force.z() : 0.0; });

  ToolResult result = resultOf(*placed, rest);
  result.ratio = rest.force / truth.number("pull_force");
  const Points moved = movedSamples(truth, *placed->model, placed->own, Pose(), rest.body.particles);
  result.error = distanceTo(truth, moved, {}, result.ratio);
  result.tip = moved[tip].dot(truth.displacement[tip]) / (largest * largest) / result.ratio;
  return result;
}

Result<ToolResult> hangIncised(const TruthCase& truth, const std::string& folder, const ToolOptions& options) {
  Result<TriangleMesh> surface = readSurface(folder + "/" + truth.text("surface"));
  if (!surface) return surface.error();
  std::size_t tip = 0;
  const double largest = largestOf(truth, tip);
  WorldSettings settings = quietWorld();
  settings.contact = ContactMethod::kNone;
  const Vec3 gravity = truth.vector("gravity");
  settings.gravity = gravity;
  const Result<Placed> placed =
      place(truth, std::move(*surface), Vec3::Zero(), options, std::sqrt(1.54 * gravity.norm() / largest), settings);
  if (!placed) return placed.error();
  World world(settings);
  if (const Result<SpawnReply> added = world.addSceneBody(placed->body); !added) return added.error();
  InciseCommand incise;
  incise.blade.origin = truth.vector("blade_origin");
  incise.blade.x_axis = truth.vector("blade_x_axis");
  incise.blade.y_axis = truth.vector("blade_y_axis");
  incise.blade.length = truth.number("blade_length");
  incise.blade.depth = truth.number("blade_depth");
  if (const Result<Reply> done = world.apply(incise); !done) return done.error();

  const Rest rest = untilAtRest(world, placed->rate, largest, [](const World&) { return 0.0; });
  ToolResult result = resultOf(*placed, rest);
  result.particles = rest.body.model->rest.size();
  // Vertices keep their places in the rest shape; those of the mouth are doubled there.
  const Points& at_rest = rest.body.model->surface.vertices;
  const Pose frame = restFrame(placed->own, Points(at_rest.begin(), at_rest.begin() + placed->own.size()));
  Points there;
  for (const Vec3& p : at_rest) there.push_back(frame.rotation.conjugate() * (p - frame.translation));
  const auto vertexAt = [&](const Vec3& p) {
    return static_cast<Index>(
        std::min_element(there.begin(), there.end(),
                         [&](const Vec3& a, const Vec3& b) { return (a - p).squaredNorm() < (b - p).squaredNorm(); }) -
        there.begin());
  };
  Points moved;
  for (const Vec3& p : truth.rest) moved.push_back(rest.body.surface[vertexAt(p)] - p);
  result.error = distanceTo(truth, moved, {});
  result.tip = moved[tip].dot(truth.displacement[tip]) / (largest * largest);
  const Vec3 mouth = truth.vector("mouth_place");
  double nearest = std::numeric_limits<double>::infinity();
  for (Index v = 0; v < there.size(); ++v)
    for (Index w = v + 1; w < there.size(); ++w)
      if ((there[v] - there[w]).norm() < 1e-6 && std::abs(there[v].z() - mouth.z()) < 1e-6 &&
          (there[v] - mouth).norm() < nearest + 1e-6) {
        const double open = (rest.body.surface[v] - rest.body.surface[w]).norm();
        // Two of several vertices at one place can be of one lip.
        result.force = (there[v] - mouth).norm() < nearest - 1e-6 ? open : std::max(result.force, open);
        nearest = std::min(nearest, (there[v] - mouth).norm());
      }
  result.ratio = result.force / truth.number("mouth_opening");
  return result;
}

}  // namespace meshless::bench
