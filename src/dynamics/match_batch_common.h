// What both batches need and no kernel sees.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <new>
#include <vector>

#include "match_batch_sets.h"
#include "meshless_surgery/dynamics/match_batch.h"

#if MESHLESS_ROTATION_X86
#include <xmmintrin.h>
#endif

namespace meshless::match_sets {

/// Numbers at the start of a cache line.
template <class T>
struct AlignedAllocator {
  using value_type = T;
  AlignedAllocator() = default;
  template <class U>
  AlignedAllocator(const AlignedAllocator<U>&) {}
  T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), std::align_val_t(64))); }
  void deallocate(T* p, std::size_t) { ::operator delete(p, std::align_val_t(64)); }
  bool operator==(const AlignedAllocator&) const { return true; }
  bool operator!=(const AlignedAllocator&) const { return false; }
};
using Floats = std::vector<float, AlignedAllocator<float>>;

/// Denormal numbers, which motion that dies out ends in, cost a hundred times the others: they count as 0 meanwhile.
class FlushDenormals {
 public:
#if MESHLESS_ROTATION_X86
  FlushDenormals() : before_(_mm_getcsr()) { _mm_setcsr(before_ | 0x8040); }
  ~FlushDenormals() { _mm_setcsr(before_); }

 private:
  unsigned before_;
#else
  FlushDenormals() {}
#endif
};

StepNumbers numbersOf(const BatchStep& step);
/// True where nothing has flowed: the batches know no other rest shape.
inline bool isUnplastic(const MatchInput& body) { return !body.plastic || body.plastic->empty(); }
/// (sum of squared eigenvalues aside) inverse of a symmetric matrix of trace 1 but for directions without extent.
Mat3 inverseWithoutNull(const Mat3& matrix);
/// Flags of the rotations into counters.
void count(const std::uint8_t* flags, std::size_t size, MatchCounters& counters);

}  // namespace meshless::match_sets
