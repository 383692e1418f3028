// A cap that is not flat. Private to this folder.
#pragma once

#include "cap_core.h"
#include "surgery_parts.h"

namespace meshless {
namespace surgery {

/// Moves the points of the core along the normal by up to `amplitude` [m], by fractal noise, rising from 0 at the
/// outline over two spacings. They are the wound's nodes from `first_node` on, in its triangles from `first_triangle`
/// on. Where one of these would meet the surface, its points move less, or not at all: the wound faces stay within the
/// solid. `places`: of the outline's nodes.
void roughen(const SplitSurface& surface, const std::vector<Vec2>& places, const std::vector<OutlineSegment>& outline,
             const CapCore& core, Index first_node, std::size_t first_triangle, double amplitude, std::uint32_t seed,
             Wound& wound);

}  // namespace surgery
}  // namespace meshless
