// Contact of a sphere with the faces of a surface: where the sphere is smaller than the triangles or pushes hard,
// vertices alone slide around it and let it through.
#pragma once

#include <functional>

#include "meshless_surgery/body/body.h"

namespace meshless {

/// Moves every triangle that reaches into the sphere (centre and radius in [m]) out of it, by one Gauss-Seidel sweep
/// over its corners with their inverse masses. Corners that are fixed or embedded stay (see embedded_contact.h).
/// moved(particle, shift [m]) is told of each. Returns how many triangles were pushed.
std::size_t pushFaces(const BodyModel& model, const Vec3& centre, double radius, BodyState& state,
                      const std::function<void(Index particle, const Vec3& shift)>& moved);

}  // namespace meshless
