// Generators of organs that are walls around a hollow, or sheets: what surrounds the liver in the scene abdomen.
#pragma once

#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

// In metres, centred near the origin, embedded. The first two are the outside of what `thickness` makes a wall of,
// closed and oriented outwards.
TriangleMesh gallbladderMesh();  // 0.07 m long along x, its neck at +x
TriangleMesh stomachMesh();      // 0.14 m long along x, wide at -x, bent towards +y
TriangleMesh
vesselMesh();  // a tube 0.05 m long along x, 6 mm wide, its lumen 3.6 mm, open at both ends; closed, oriented outwards
TriangleMesh omentumMesh();  // an open sheet of 0.11 x 0.09 m, in shallow waves about z = 0

}  // namespace meshless
