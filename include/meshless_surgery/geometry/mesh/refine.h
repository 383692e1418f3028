// Triangles with more vertices on their edges: the same surface, finer.
#pragma once

#include <array>
#include <vector>

#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// Replaces a triangle with vertices inside of its edges (kNoIndex: none; k is on the edge from corner k) by smaller
/// ones.
void subdivide(const Triangle& t, const std::array<Index, 3>& middles, std::vector<Triangle>& parts);

/// Edges longer than `longest` [m] > 0 are halved until there are none. Vertices keep their numbers; new ones follow.
TriangleMesh withShortEdges(TriangleMesh mesh, double longest);

}  // namespace meshless
