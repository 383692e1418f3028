// No surface goes through another.
#pragma once

#include "meshless_surgery/drive/finding.h"
#include "meshless_surgery/drive/seen.h"

namespace meshless {

/// Of the surfaces that contact takes: no edge of a body goes through a face of another one or of an obstacle, and none
/// of an obstacle through a body's. An edge counts where both ends are farther from the face's plane than a tenth of
/// the depth that a vertex may have (depth_law.h): the faces of a fresh cut lie on each other, and rounding crosses
/// them. Each edge counts once for each body that it goes through.
Finding crossingLaw(const Seen& seen);

}  // namespace meshless
