// Doubles, MESHLESS_BYTES of them at a time, for kernels that are compiled once for each set of instructions.
#pragma once

#ifndef MESHLESS_BYTES
#error "set the target and MESHLESS_BYTES before including double_pack.h"
#endif

#define MESHLESS_INLINE inline __attribute__((always_inline))

namespace meshless {
namespace {

typedef double Pack __attribute__((vector_size(MESHLESS_BYTES)));
typedef long long Mask __attribute__((vector_size(MESHLESS_BYTES)));
constexpr int kLanes = MESHLESS_BYTES / sizeof(double);

MESHLESS_INLINE Pack get(const double* from) {
  Pack x;
  __builtin_memcpy(&x, from, sizeof(x));
  return x;
}
MESHLESS_INLINE void put(Pack x, double* to) { __builtin_memcpy(to, &x, sizeof(x)); }
MESHLESS_INLINE Pack all(double x) { return Pack{} + x; }
MESHLESS_INLINE Pack choose(Mask m, Pack yes, Pack no) { return m ? yes : no; }
MESHLESS_INLINE Pack absolute(Pack x) { return (Pack)((Mask)x & 0x7fffffffffffffffLL); }
MESHLESS_INLINE Pack larger(Pack x, Pack y) { return x > y ? x : y; }
MESHLESS_INLINE bool any(Mask m) {
#if MESHLESS_BYTES == 64
  return _mm512_movepi64_mask((__m512i)m) != 0;
#elif MESHLESS_BYTES == 32
  return _mm256_movemask_pd((__m256d)m) != 0;
#else
  return (m[0] | m[1]) != 0;
#endif
}
MESHLESS_INLINE Pack squareRoot(Pack x) {
#if MESHLESS_BYTES == 64
  return _mm512_maskz_sqrt_pd(0xff, x);  // the unmasked one warns of an uninitialised value with GCC 12
#elif MESHLESS_BYTES == 32
  return _mm256_sqrt_pd(x);
#elif MESHLESS_ROTATION_X86
  return _mm_sqrt_pd(x);
#else
  for (int l = 0; l < kLanes; ++l) x[l] = __builtin_sqrt(x[l]);
  return x;
#endif
}

}  // namespace
}  // namespace meshless
