// A surface that was flat does not fold over.
#pragma once

#include "meshless_surgery/drive/finding.h"
#include "meshless_surgery/drive/seen.h"

namespace meshless {

/// Two triangles that share an edge, turned against each other by less than 60 degrees at rest, are not turned by more
/// than 135 now. Slivers (at rest or now flatter than a fiftieth of the mean edge of the body at rest) have no normal
/// to speak of, and are not looked at.
Finding foldLaw(const Seen& seen);

}  // namespace meshless
