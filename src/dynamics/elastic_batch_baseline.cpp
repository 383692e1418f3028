// Elastic cells in whatever the compiler may use everywhere.
#include "elastic_batch_sets.h"

#if MESHLESS_ROTATION_X86
#include <immintrin.h>
#endif

#define MESHLESS_SET baseline
#define MESHLESS_SET_ENUM kBaseline
#define MESHLESS_BYTES 16
#include "elastic_batch_kernel.h"
