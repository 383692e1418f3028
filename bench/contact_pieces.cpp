#include "contact_pieces.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "clock.h"
#include "meshless_surgery/body/body.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/organs.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "shapes/random_organ.h"

namespace meshless::bench {

double secondsOf(World& world, int steps) {
  const double start = now();
  for (int n = 0; n < steps; ++n) world.step();
  return now() - start;
}

bool cutAll(World& world, std::mt19937_64& random) {
  Vec3 centre = Vec3::Zero();
  double mass = 0.0;
  for (const BodySnapshot& body : world.snapshot({false, false, true}).bodies) {
    centre += body.model->mass * body.measures.centre_of_mass;
    mass += body.model->mass;
  }
  std::normal_distribution<double> normal;
  const Vec3 across = Vec3(normal(random), normal(random), normal(random)).normalized();
  CutCommand cut;
  cut.blades.x_axis = across.unitOrthogonal();
  cut.blades.y_axis = across.cross(cut.blades.x_axis);
  cut.blades.origin = centre / mass - 10.0 * cut.blades.x_axis;
  return world.apply(cut).ok();
}

PiecesTimes timePieces(const Pieces& of) {
  PiecesTimes times;
  BodyDef def;
  def.name = "organ";
  Result<TriangleMesh> mesh = randomOrgan(of.seed, of.genus, 0.2, of.triangles);
  if (!mesh) return times;
  Box box;
  for (const Vec3& p : mesh->vertices) box.extend(p);
  def.mesh = std::move(*mesh);
  def.pose.translation = Vec3(0.0, 0.0, 0.002 - box.min.z());
  def.material = of.material;
  Result<PreparedBody> body = prepareBody(std::move(def));
  WorldSettings settings;
  settings.threads = of.threads;
  World world(settings);
  if (!body || !world.addSceneBody(std::make_shared<const PreparedBody>(std::move(*body))).ok()) return times;
  const int second = static_cast<int>(settings.step_rate);
  (void)secondsOf(world, second);
  const double uncut = secondsOf(world, second);
  std::mt19937_64 random(of.seed);
  for (int n = 0; n < of.cuts; ++n)
    if (!cutAll(world, random)) return times;
  const double first = secondsOf(world, 1);
  times.early = 2.0 * (first + secondsOf(world, second / 2 - 1));
  (void)secondsOf(world, second + second / 2);
  times.late = secondsOf(world, second);
  times.first = 1e3 * first;
  times.uncut = uncut;
  const WorldSnapshot shot = world.snapshot({true, false, true});
  times.least_volume = 1e9;
  double energy = 0.0, mass = 0.0;
  for (const BodySnapshot& piece : shot.bodies) {
    const double share = piece.measures.volume / piece.model->rest_volume;
    times.least_volume = std::min(times.least_volume, share);
    times.most_volume = std::max(times.most_volume, share);
    energy += piece.measures.kinetic_energy;
    mass += piece.model->mass;
  }
  times.speed = std::sqrt(2.0 * energy / mass);
  times.pieces = shot.bodies.size();
  times.asleep = shot.report.asleep;
  return times;
}

double timeOrgans(bool cut, int threads) {
  WorldSettings settings;
  settings.threads = threads;
  World world(settings);
  const TriangleMesh meshes[] = {liverMesh(), kidneyMesh(1), kidneyMesh(2), sphereMesh(0.022, 0.004),
                                 boxMesh(Vec3::Constant(0.09), 0.01)};
  double x = 0.0;
  for (const TriangleMesh& mesh : meshes) {
    const Box box = boundsOf(mesh.vertices);
    BodyDef def;
    def.name = "organ_" + std::to_string(world.bodyCount());
    def.mesh = mesh;
    def.material.youngs_modulus = world.bodyCount() == 0 ? 4500.0 : 5000.0;
    def.material.poissons_ratio = 0.45;
    def.material.density = 1060.0;
    def.material.damping = 10.0;
    def.material.friction = 0.3;
    def.pose.translation = Vec3(x - box.min.x(), 0.0, 0.002 - box.min.z());
    x += box.max.x() - box.min.x() + 0.02;
    Result<PreparedBody> body = prepareBody(std::move(def));
    if (!body || !world.addSceneBody(std::make_shared<const PreparedBody>(std::move(*body))).ok()) return -1.0;
  }
  const int second = static_cast<int>(settings.step_rate);
  (void)secondsOf(world, second);
  if (!cut) return secondsOf(world, second);
  for (const BodySnapshot& body : world.snapshot({false, false, true}).bodies) {
    CutCommand command;
    command.bodies = {body.name};
    command.blades.x_axis = Vec3(0.3, 1.0, 0.2).normalized();
    command.blades.y_axis = command.blades.x_axis.cross(Vec3(1.0, 0.2, 0.1)).normalized();
    command.blades.origin = body.measures.centre_of_mass - 0.5 * command.blades.x_axis;
    if (!world.apply(command).ok()) return -1.0;
  }
  return secondsOf(world, second);
}

}  // namespace meshless::bench
