#include "drive/seen.h"

#include <algorithm>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace {

bool isHandled(const WorldSnapshot& shot, const BodySnapshot& body) {
  for (const auto& [pick, name] : shot.pick_bodies)
    if (name == body.name) return true;
  if (!shot.push.enabled || !shot.push.touching) return false;
  Box sphere;
  sphere.extend(shot.push.position.array() - 1.1 * shot.push.radius);
  sphere.extend(shot.push.position.array() + 1.1 * shot.push.radius);
  return boundsOf(body.surface).overlaps(sphere);
}

}  // namespace

Seen see(World& world, bool surfaces) {
  WorldSnapshot shot = world.snapshot({surfaces, surfaces, true, false});
  Seen seen;
  seen.time = shot.sim_time;
  seen.obstacles = shot.obstacles;
  seen.ground = world.settings().ground;
  seen.gravity = world.settings().gravity;
  seen.mended = shot.report.mended;
  for (BodySnapshot& from : shot.bodies) {
    SeenBody body;
    body.name = from.name;
    body.elastic = from.material.elastic();
    if (body.elastic)
      body.compressibility = 3.0 * (1.0 - 2.0 * from.material.poissons_ratio) / from.material.youngs_modulus;
    body.handled = isHandled(shot, from);
    body.fixed = from.model->any_fixed;
    body.asleep = from.asleep;
    body.mass = from.model->mass;
    body.rest_volume = from.model->rest_volume;
    body.kinetic_energy = from.measures.kinetic_energy;
    body.centre = from.measures.centre_of_mass;
    body.linear_momentum = from.measures.linear_momentum;
    body.angular_momentum = from.measures.angular_momentum;
    body.diagonal = boundsOf(from.model->surface.vertices).diagonal();
    body.particles_finite =
        std::all_of(from.particles.begin(), from.particles.end(), [](const Vec3& p) { return p.allFinite(); });
    if (surfaces) {
      body.surface.vertices = std::move(from.surface);
      body.surface.triangles = from.model->surface.triangles;
      if (from.model->collision)
        body.collision = {collisionPlaces(*from.model, from.particles), from.model->collision->mesh.triangles, {}};
      body.rest = from.model->surface.vertices;
      body.model = from.model;
      body.particles = std::move(from.particles);
    }
    seen.bodies.push_back(std::move(body));
  }
  return seen;
}

std::string rootOf(const std::string& name) { return name.substr(0, name.find('.')); }

}  // namespace meshless
