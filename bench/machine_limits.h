// What one thread of this machine can do at best: bytes a second between memory or a cache and its registers, and
// floating-point operations a second.
#pragma once

#include <cstddef>

namespace meshless::bench {

/// [bytes] three arrays together: far more than the caches hold, as far as a quarter of the memory allows.
std::size_t beyondCaches();

/// [bytes/s] of a[i] = b[i] + s c[i] (STREAM's triad: McCalpin 1995) over three arrays that take so many bytes
/// together, the best of several passes. Counted as there: two values read and one written. What a cache reads before
/// it writes is not counted.
double triadBandwidth(std::size_t bytes);

/// [1/s] of multiplications and additions in double that wait for nothing, with the widest instructions that the
/// package uses too.
double peakOperations();

}  // namespace meshless::bench
