// Faces of many corners as triangles.
#pragma once

#include <array>
#include <vector>

#include "meshless_surgery/base/types.h"

namespace meshless {

/// Triangles of a polygon, by the numbers of its corners, 0 to n - 1: n - 2 of them, all turned as it is. A fan where
/// one corner sees all others; else ears are cut off, one by one (Meisters 1975), so that a comb, a spiral or a face
/// with a hole that a bridge leads to keeps its area. A polygon that crosses itself, or whose corners are not all among
/// the points, becomes a fan. It is looked at along its mean normal (Newell).
/// `work` is what may still be done for ears, in looks at a corner: where it is used up, a polygon becomes a fan.
std::vector<std::array<std::size_t, 3>> trianglesOf(const std::vector<Index>& corners, const Points& points,
                                                    double& work);

}  // namespace meshless
