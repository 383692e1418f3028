// A cap that is not flat. Private to geometry's cut_*.cpp and cap_*.cpp.
#pragma once

#include "cap_core.h"
#include "cut_parts.h"

namespace meshless {
namespace cutting {

/// Moves the vertices inside the cap along the normal by up to `amplitude` [m], by fractal noise, rising from 0 at the
/// rim over two spacings. `cap`: all triangles of the cap that have such a vertex. Where one of them would meet the
/// surface, its vertices move less, or not at all: the cap stays within the solid.
void roughen(Workpiece& work, const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& outline,
             const CapCore& core, const std::vector<Triangle>& cap, double amplitude, std::uint32_t seed);

}  // namespace cutting
}  // namespace meshless
