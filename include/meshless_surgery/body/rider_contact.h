// Contact of surface vertices that ride: they have no mass, so the particles that carry them are moved.
#pragma once

#include <functional>

#include "meshless_surgery/body/body.h"

namespace meshless {

/// Where a point has to go: zero where it may stay [m].
using Obstacle = std::function<Vec3(const Vec3& position)>;

/// Moves every rider out of the obstacle by Gauss-Seidel sweeps over its carriers, with their inverse masses: what the
/// particles get is what was pushed. Fixed particles stay. moved(particle, shift [m]) is told of each. Returns how many
/// riders were pushed. What is left after the sweeps is taken up by the riders' offsets: none stays in the obstacle.
/// `among`: the riders to look at; all without it.
std::size_t pushRiders(const BodyModel& model, const Obstacle& obstacle, BodyState& state,
                       const std::function<void(Index particle, const Vec3& shift)>& moved,
                       const std::vector<Index>* among = nullptr);

}  // namespace meshless
