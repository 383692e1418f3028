// What a display that draws by itself needs: surfaces as vertices and triangles, about a sixth of the markers' bytes.
#pragma once

#include <meshless_surgery/Surfaces.h>

#include "meshless_surgery/world/world.h"

namespace meshless {

/// Needs a snapshot with surfaces; with `strain` each vertex's, which costs another pass over the edges.
meshless_surgery::Surfaces toSurfaces(const WorldSnapshot& snapshot, const std_msgs::Header& header, bool strain);

/// The same without header and bodies, and without the parts of instruments.
meshless_surgery::Surfaces toolsIn(const WorldSnapshot& snapshot);

/// One a vertex: root of the mean, over the triangle edges there, of (length over rest length - 1)^2.
std::vector<float> surfaceStrain(const Points& rest, const Points& present, const std::vector<Triangle>& triangles);

}  // namespace meshless
