// Four coordinates at a time.
#include "extent_sets.h"

#if MESHLESS_ROTATION_X86
#pragma GCC target("avx2,fma")

#define MESHLESS_SET avx2
#define MESHLESS_BYTES 32
#include "extent_kernel.h"
#endif
