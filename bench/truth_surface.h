// The surface of a body of the truth.
#pragma once

#include <string>

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/geometry/mesh/triangle_mesh.h"

namespace meshless::bench {

/// Vertices and triangles of an OBJ file; refuses (kUnreadable) a file that is missing.
Result<TriangleMesh> readSurface(const std::string& file);

}  // namespace meshless::bench
