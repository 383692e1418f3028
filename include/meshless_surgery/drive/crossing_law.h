// No surface goes through another.
#pragma once

#include "meshless_surgery/drive/finding.h"
#include "meshless_surgery/drive/seen.h"

namespace meshless {

/// Of the surfaces that contact takes: no edge of a body goes through the surface of another one or of an obstacle and
/// reaches deeper between its ends than a vertex may (depth_law.h), and none of an obstacle into a body. Each edge
/// counts once for each body that it goes through.
Finding crossingLaw(const Seen& seen);

}  // namespace meshless
