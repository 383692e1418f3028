// Sizes of a triangle surface. All are sums relative to a vertex of the mesh, so that they keep their digits far from
// the origin. An open surface has an area; its volume and centroid are those of the cone over it and mean nothing.
#pragma once

#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// [m^2]
double surfaceArea(const Points& vertices, const std::vector<Triangle>& triangles);
/// [m^3]; negative for an inside-out surface.
double signedVolume(const Points& vertices, const std::vector<Triangle>& triangles);
/// [m^2] how the volume of a closed surface grows as each vertex moves.
Points volumeGradient(const Points& vertices, const std::vector<Triangle>& triangles);
/// [m] of the enclosed solid; the mean of the vertices where the volume is zero.
Vec3 solidCentroid(const Points& vertices, const std::vector<Triangle>& triangles);
Box boundsOf(const Points& points);
/// Mean edge length [m]; 0 without triangles.
double meanEdgeLength(const TriangleMesh& mesh);

inline double surfaceArea(const TriangleMesh& mesh) { return surfaceArea(mesh.vertices, mesh.triangles); }
inline double signedVolume(const TriangleMesh& mesh) { return signedVolume(mesh.vertices, mesh.triangles); }
inline Vec3 solidCentroid(const TriangleMesh& mesh) { return solidCentroid(mesh.vertices, mesh.triangles); }

/// Outward unit normals of vertices, by the angles of the faces there (Baerentzen and Aanaes 2005); zero where they
/// cancel.
Points vertexNormals(const TriangleMesh& mesh);

}  // namespace meshless
