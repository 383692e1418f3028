// Parts of a solid that overlap where it is cut, each with a cap of its own. Private to this folder.
#pragma once

#include "cap_core.h"

namespace meshless {
namespace surgery {

/// The outline's closed curves in groups that are filled alone: each curve that turns to the left, with those in it
/// that turn to the right. Curves that cross are in different groups: soft tissue lies in itself there, and what only
/// overlaps must not be joined. rest: [m] of the nodes. The group of each node. Empty where curves cross that are no
/// farther than `apart` [m] from each other at rest where they do, and where a group cannot be told.
std::vector<Index> curvesApart(const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& segments,
                               const Points& rest, double apart);

}  // namespace surgery
}  // namespace meshless
