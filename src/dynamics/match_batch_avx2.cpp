// Steps of many bodies, 8 lanes at a time.
// No Eigen and no shared inline functions here: the linker could take a copy of one for the whole program.
#include "match_batch_sets.h"

#if MESHLESS_ROTATION_X86
#pragma GCC target("avx2,fma")

#define MESHLESS_SET avx2
#define MESHLESS_BYTES 32
#include "match_batch_kernel.h"
#endif
