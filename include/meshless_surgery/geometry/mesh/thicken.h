// A surface becomes a layer: membranes, skin, walls of hollow organs.
#pragma once

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless {

/// The closed surface of a layer as thick as `thickness` [m].
/// An open surface lies in the middle of its layer. Its vertices are moved along their normals, in creases so far that
/// the faces on both sides keep their distance; vertices of `mesh` come first, and patches are kept.
/// A closed surface is kept and becomes the outside of a wall: hollow organs of a segmentation's outer surface. The
/// inside is where the distance from it is the thickness, its edges rounded by about the thickness or an edge of the
/// triangles, whichever is less.
/// Refuses: kInvalidArgument a thickness that is not above 0; kUnsuitableShape edges with more than two triangles or
/// that two triangles see the same way, an open surface that is curved more tightly than the layer allows, with the
/// place, and a wall that leaves no cavity, with the depth that there is.
Result<TriangleMesh> thickened(const TriangleMesh& mesh, double thickness);

}  // namespace meshless
