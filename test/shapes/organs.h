// Seeded generators of the organ-like meshes that the package ships (config/meshes is written by make_meshes).
#pragma once

#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

// Each is closed, oriented outwards, embedded, centred near the origin, in metres and of a real organ's size. The same
// seed gives the same mesh.
TriangleMesh liverMesh(unsigned seed = 1);   // about 0.22 m wide, two lobes, at least 4,000 triangles
TriangleMesh kidneyMesh(unsigned seed = 1);  // about 0.11 m long, with its hilum
TriangleMesh fishMesh(unsigned seed = 1);    // about 0.3 m long, head at +x, fins
TriangleMesh bladderMesh();                  // 0.06 m long, hollow, its wall 3 mm thick
TriangleMesh skinSlabMesh();                 // 0.2 x 0.2 x 0.01 m
TriangleMesh block32Mesh();                  // 0.1 x 0.1 x 0.05 m; 32 triangles, and 32 tetrahedra about its centre
/// What is put on pegs: a ring of three straight walls about z, 9 mm high and 2.5 mm thick, with round corners.
TriangleMesh pegTriangleMesh();
/// What hides a target but from those that look into it: along z, open at +z, 20 mm wide and 46 mm high, the floor at
/// 0, the wall 2 mm thick.
TriangleMesh cupMesh();

}  // namespace meshless
