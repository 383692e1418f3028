// Steps of many bodies, in whatever the compiler may use everywhere.
#include "match_batch_sets.h"

#define MESHLESS_SET baseline
#define MESHLESS_BYTES 16
#include "match_batch_kernel.h"
