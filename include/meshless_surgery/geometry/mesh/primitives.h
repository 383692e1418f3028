// Closed surfaces of boxes, spheres, cylinders and tori, centred at the origin; triangles about `edge` [m] long, and no
// finer than 1,000 edges along a size. Empty where a size or the edge is not positive and finite.
#pragma once

#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// size [m] along x, y, z.
TriangleMesh boxMesh(const Vec3& size, double edge);
/// A box of nx x ny x nz quads (each at least 1), each two triangles.
TriangleMesh boxMesh(const Vec3& size, int nx, int ny, int nz);
/// A subdivided icosahedron.
TriangleMesh sphereMesh(double radius, double edge);
/// Along z; the discs are rings of 6, 12, 18 ... vertices, so that their triangles are nearly equilateral.
TriangleMesh cylinderMesh(double height, double radius, double edge);
/// Around z; empty also where the tube is not thinner than the ring.
TriangleMesh torusMesh(double ring_radius, double tube_radius, double edge);

}  // namespace meshless
