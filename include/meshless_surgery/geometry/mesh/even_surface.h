// A surface of even triangles for what needs no detail: contact.
#pragma once

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

struct EvenSurface {
  TriangleMesh mesh;      // [m] no patches
  double distance = 0.0;  // [m] between it and the given surface, both ways, at vertices and centres of faces
};

/// The surface, closed or open, of any number of shells, in triangles whose edges are about `edge` long [m], or half of
/// that where it bends too much for it. Isotropic remeshing (Botsch and Kobbelt 2004) by CGAL, which keeps sharp edges;
/// then vertices move out to where no volume is lost. The same bits for the same input.
/// Refuses (kInvalidArgument) an edge that is not positive and finite, or that makes more than most_triangles;
/// (kUnsuitableShape) where the result has other parts, is open, crosses itself, has another volume (by 5 %), or is
/// farther than a fifth of the edge from the given surface.
Result<EvenSurface> evenSurface(const TriangleMesh& surface, double edge, std::size_t most_triangles);

}  // namespace meshless
