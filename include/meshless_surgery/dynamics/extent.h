// Passes over all points of a body that look at coordinates alone, at the speed of the memory.
#pragma once

#include "meshless_surgery/base/types.h"
#include "meshless_surgery/dynamics/rotation_batch.h"

namespace meshless {

/// Bounds of the points [m]; empty for none. As boundsOf(), but a coordinate that is NaN is passed over.
Box extentOf(const Points& points, InstructionSet set = widestInstructionSet());

/// True where every coordinate is at most `most` (finite, above 0) [m] away from 0; false for NaN.
bool allWithin(const Points& points, double most, InstructionSet set = widestInstructionSet());

}  // namespace meshless
