// The solid that triangles bound together: of parts that overlap, of regions that share walls, of hollow organs.
// Private to this room.
#pragma once

#include <string>
#include <vector>

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

struct UnitedParts {
  TriangleMesh mesh;          // closed, manifold, turned outwards
  bool changed = false;       // false: the triangles are those of the input, or turned
  bool shared_walls = false;  // some triangles had tissue on both sides, so that signs of volumes say nothing
  double open_share = 0.0;    // of the area: of triangles that bound nothing
  std::size_t doubled = 0;    // vertices where it touches itself
  std::vector<std::string> notes, warnings;
};

/// All places that the parts wind around more often outwards than inwards. A part is what hangs together by edges: of
/// the file, and where these have one triangle, of places. It counts as it is turned where most of it lies in a larger
/// part; what lies mostly in none is tissue however it is turned, and what it holds turns with it. Triangles of a part
/// that are turned against each other are turned as most of their neighbours are. Where a part has edges whose
/// triangles cannot agree, as labels have that share walls, its cells are tissue, but for those that all triangles
/// around them face. What is turned inwards stays a hole where it touches or crosses what is around it.
///
/// Exact up to the rounding of the result: triangles are cut along each other, and cells counted (arrange()). Triangles
/// that cross nothing stay as they are. Where the solid touches itself in an edge or a vertex, each side has its own.
/// Vertices are finite, and those that triangles name are there. Refuses with kUnsuitableShape where nothing is
/// enclosed.
Result<UnitedParts> uniteParts(const TriangleMesh& mesh);

}  // namespace meshless
