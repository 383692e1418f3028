// The kernels of extent.h for each set of instructions.
#pragma once

#include <cstddef>

#include "rotation_sets.h"

namespace meshless::extent_sets {

#define MESHLESS_EXTENT_SET(set)                                                           \
  namespace set {                                                                          \
  /* low and high: what is known so far. `count` coordinates, a whole number of points. */ \
  void bounds(const double* x, std::size_t count, double* low, double* high);              \
  bool within(const double* x, std::size_t count, double most);                            \
  }
MESHLESS_EXTENT_SET(baseline)
#if MESHLESS_ROTATION_X86
MESHLESS_EXTENT_SET(avx2)
#endif
#undef MESHLESS_EXTENT_SET

}  // namespace meshless::extent_sets
