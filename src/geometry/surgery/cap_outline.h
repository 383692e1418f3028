// Outlines that cross, touch or overlap themselves. Private to this folder.
#pragma once

#include "cap_core.h"
#include "meshless_surgery/base/types.h"

namespace meshless {
namespace surgery {

/// Distance [m] within which nodes and segments are one for splitOutline. Far below a blade's band, far above rounding.
double snapDistance(const std::vector<Vec2>& nodes);

/// Splits the segments at each other: afterwards two of them have at most end nodes in common, or both ends.
struct SplitOutline {
  bool ok = false;                         // false: rounding made crossings faster than they were resolved
  std::vector<Vec2> nodes;                 // those given, then those made
  std::vector<Index> merged;               // one a node: the node that stands for it, itself where it stands alone
  std::vector<std::vector<Index>> chains;  // one a segment: its nodes from `from` to `to`, in merged nodes
};
SplitOutline splitOutline(const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& segments);

}  // namespace surgery
}  // namespace meshless
