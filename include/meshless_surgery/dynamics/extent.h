// Passes over all points of a body that look at coordinates alone, at the speed of the memory.
#pragma once

#include "meshless_surgery/base/types.h"
#include "meshless_surgery/dynamics/rotation_batch.h"

namespace meshless {

/// Bounds of the points; empty for none. A coordinate that is NaN is passed over.
Box boundsOf(const Points& points, InstructionSet set = widestInstructionSet());

/// True where every coordinate is at most `most` (finite, above 0) away from 0; false for NaN.
bool allWithin(const Points& points, double most, InstructionSet set = widestInstructionSet());

}  // namespace meshless
