// Tetrahedra between given points.
#pragma once

#include "meshless_surgery/base/types.h"

namespace meshless {

class SolidQuery;

/// Delaunay tetrahedra of the points (CGAL), those kept whose centroid lies inside the solid; positively oriented, none
/// flatter than 1e-9 of the cubed mean edge. Empty for fewer than four points or coplanar ones. Order is deterministic.
std::vector<Tetrahedron> tetrahedralize(const Points& points, const SolidQuery& solid);
/// All tetrahedra of the points' convex hull.
std::vector<Tetrahedron> tetrahedralizeHull(const Points& points);
/// Faces used by one tetrahedron only, counter-clockwise seen from outside.
std::vector<Triangle> boundaryFaces(const std::vector<Tetrahedron>& tetrahedra);
/// Unique edges, lower index first, sorted.
std::vector<std::array<Index, 2>> tetrahedronEdges(const std::vector<Tetrahedron>& tetrahedra);

}  // namespace meshless
