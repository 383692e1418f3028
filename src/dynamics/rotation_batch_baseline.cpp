// Nearest rotations in whatever the compiler may use everywhere.
#include "rotation_sets.h"

#if MESHLESS_ROTATION_X86
#include <immintrin.h>
#endif

#define MESHLESS_SET baseline
#define MESHLESS_BYTES 16
#include "rotation_kernel.h"
