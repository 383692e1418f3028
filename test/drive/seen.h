// What a law looks at: the bodies of a world at one time, as values.
#pragma once

#include "meshless_surgery/world/world.h"

namespace meshless {

struct SeenBody {
  std::string name;
  TriangleMesh surface;                   // [m] present, world frame; empty where it was not wanted
  Points rest;                            // [m] of the same vertices
  std::optional<TriangleMesh> collision;  // [m] likewise: what contact takes for it, where that is another
  BodyModelPtr model;                     // with surfaces
  Points particles;                       // [m] likewise
  bool particles_finite = true;
  bool elastic = false;          // an elastic material
  double compressibility = 0.0;  // [1/Pa] of an elastic material: 3 (1 - 2 nu) / E
  bool handled = false;          // a pick, a lock or the push sphere is on it
  bool fixed = false;            // some of it is held in place
  bool asleep = false;
  double mass = 0.0;                     // [kg]
  double rest_volume = 0.0;              // [m^3]
  double kinetic_energy = 0.0;           // [J]
  Vec3 centre = Vec3::Zero();            // [m] of mass
  Vec3 linear_momentum = Vec3::Zero();   // [kg m/s]
  Vec3 angular_momentum = Vec3::Zero();  // [kg m^2/s] about the centre of mass
  double diagonal = 0.0;                 // [m] of the bounds at rest

  const TriangleMesh& met() const { return collision ? *collision : surface; }
  double speed() const { return mass > 0.0 ? std::sqrt(2.0 * kinetic_energy / mass) : 0.0; }  // [m/s] root mean square
};

struct Seen {
  double time = 0.0;  // [s] simulated
  std::vector<SeenBody> bodies;
  std::vector<std::shared_ptr<const ObstacleDef>> obstacles;
  std::optional<double> ground;  // [m]
  Vec3 gravity = Vec3::Zero();   // [m/s^2]
  std::size_t mended = 0;        // bodies that had to start anew from rest in the last step
};

/// Without surfaces it is fast, and does for masses, momenta and energies.
Seen see(World& world, bool surfaces);

/// The name of the body of the scene that a piece was once part of: the world names pieces PARENT.1, PARENT.2 ...
std::string rootOf(const std::string& name);

}  // namespace meshless
