// Rigid parts of the instruments that are drawn (media/instruments is written by make_meshes). Each reaches along +x from
// its joint or its tip at the origin, and is closed, oriented outwards, embedded, in metres.
#pragma once

#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

TriangleMesh shaftMesh();          // of a 5 mm instrument, 0.3 m long; ends in the joint of its jaws
TriangleMesh graspingJawMesh();    // 18 mm from its joint, its teeth towards -y: half of a pair that turns about z
TriangleMesh scissorsBladeMesh();  // 60 mm from its joint, sharp towards -y: likewise
TriangleMesh scalpelMesh();        // its tip at the origin, its edge towards -y, its handle along -x

}  // namespace meshless
