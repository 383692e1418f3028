// The rim of a cut as nodes in the plane, and its repair where it crosses itself. Private to geometry's cut_*.cpp.
#pragma once

#include "cut_cap.h"
#include "cut_parts.h"

namespace meshless {
namespace cutting {

/// Rim vertices by their place in the plane. Vertices at the same place share a node. Vertices are counted from the
/// first on the plane.
struct Nodes {
  Index first_vertex = 0;
  std::vector<Vec2> places;
  std::vector<Index> of_vertex;  // kNoIndex for vertices that are not on the rim

  Index at(Index vertex) const { return of_vertex[vertex - first_vertex]; }

  /// For each node its lowest vertex.
  std::vector<Index> lowestVertices() const;
  /// For each vertex on the plane the one that stands for its node.
  std::vector<Index> mergedVertices() const;
};

Nodes nodesOf(const Workpiece& work, const std::vector<RimEdge>& rim);
std::vector<OutlineSegment> outlineOf(const Nodes& nodes, const std::vector<RimEdge>& rim);

/// Splits the rim's edges where they meet each other, in the triangles of both sides, so that the outline of the new
/// rim has common points at nodes alone. False where rounding does not let it.
bool splitRim(Workpiece& work, const std::vector<RimEdge>& rim, Nodes& nodes);

}  // namespace cutting
}  // namespace meshless
