// How far tissue is from the edge of a cut.
#pragma once

#include <cstdint>
#include <vector>

namespace meshless {

/// [m] of each vertex from where faces of cuts (`cut`, one a triangle: not 0) meet the outer surface; up to `most`,
/// which is also that of all others. `vertices`: three numbers each; `triangles`: three of them each. Found along the
/// surface, each as far as it is straight from the nearest piece of the edge.
std::vector<float> rimDistances(const std::vector<float>& vertices, const std::vector<std::uint32_t>& triangles,
                                const std::vector<std::uint8_t>& cut, float most);

}  // namespace meshless
