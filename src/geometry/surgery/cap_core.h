// Points inside a section, off its rim. Private to this folder.
#pragma once

#include <utility>

#include "meshless_surgery/base/types.h"

namespace meshless {
namespace surgery {

/// A piece of outline between two nodes: the winding number on its left is `weight` higher than on its right.
struct OutlineSegment {
  Index from, to;
  int weight;
};

/// Points of a hexagonal lattice where the winding number is 1, and its triangles between them.
struct CapCore {
  double spacing = 0.0;                         // [m] of the lattice
  std::vector<Vec2> places;                     // each at least kRimDistance spacings from every segment
  std::vector<Triangle> triangles;              // counter-clockwise
  std::vector<bool> inside;                     // one a point: triangles all around it
  std::vector<std::pair<Index, Index>> border;  // edges of one triangle, which is on their left
  std::vector<Index> part_of_point;             // points joined by triangles are one part
  Index parts = 0;
};

/// More than the radius of a lattice triangle's circle: no segment can pass between three points.
constexpr double kRimDistance = 0.6;

/// At most `most` points, `spacing` [m] apart where that suffices, else farther.
CapCore coreOf(const std::vector<Vec2>& nodes, const std::vector<OutlineSegment>& segments, double spacing,
               std::size_t most);

}  // namespace surgery
}  // namespace meshless
