// Steps of many bodies, 16 lanes at a time.
// No Eigen and no shared inline functions here: the linker could take a copy of one for the whole program.
#include "match_batch_sets.h"

#if MESHLESS_ROTATION_X86
#pragma GCC target("avx512f,avx512dq,avx512vl,avx512bw,fma,prefer-vector-width=512")

#define MESHLESS_SET avx512
#define MESHLESS_BYTES 64
#include "match_batch_kernel.h"
#endif
