// No surface goes through another.
#pragma once

#include "drive/finding.h"
#include "drive/seen.h"

namespace meshless {

/// Of the surfaces that contact takes: at most a thousandth of all edges of bodies go through the surface of another
/// one or of an obstacle and reach deeper between their ends than a vertex may (depth_law.h), those of obstacles into
/// bodies included. Each edge counts once for each body that it goes through.
Finding crossingLaw(const Seen& seen);

}  // namespace meshless
