// Vertices moved onto a plane that is to cut close to them. Private to geometry.
#pragma once

#include "meshless_surgery/geometry/query/plane.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"
#include "meshless_surgery/geometry/mesh/vertex_origins.h"

namespace meshless {
namespace cutting {

struct SnappedVertex {
  Index vertex;
  VertexOrigin origin;  // where it lies now, on one of its edges
};

/// Moves vertices that the plane meets within so many metres along one of their edges to where it does, nearest first,
/// so that the cut makes no shorter edges. A vertex stays where it would leave the plane of one of its triangles by
/// more than a twentieth of `within`: moves go along faces and their edges, and corners are kept. It stays too where a
/// triangle would turn over or lose nine tenths of its area. The moved vertices, ascending.
std::vector<SnappedVertex> snapToPlane(TriangleMesh& mesh, const Plane& plane, double within);

}  // namespace cutting
}  // namespace meshless
