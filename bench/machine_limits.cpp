#include "machine_limits.h"

#include <unistd.h>

#include <algorithm>
#include <vector>

#include "meshless_surgery/dynamics/rotation_batch.h"

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)  // clang knows no `#pragma GCC target`
#define LIMITS_X86 1
#else
#define LIMITS_X86 0
#endif

namespace meshless::bench {
namespace {

namespace baseline {
#define LIMITS_BYTES 16
#include "clock.h"
#include "machine_kernels.h"
#undef LIMITS_BYTES
}  // namespace baseline

#if LIMITS_X86
#pragma GCC push_options
#pragma GCC target("avx2,fma")
namespace avx2 {
#define LIMITS_BYTES 32
#include "clock.h"
#include "machine_kernels.h"
#undef LIMITS_BYTES
}  // namespace avx2
#pragma GCC pop_options

#pragma GCC push_options
#pragma GCC target("avx512f,avx512dq,avx512vl,avx512bw,fma,prefer-vector-width=512")
namespace avx512 {
#define LIMITS_BYTES 64
#include "clock.h"
#include "machine_kernels.h"
#undef LIMITS_BYTES
}  // namespace avx512
#pragma GCC pop_options
#endif

constexpr int kPasses = 7;             // the best counts
constexpr double kShortest = 0.02;     // [s] of a pass, so that the clock is exact
constexpr std::size_t kTogether = 10;  // as multiplyAndAdd() has

struct Kernels {
  decltype(&baseline::triad) triad = baseline::triad;
  decltype(&baseline::multiplyAndAdd) multiply_and_add = baseline::multiplyAndAdd;
  std::size_t lanes = 2;
};

Kernels widestKernels() {
#if LIMITS_X86
  if (widestInstructionSet() == InstructionSet::kAvx512) return {avx512::triad, avx512::multiplyAndAdd, 8};
  if (widestInstructionSet() == InstructionSet::kAvx2) return {avx2::triad, avx2::multiplyAndAdd, 4};
#endif
  return {};
}

volatile double result = 0.0;  // so that no loop is left out

}  // namespace

std::size_t beyondCaches() {
  std::size_t bytes = 192u << 20;
#ifdef _SC_LEVEL3_CACHE_SIZE
  if (const long cache = sysconf(_SC_LEVEL3_CACHE_SIZE); cache > 0)
    bytes = std::max(bytes, 4 * static_cast<std::size_t>(cache));
#endif
  const long pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGESIZE);
  if (pages > 0 && page > 0)
    bytes = std::min(bytes, static_cast<std::size_t>(pages) * static_cast<std::size_t>(page) / 4);
  return bytes;
}

double triadBandwidth(std::size_t bytes) {
  const Kernels kernels = widestKernels();
  const std::size_t count = bytes / (3 * sizeof(double));
  std::vector<double> a(count, 0.0), b(count, 1.0), c(count, 2.0);
  std::size_t rounds = 1;
  double best = 0.0;
  for (int pass = 0; pass < kPasses;) {
    const double start = now();
    for (std::size_t n = 0; n < rounds; ++n) kernels.triad(a.data(), b.data(), c.data(), 3.0, count);
    const double seconds = now() - start;
    result = a[count / 2];
    if (seconds < kShortest) {
      rounds *= 2;
      continue;
    }
    best = std::max(best, static_cast<double>(rounds * count * 3 * sizeof(double)) / seconds);
    ++pass;
  }
  return best;
}

double peakOperations() {
  const Kernels kernels = widestKernels();
  constexpr std::size_t kRounds = 5000000;
  double best = 0.0;
  for (int pass = 0; pass < kPasses; ++pass) {
    const double start = now();
    result = kernels.multiply_and_add(kRounds, 0.999, 1e-3);
    best = std::max(best, static_cast<double>(2 * kRounds * kTogether * kernels.lanes) / (now() - start));
  }
  return best;
}

}  // namespace meshless::bench
