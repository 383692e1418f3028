#include "meshless_surgery/dynamics/extent.h"

#include "extent_sets.h"

namespace meshless {

Box extentOf(const Points& points, [[maybe_unused]] InstructionSet set) {
  Box box;
  if (points.empty()) return box;
#if MESHLESS_ROTATION_X86
  if (set != InstructionSet::kBaseline && instructionSetAvailable(InstructionSet::kAvx2)) {
    extent_sets::avx2::bounds(points[0].data(), 3 * points.size(), box.min.data(), box.max.data());
    return box;
  }
#endif
  extent_sets::baseline::bounds(points[0].data(), 3 * points.size(), box.min.data(), box.max.data());
  return box;
}

bool allWithin(const Points& points, double most, [[maybe_unused]] InstructionSet set) {
  if (points.empty()) return true;
#if MESHLESS_ROTATION_X86
  if (set != InstructionSet::kBaseline && instructionSetAvailable(InstructionSet::kAvx2))
    return extent_sets::avx2::within(points[0].data(), 3 * points.size(), most);
#endif
  return extent_sets::baseline::within(points[0].data(), 3 * points.size(), most);
}

}  // namespace meshless
