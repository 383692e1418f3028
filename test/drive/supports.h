// Closed surfaces to put organs on. Private to this room.
#pragma once

#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// A round bowl on z = 0 about the z axis: `radius` of its inner sphere, `depth` of its hollow up to the rim, and the
/// thickness of its wall [m].
TriangleMesh bowlMesh(double radius, double depth, double wall);

/// A square tray on z = 0: inner half width, height of the rim above the floor, thickness of floor and rim [m].
TriangleMesh trayMesh(double half_width, double rim, double wall);

}  // namespace meshless
