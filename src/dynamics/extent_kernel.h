// Included once for each set of instructions, with MESHLESS_SET and MESHLESS_BYTES.
// No Eigen and no shared inline functions here: the linker could take a copy of one for the whole program.

namespace meshless::extent_sets::MESHLESS_SET {
namespace {

typedef double Pack __attribute__((vector_size(MESHLESS_BYTES)));
typedef unsigned long long Bits __attribute__((vector_size(MESHLESS_BYTES)));

constexpr std::size_t kLanes = MESHLESS_BYTES / sizeof(double);
constexpr std::size_t kTogether = 12;  // coordinates: four points, whole packs of any width
constexpr std::size_t kPacks = kTogether / kLanes;

}  // namespace

void bounds(const double* x, std::size_t count, double* low, double* high) {
  const std::size_t whole = count - count % kTogether;
  if (whole > 0) {
    Pack least[kPacks], most[kPacks];
    for (std::size_t k = 0; k < kTogether; ++k) {
      least[k / kLanes][k % kLanes] = low[k % 3];
      most[k / kLanes][k % kLanes] = high[k % 3];
    }
    for (std::size_t i = 0; i < whole; i += kTogether)
      for (std::size_t k = 0; k < kPacks; ++k) {
        Pack p;
        __builtin_memcpy(&p, x + i + k * kLanes, sizeof p);
        least[k] = p < least[k] ? p : least[k];
        most[k] = p > most[k] ? p : most[k];
      }
    for (std::size_t k = 0; k < kTogether; ++k) {
      const double l = least[k / kLanes][k % kLanes], h = most[k / kLanes][k % kLanes];
      low[k % 3] = l < low[k % 3] ? l : low[k % 3];
      high[k % 3] = h > high[k % 3] ? h : high[k % 3];
    }
  }
  for (std::size_t i = whole; i < count; ++i) {
    low[i % 3] = x[i] < low[i % 3] ? x[i] : low[i % 3];
    high[i % 3] = x[i] > high[i % 3] ? x[i] : high[i % 3];
  }
}

// Without their sign, doubles are ordered as their bits are, and NaN is the largest: a difference below 0 tells.
bool within(const double* x, std::size_t count, double most) {
  constexpr unsigned long long kUnsigned = ~0ull >> 1;
  unsigned long long limit = 0;
  __builtin_memcpy(&limit, &most, sizeof limit);
  const std::size_t whole = count - count % kTogether;
  Bits differences[kPacks] = {};
  for (std::size_t i = 0; i < whole; i += kTogether)
    for (std::size_t k = 0; k < kPacks; ++k) {
      Bits bits;
      __builtin_memcpy(&bits, x + i + k * kLanes, sizeof bits);
      differences[k] |= limit - (bits & kUnsigned);
    }
  unsigned long long all = 0;
  for (std::size_t k = 0; k < kTogether; ++k) all |= differences[k / kLanes][k % kLanes];
  for (std::size_t i = whole; i < count; ++i) {
    unsigned long long bits = 0;
    __builtin_memcpy(&bits, x + i, sizeof bits);
    all |= limit - (bits & kUnsigned);
  }
  return all >> 63 == 0;
}

}  // namespace meshless::extent_sets::MESHLESS_SET
