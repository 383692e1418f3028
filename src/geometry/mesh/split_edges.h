// Vertices put into edges: what cuts and incisions share. Private to geometry.
#pragma once

#include <algorithm>
#include <cstdint>
#include <unordered_map>

#include "meshless_surgery/geometry/mesh/vertex_origins.h"

namespace meshless {

/// The same for both directions of an edge.
inline std::uint64_t edgeKey(Index a, Index b) {
  return (static_cast<std::uint64_t>(std::min(a, b)) << 32) | std::max(a, b);
}

/// Vertices inside edges (by edgeKey), from the lower-numbered end to the other.
using InnerVertices = std::unordered_map<std::uint64_t, std::vector<Index>>;

/// Splits triangles at such edges; one that is split keeps its place with its first part, the others follow at the end
/// with its patch. What is made inside of a triangle is never an edge to be split.
void splitAtEdges(std::vector<Triangle>& triangles, std::vector<std::uint32_t>& patches, const InnerVertices& inner);

/// (1 - s) a + s b. False where that has more than four parents.
bool mixOrigins(const VertexOrigin& a, const VertexOrigin& b, double s, VertexOrigin& mixed);

}  // namespace meshless
