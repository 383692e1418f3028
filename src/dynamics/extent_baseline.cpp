// Two coordinates at a time, on any machine.
#include "extent_sets.h"

#define MESHLESS_SET baseline
#define MESHLESS_BYTES 16
#include "extent_kernel.h"
