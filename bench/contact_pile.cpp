#include "contact_pile.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "meshless_surgery/geometry/mesh/primitives.h"

namespace meshless::bench {
namespace {

constexpr double kColumn = 1.55, kLayer = 1.3, kLowest = 1.0, kJitter = 0.05;  // in sizes
constexpr double kPi = 3.14159265358979323846;

}  // namespace

PileStart startPile(const PileOptions& options) {
  PileStart start;
  start.columns = options.straight ? 1 : static_cast<int>(std::ceil(std::sqrt(options.bodies / 4.0)));
  std::mt19937 engine(7);
  std::uniform_real_distribution<double> jitter(-kJitter, kJitter), yaw(-kPi, kPi);
  const int per_layer = start.columns * start.columns;
  for (int k = 0; k < options.bodies; ++k) {
    const int layer = k / per_layer, x = k % per_layer % start.columns, y = k % per_layer / start.columns;
    Pose pose;
    Vec3 at(kColumn * x, kColumn * y, options.straight ? 0.5 + 1.001 * layer : kLowest + kLayer * layer);
    const double dx = jitter(engine), dy = jitter(engine), turn = yaw(engine);
    if (!options.straight) at += Vec3(dx, dy, 0.0);
    if (options.turned) pose.rotation = Quat(Eigen::AngleAxisd(turn, Vec3::UnitZ()));
    pose.translation = options.size * at;
    start.poses.push_back(pose);
  }
  return start;
}

World makePile(const PileOptions& options) {
  WorldSettings settings;
  settings.step_rate = 60.0;
  settings.substeps = options.substeps;
  settings.contact = options.contact;
  settings.sleep = options.sleeping;
  settings.threads = options.threads;
  World world(settings);
  BodyDef def;
  def.mesh = boxMesh(Vec3::Constant(options.size), 2, 2, 2);
  def.spacing = 0.5 * options.size;
  def.clusters.kind = ClusterOptions::Kind::kOne;
  def.material.alpha = options.alpha;
  def.material.density = 1.0 / (options.size * options.size * options.size);
  def.name = "cube";
  const Result<PreparedBody> cube = prepareBody(def);
  const PileStart start = startPile(options);
  for (std::size_t k = 0; cube && k < start.poses.size(); ++k) {
    auto body = std::make_shared<PreparedBody>(*cube);
    body->def.name = "cube" + std::to_string(k);
    for (Vec3& p : body->state.positions) p = start.poses[k] * p;
    for (Vec3& p : body->state.surface) p = start.poses[k] * p;
    for (ClusterPose& pose : body->state.poses) {
      pose.centre = start.poses[k] * pose.centre;
      pose.rotation = start.poses[k].rotation * pose.rotation;
    }
    static_cast<void>(world.addSceneBody(std::move(body)));
  }
  return world;
}

PileMeasures measurePile(const PileOptions& options, const std::vector<Points>& positions) {
  PileMeasures m;
  const std::size_t count = positions.size();
  struct Cube {
    Vec3 centre;
    Mat3 to_rest;  // to a cube of half size 0.5
  };
  std::vector<Cube> cubes(count);
  Mat3 moment = Mat3::Zero();
  std::vector<Vec3> rest;
  for (std::size_t b = 0; b < count; ++b) {
    const Points& x = positions[b];
    Vec3 centre = Vec3::Zero();
    for (const Vec3& p : x) {
      centre += p / static_cast<double>(x.size());
      m.finite = m.finite && p.allFinite();
    }
    cubes[b].centre = centre;
  }
  if (!m.finite) return m;
  // The frame of a cube: the affine fit to where its particles are at rest, which the first frame of a pile shows.
  PileOptions at_rest = options;
  BodyDef def;
  def.mesh = boxMesh(Vec3::Constant(options.size), 2, 2, 2);
  def.spacing = 0.5 * options.size;
  def.clusters.kind = ClusterOptions::Kind::kOne;
  def.name = "cube";
  const Result<PreparedBody> cube = prepareBody(def);
  if (!cube) return m;
  for (const Vec3& p : cube->state.positions) {
    rest.push_back(p / options.size);
    moment += rest.back() * rest.back().transpose();
  }
  const Mat3 moment_inverse = moment.inverse();
  for (std::size_t b = 0; b < count; ++b) {
    Mat3 sum = Mat3::Zero();
    for (std::size_t i = 0; i < rest.size(); ++i) sum += (positions[b][i] - cubes[b].centre) * rest[i].transpose();
    cubes[b].to_rest = (sum * moment_inverse).inverse();
  }
  std::vector<double> depths;
  std::vector<std::size_t> order(count);
  for (std::size_t b = 0; b < count; ++b) order[b] = b;
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return cubes[a].centre.x() < cubes[b].centre.x(); });
  const double near = 1.8 * options.size;
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t j = i + 1; j < count; ++j) {
      const std::size_t a = order[i], b = order[j];
      if (cubes[b].centre.x() - cubes[a].centre.x() > near) break;
      if ((cubes[b].centre - cubes[a].centre).norm() > near) continue;
      for (int side = 0; side < 2; ++side) {
        const Points& x = positions[side ? b : a];
        const Cube& in = cubes[side ? a : b];
        for (const Vec3& p : x) {
          const double inside = 0.5 - (in.to_rest * (p - in.centre)).cwiseAbs().maxCoeff();
          if (inside > 0.0) depths.push_back(inside);
        }
      }
    }
  for (const Points& x : positions)
    for (const Vec3& p : x)
      if (p.z() < 0.0) depths.push_back(-p.z() / options.size);
  std::sort(depths.begin(), depths.end());
  if (!depths.empty()) {
    m.deepest = depths.back();
    m.p99 = depths[static_cast<std::size_t>(0.99 * static_cast<double>(depths.size() - 1))];
  }
  const int columns = startPile(at_rest).columns, per_layer = columns * columns;
  double sum = 0.0, ideal = 0.0;
  for (std::size_t b = 0; b < count; ++b) {
    sum += cubes[b].centre.z() / options.size;
    ideal += static_cast<double>(static_cast<int>(b) / per_layer) + 0.5;
    m.highest = std::max(m.highest, cubes[b].centre.z());
  }
  m.height = sum / ideal;
  return m;
}

PileMeasures measurePile(const PileOptions& options, World& world) {
  const WorldSnapshot shot = world.snapshot({false, true, true});
  std::vector<Points> positions;
  double fastest = 0.0;
  for (const BodySnapshot& body : shot.bodies) {
    positions.push_back(body.particles);
    fastest = std::max(fastest, body.measures.velocity.norm());
  }
  PileMeasures m = measurePile(options, positions);
  m.fastest = fastest;
  return m;
}

}  // namespace meshless::bench
