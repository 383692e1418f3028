// What was let go comes to rest, and sleeps.
#pragma once

#include "drive/finding.h"
#include "drive/seen.h"

namespace meshless {

/// No piece is faster than 1 % of its diagonal a second, root mean square.
Finding restLaw(const Seen& seen);

/// Each body sleeps.
Finding asleepLaw(const Seen& seen);

}  // namespace meshless
