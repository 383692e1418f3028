// Nearest rotations, 8 doubles at a time. No Eigen and no shared inline functions here: the linker could take an
// AVX-512 copy of one for the whole program.
#include "rotation_sets.h"

#if MESHLESS_ROTATION_X86
#pragma GCC target("avx512f,avx512dq,avx512vl,avx512bw,fma,prefer-vector-width=512")
#include <immintrin.h>

#define MESHLESS_SET avx512
#define MESHLESS_BYTES 64
#include "rotation_kernel.h"
#endif
