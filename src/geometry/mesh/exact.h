// CGAL's exact predicates, in a file of their own: its kernel alone takes as long to compile as three other files.
// Private to this room.
#pragma once

#include <array>

#include "meshless_surgery/base/types.h"

namespace meshless {
namespace exact {

/// 1 where a, b and c turn left, -1 where right, 0 on a line.
int turn(const Vec2& a, const Vec2& b, const Vec2& c);

using Corners = std::array<Vec3, 3>;

bool onALine(const Corners& triangle);

/// Whether two triangles, neither of them on a line, have more in common than their first `shared` (0 to 2) corners,
/// which are the same in both. Those that share an edge overlap only where they are folded flat onto each other.
bool meet(const Corners& a, const Corners& b, int shared);

}  // namespace exact
}  // namespace meshless
