// One entry point for each instruction set; each is compiled in a file of its own.
#pragma once

#include "meshless_surgery/dynamics/rotation_batch.h"

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)  // clang knows no `#pragma GCC target`
#define MESHLESS_ROTATION_X86 1
#else
#define MESHLESS_ROTATION_X86 0
#endif

namespace meshless::rotation_sets {

namespace baseline {
void solve(const RotationBatch<float>& batch, bool warm);
void solve(const RotationBatch<double>& batch, bool warm);
}  // namespace baseline

#if MESHLESS_ROTATION_X86
namespace avx2 {
void solve(const RotationBatch<float>& batch, bool warm);
void solve(const RotationBatch<double>& batch, bool warm);
}  // namespace avx2

namespace avx512 {
void solve(const RotationBatch<float>& batch, bool warm);
void solve(const RotationBatch<double>& batch, bool warm);
}  // namespace avx512
#endif

}  // namespace meshless::rotation_sets
