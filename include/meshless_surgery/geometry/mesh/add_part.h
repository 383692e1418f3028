// One mesh as a part of another.
#pragma once

#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// Both have patches, or neither.
inline void addPart(const TriangleMesh& part, TriangleMesh& mesh) {
  const Index first = static_cast<Index>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), part.vertices.begin(), part.vertices.end());
  for (const Triangle& t : part.triangles) mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  mesh.patches.insert(mesh.patches.end(), part.patches.begin(), part.patches.end());
}

}  // namespace meshless
