// Elastic cells, 4 at a time. No Eigen and no shared inline functions here: the linker could take an AVX2 copy of one
// for the whole program.
#include "elastic_batch_sets.h"

#if MESHLESS_ROTATION_X86
#pragma GCC target("avx2,fma")
#include <immintrin.h>

#define MESHLESS_SET avx2
#define MESHLESS_SET_ENUM kAvx2
#define MESHLESS_BYTES 32
#include "elastic_batch_kernel.h"
#endif
