// The section of a solid by a plane, triangulated in the plane's own coordinates. Private to geometry's cut_*.cpp.
#pragma once

#include "cap_core.h"
#include "meshless_surgery/base/types.h"

namespace meshless {
namespace cutting {

struct CapTriangle {
  std::array<Index, 3> nodes;  // counter-clockwise
  int winding;                 // never 0
};

enum class CapState { kFilled, kCrossing, kUnbalanced };

/// Distance [m] within which nodes and segments are one for splitOutline. Far below a cut's band, far above rounding.
double snapDistance(const std::vector<Vec2>& nodes);

/// True where a cap triangle is no higher than the snapping distance: segments that lie on each other but for rounding.
bool hasSlivers(const std::vector<Vec2>& nodes, const CapCore& core, const std::vector<CapTriangle>& cap);

/// Fills the outline by its winding numbers with a constrained Delaunay triangulation of their nodes, which are
/// all distinct, and of the core's border; what the core fills is left out. Points of the core count as nodes after
/// those given. kCrossing: segments cross, overlap or pass through nodes. kUnbalanced: the segments are no closed
/// curves.
CapState triangulateCap(const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& segments,
                        const CapCore& core, std::vector<CapTriangle>& cap);

/// Splits the segments at each other: afterwards two of them have at most end nodes in common, or both ends.
struct SplitOutline {
  bool ok = false;                         // false: rounding made crossings faster than they were resolved
  std::vector<Vec2> nodes;                 // those given, then those made
  std::vector<Index> merged;               // one a node: the node that stands for it, itself where it stands alone
  std::vector<std::vector<Index>> chains;  // one a segment: its nodes from `from` to `to`, in merged nodes
};
SplitOutline splitOutline(const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& segments);

}  // namespace cutting
}  // namespace meshless
