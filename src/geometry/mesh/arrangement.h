// Triangles cut along each other, and the cells that they divide space into. Private to this room.
#pragma once

#include <array>
#include <vector>

#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// Exact but for `vertices`, which are rounded at the end. Cells are found by sorting facets around each edge, as by
/// Zhou et al. 2016 (Mesh arrangements for solid geometry).
struct Arrangement {
  /// A triangle of the input that lies on a facet, turned as it is or against it.
  struct Use {
    Index triangle;
    bool forward;
  };
  /// What lies around an edge, against the clock as seen from its higher vertex: facets, and the cells between each and
  /// the next one.
  struct Spoke {
    Index facet;
    Index cell_after;
  };
  struct Edge {
    Index low, high;  // vertices
    std::vector<Spoke> spokes;
  };

  static constexpr Index kOutside = 0;  // the cell around all

  Points vertices;               // of the input, then those of crossings
  std::vector<Triangle> facets;  // no two have the same corners, none crosses another; where nothing meets, the input's
  std::vector<std::vector<Use>> uses;           // of each facet
  std::vector<std::array<Index, 2>> cells;      // of each facet: the one that its normal points to, the one behind
  std::vector<double> volumes;                  // of each cell [m^3]; 0 of kOutside
  std::vector<Edge> edges;                      // ordered by their vertices
  std::vector<std::array<Index, 2>> crossings;  // triangles of the input that meet elsewhere than in what they share
};

/// Of triangles with an area, however little, whose corners are the same vertex where they are the same place. Open
/// triangles have one cell on both sides. May throw what CGAL throws.
Arrangement arrange(const Points& vertices, const std::vector<Triangle>& triangles);

}  // namespace meshless
