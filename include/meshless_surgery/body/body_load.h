// What a body of elastic material bears as it is now: energy, stress, and the forces of what holds it.
#pragma once

#include <vector>

#include "meshless_surgery/body/body.h"

namespace meshless {

/// A force and its torque about the origin of the world, both on the tissue.
struct Wrench {
  Vec3 force = Vec3::Zero();   // [N]
  Vec3 torque = Vec3::Zero();  // [N m]
};

struct CellLoad {
  Vec3 place = Vec3::Zero();     // [m] the centroid of its tissue, world frame
  Mat3 gradient = Mat3::Zero();  // of positions by those where the rest shape was put
  Mat3 stress = Mat3::Zero();    // [Pa] Cauchy's, tension is positive; not a number where a cell is inside out
};

struct BodyLoad {
  double elastic_energy = 0.0;  // [J] with that of bending
  std::vector<Wrench> clamps;   // by the numbers of the regions that hold it, up to the last that holds some of it
  std::vector<CellLoad> cells;
};

/// Of a body of an elastic material that has cells. Nothing of what moves is in it: no viscosity, no damping, and no
/// weight of tissue that is held itself.
BodyLoad loadOf(const BodyModel& model, const Material& material, const BodyState& state);

}  // namespace meshless
