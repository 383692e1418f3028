// Contact of embedded vertices: they have no mass, so their carriers are moved.
#pragma once

#include <functional>

#include "meshless_surgery/body/body.h"

namespace meshless {

/// Where a point has to go: zero where it may stay [m].
using Obstacle = std::function<Vec3(const Vec3& position)>;

/// Moves every embedded vertex out of the obstacle, by Gauss-Seidel sweeps over its carriers with their inverse masses.
/// Fixed particles stay. moved(particle, shift [m]) is called for each particle that moves. What is left after the
/// sweeps goes to the offsets of the vertices, so that none stays in the obstacle. Returns how many were pushed.
/// `among`: the embedded vertices to check; all without it.
std::size_t pushEmbedded(const BodyModel& model, const Obstacle& obstacle, BodyState& state,
                         const std::function<void(Index particle, const Vec3& shift)>& moved,
                         const std::vector<Index>* among = nullptr);

}  // namespace meshless
