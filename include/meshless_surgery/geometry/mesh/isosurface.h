// Triangles of an implicit surface. Private to this room: organs are made with it.
#pragma once

#include <functional>

#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// Negative inside, positive outside; about a distance [m] near the surface.
using ScalarField = std::function<double(const Vec3&)>;

/// The surface field = 0 within the box: one vertex for each cell of the lattice that it crosses (surface nets, Gibson
/// 1998), then evened out by edge flips and by moves along the surface. Closed where the field is positive on the box's
/// faces; manifold where the solid and the air are everywhere some cells thick. `cell` [m] along x, y, z.
TriangleMesh isosurface(const ScalarField& field, const Box& box, const Vec3& cell, int relaxations = 40);

}  // namespace meshless
