// Which triangles of a surface cross each other. Private to this room.
#pragma once

#include <functional>
#include <vector>

#include "meshless_surgery/base/types.h"

namespace meshless {

/// Calls found(a, b) for each pair of triangles that meet in more than the corners and the edge that they share:
/// exactly. Triangles whose corners lie on a line meet nothing.
void forEachCrossing(const Points& points, const std::vector<Triangle>& triangles,
                     const std::function<void(Index, Index)>& found);

}  // namespace meshless
