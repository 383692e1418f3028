// Contact of surface vertices that ride: they have no mass, so the clusters that carry them are moved.
#pragma once

#include <functional>

#include "meshless_surgery/body/body.h"

namespace meshless {

/// Where a point has to go: zero where it may stay [m].
using Obstacle = std::function<Vec3(const Vec3& position)>;

/// Moves every rider out of the obstacle: by Gauss-Seidel over centre and affine map of the clusters, then the
/// clusters' change is shared out to their particles with the weights that share their mass, so that what the particles
/// get is what was pushed. Fixed particles stay. Returns how many riders were pushed; impulse [kg m] is the sum of mass
/// times displacement. What is left after the sweeps is taken up by the riders' offsets: none stays in the obstacle.
/// poses must fit positions and do so again afterwards.
std::size_t pushRiders(const BodyModel& model, const Obstacle& obstacle, BodyState& state, std::vector<bool>* touched,
                       Vec3* impulse);

}  // namespace meshless
