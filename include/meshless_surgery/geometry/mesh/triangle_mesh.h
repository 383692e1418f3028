// An indexed triangle surface.
#pragma once

#include "meshless_surgery/base/types.h"

namespace meshless {

/// The patch of triangles that came with the mesh; every cut adds patches of its own.
constexpr std::uint32_t kOuterPatch = 0;
/// The first of those of a body's filled cavities, which came with the mesh too.
constexpr std::uint32_t kCavityPatch = std::uint32_t{1} << 31;
inline bool isCavityPatch(std::uint32_t patch) { return patch >= kCavityPatch; }
inline bool isCutPatch(std::uint32_t patch) { return patch != kOuterPatch && !isCavityPatch(patch); }

struct TriangleMesh {
  Points vertices;                     // [m]
  std::vector<Triangle> triangles;     // counter-clockwise seen from outside
  std::vector<std::uint32_t> patches;  // one a triangle, or empty: all are kOuterPatch

  bool empty() const { return triangles.empty(); }
  std::uint32_t patchOf(std::size_t triangle) const { return patches.empty() ? kOuterPatch : patches[triangle]; }
};

}  // namespace meshless
