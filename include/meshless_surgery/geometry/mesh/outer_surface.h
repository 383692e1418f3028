// The surface of a volume mesh.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

enum class CellShape : std::uint8_t { kTetrahedron, kHexahedron, kWedge, kPyramid };
constexpr std::size_t kCellShapes = 4;

/// 4, 8, 6 or 5.
std::size_t cornersOf(CellShape shape);

/// Corners are in the order that VTK and Gmsh share: of a hexahedron one quad, then the one over it; of a wedge one
/// triangle, then the one over it; of a pyramid its base, then its apex.
struct VolumeCells {
  std::vector<CellShape> shapes;
  std::vector<Index> corners;  // of one cell after the other

  std::size_t size() const { return shapes.size(); }
  bool empty() const { return shapes.empty(); }
};

/// Volumes of the cells [m^3], negative where a cell is written inside out. Quads are split as outerSurface splits
/// them, so that the volumes add up to the one that it encloses. Corners are there.
std::vector<double> cellVolumes(const Points& points, const VolumeCells& cells);

/// The faces that only one cell has, counter-clockwise seen from outside of it; points that none of them has are left
/// out, the others keep their order. A quad is split along the diagonal whose triangles are faces of other cells, or
/// else at its lowest corner, so that the cells on both sides agree. A cell is turned by the sign of its own volume, a
/// flat one as most cells of its shape. Corners that are equal, as in hexahedra that stand for wedges, become one.
/// Refuses kUnsuitableShape: a corner that is not there or not finite, a face of more than two cells, no outer face.
Result<TriangleMesh> outerSurface(const Points& points, const VolumeCells& cells);

}  // namespace meshless
