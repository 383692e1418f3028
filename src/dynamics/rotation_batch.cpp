#include "meshless_surgery/dynamics/rotation_batch.h"

#include "rotation_sets.h"

namespace meshless {
namespace {

template <class Scalar>
void dispatch(const RotationBatch<Scalar>& batch, bool warm, InstructionSet set) {
#if MESHLESS_ROTATION_X86
  if (set == InstructionSet::kAvx512 && instructionSetAvailable(set)) return rotation_sets::avx512::solve(batch, warm);
  if (set == InstructionSet::kAvx2 && instructionSetAvailable(set)) return rotation_sets::avx2::solve(batch, warm);
#endif
  rotation_sets::baseline::solve(batch, warm);
}

}  // namespace

bool instructionSetAvailable(InstructionSet set) {
  switch (set) {
    case InstructionSet::kBaseline:
      return true;
#if MESHLESS_ROTATION_X86
    case InstructionSet::kAvx2:
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
    case InstructionSet::kAvx512:
      return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
             __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("fma");
#endif
    default:
      return false;
  }
}

InstructionSet widestInstructionSet() {
  static const InstructionSet set = instructionSetAvailable(InstructionSet::kAvx512) ? InstructionSet::kAvx512
                                    : instructionSetAvailable(InstructionSet::kAvx2) ? InstructionSet::kAvx2
                                                                                     : InstructionSet::kBaseline;
  return set;
}

void nearestRotationsWarm(const RotationBatch<float>& batch, InstructionSet set) { dispatch(batch, true, set); }
void nearestRotationsWarm(const RotationBatch<double>& batch, InstructionSet set) { dispatch(batch, true, set); }
void nearestRotationsCold(const RotationBatch<float>& batch, InstructionSet set) { dispatch(batch, false, set); }
void nearestRotationsCold(const RotationBatch<double>& batch, InstructionSet set) { dispatch(batch, false, set); }

void nearestRotationsWarm(const RotationBatch<float>& batch) { dispatch(batch, true, widestInstructionSet()); }
void nearestRotationsWarm(const RotationBatch<double>& batch) { dispatch(batch, true, widestInstructionSet()); }
void nearestRotationsCold(const RotationBatch<float>& batch) { dispatch(batch, false, widestInstructionSet()); }
void nearestRotationsCold(const RotationBatch<double>& batch) { dispatch(batch, false, widestInstructionSet()); }

}  // namespace meshless
