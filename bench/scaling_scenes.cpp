#include "scaling_scenes.h"

#include <cmath>
#include <string>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "shapes/random_organ.h"

namespace meshless::bench {
namespace {

constexpr std::uint64_t kOrganSeed = 1;
constexpr double kSize = 0.2, kAbove = 0.002, kCube = 0.1;  // [m]
constexpr std::size_t kTriangles = 4120;
constexpr int kTries = 6;  // of a spacing
constexpr double kNear = 0.05;

BodyPtr prepared(BodyDef def) {
  Result<PreparedBody> body = prepareBody(std::move(def));
  return body ? std::make_shared<const PreparedBody>(std::move(*body)) : nullptr;
}

}  // namespace

Material elasticLiver() {
  Material material;
  material.youngs_modulus = 4500.0;
  material.poissons_ratio = 0.45;
  material.density = 1060.0;
  material.damping = 10.0;
  material.friction = 0.3;
  return material;
}

BodyPtr makeOrgan(std::size_t triangles, double spacing) {
  Result<TriangleMesh> mesh = randomOrgan(kOrganSeed, 0, kSize, triangles);
  if (!mesh) return nullptr;
  BodyDef def;
  def.name = "organ";
  def.mesh = std::move(*mesh);
  def.pose.translation.z() = kAbove - boundsOf(def.mesh.vertices).min.z();
  def.material = elasticLiver();
  def.spacing = spacing;
  return prepared(std::move(def));
}

BodyPtr makeOrganOf(std::size_t wanted, const std::function<std::size_t(const BodyModel&)>& count) {
  const Result<TriangleMesh> mesh = randomOrgan(kOrganSeed, 0, kSize, kTriangles);
  if (!mesh) return nullptr;
  double spacing = std::cbrt(signedVolume(*mesh) / static_cast<double>(wanted));
  BodyPtr body;
  for (int n = 0; n < kTries; ++n) {
    body = makeOrgan(kTriangles, spacing);
    if (!body) return nullptr;
    const double share = static_cast<double>(count(*body->model)) / static_cast<double>(wanted);
    if (std::abs(share - 1.0) < kNear) break;
    spacing *= std::pow(share, 1.0 / 2.7);  // the surface has cells that are filled in part
  }
  return body;
}

std::size_t particlesOf(const BodyModel& model) { return model.rest.size(); }
std::size_t cellsOf(const BodyModel& model) { return model.cells->cells.size(); }

World makeWorld(int threads, bool sleep) {
  WorldSettings settings;
  settings.threads = threads;
  settings.sleep = sleep;
  return World(settings);
}

World worldWith(const BodyPtr& body, int threads, bool sleep) {
  World world = makeWorld(threads, sleep);
  static_cast<void>(world.addSceneBody(body));
  return world;
}

World worldOfCubes(int count, bool elastic, int threads) {
  World world = makeWorld(threads, false);
  BodyDef def;
  def.name = "cube";
  def.mesh = boxMesh(Vec3::Constant(kCube), 2, 2, 2);
  def.spacing = 0.5 * kCube;
  if (elastic)
    def.material = elasticLiver();
  else
    def.clusters.kind = ClusterOptions::Kind::kOne;
  const Result<PreparedBody> cube = prepareBody(std::move(def));
  const int columns = static_cast<int>(std::ceil(std::sqrt(count)));
  for (int k = 0; cube && k < count; ++k) {
    Pose pose;
    pose.translation = kCube * Vec3(1.5 * (k % columns), 1.5 * (k / columns), 0.5);
    static_cast<void>(
        world.addSceneBody(std::make_shared<const PreparedBody>(placedCopy(*cube, "cube" + std::to_string(k), pose))));
  }
  return world;
}

}  // namespace meshless::bench
