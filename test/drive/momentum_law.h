// Momentum where it can be said: a blade gives none, and a fall only what gravity does.
#pragma once

#include "drive/finding.h"
#include "drive/seen.h"

namespace meshless {

/// Linear and angular momentum of all bodies together, before and after a cut between two steps: equal to 1e-6 of what
/// the bodies' parts carry.
Finding cutMomentumLaw(const Seen& before, const Seen& after);

/// True where nothing outside can have touched a body since it was seen, for `seconds` to come: nothing is held, and
/// ground and obstacles are farther below and beside than it can get.
bool fallsFreely(const Seen& seen, double seconds);

/// Between two looks of a free fall: the momentum of all together grew by weight times time, the angular momentum about
/// their common centre of mass did not change; both to 1e-3.
Finding freeFallLaw(const Seen& before, const Seen& after);

}  // namespace meshless
