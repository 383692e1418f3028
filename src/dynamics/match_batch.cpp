#include "meshless_surgery/dynamics/match_batch.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <new>
#include <vector>

#include <Eigen/Eigenvalues>

#include "match_batch_sets.h"
#include "meshless_surgery/base/bytes.h"

#if MESHLESS_ROTATION_X86
#include <xmmintrin.h>
#endif

namespace meshless {

namespace match_sets {

constexpr double kNoExtent = 1e-6;  // of the inertia's trace: float moments are not known better

const Entries& entriesOf(InstructionSet set) {
  static const Entries baseline_entries = {baseline::measureBodies, baseline::gatherBodies, baseline::moveBodies};
#if MESHLESS_ROTATION_X86
  static const Entries avx2_entries = {avx2::measureBodies, avx2::gatherBodies, avx2::moveBodies};
  static const Entries avx512_entries = {avx512::measureBodies, avx512::gatherBodies, avx512::moveBodies};
  if (set == InstructionSet::kAvx512 && instructionSetAvailable(set)) return avx512_entries;
  if (set == InstructionSet::kAvx2 && instructionSetAvailable(set)) return avx2_entries;
#endif
  (void)set;
  return baseline_entries;
}

namespace {

// Numbers at the start of a cache line.
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

// Denormal numbers, which motion that dies out ends in, cost a hundred times the others: they count as 0 meanwhile.
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

// True where nothing has flowed: the batch knows no other rest shape.
bool isUnplastic(const MatchInput& body) { return !body.plastic || body.plastic->empty(); }

StepNumbers numbersOf(const BatchStep& step) {
  StepNumbers n;
  n.h = static_cast<float>(step.h);
  n.ahead = static_cast<float>(step.ahead);
  n.pull = static_cast<float>(step.gain / step.h);
  n.beta = step.mode == MatchMode::kRigid ? 0.0f : static_cast<float>(actingBeta(step.beta, step.h));
  n.lost = step.damping > 0.0 ? static_cast<float>(1.0 - std::exp(-step.damping * step.h)) : 0.0f;
  for (int k = 0; k < 3; ++k) n.gravity[k] = static_cast<float>(step.gravity[k]);
  n.quadratic = step.mode == MatchMode::kQuadratic && n.beta > 0.0f;
  return n;
}

// Inverse of a symmetric matrix of trace 1 but for directions without extent.
Mat3 inverseWithoutNull(const Mat3& matrix) {
  if (!matrix.allFinite()) return Mat3::Zero();
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(matrix);
  Mat3 inverse = Mat3::Zero();
  for (int k = 0; k < 3; ++k)
    if (solver.eigenvalues()[k] > kNoExtent)
      inverse += solver.eigenvectors().col(k) * solver.eigenvectors().col(k).transpose() / solver.eigenvalues()[k];
  return inverse;
}

// Flags of the rotations into counters.
void count(const std::uint8_t* flags, std::size_t size, MatchCounters& counters) {
  counters.clusters += size;
  counters.rotations += size;
  for (std::size_t i = 0; i < size; ++i) {
    if (!(flags[i] & kRotationWarm)) ++counters.cold_rotations;
    if (!(flags[i] & kRotationUnique)) ++counters.rank_fallbacks;
  }
}

void pseudoInverse(const float m[6], float inverse[6]) {
  Mat3 matrix;
  matrix << m[0], m[3], m[5], m[3], m[1], m[4], m[5], m[4], m[2];
  const Mat3 i = inverseWithoutNull(matrix);
  const double entries[6] = {i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(1, 2), i(2, 0)};
  for (int k = 0; k < 6; ++k) inverse[k] = static_cast<float>(entries[k]);
}

}  // namespace
}  // namespace match_sets

using namespace match_sets;

BatchStep batchStep(const Material& material, double h) {
  BatchStep step;
  step.h = h;
  step.mode = material.mode;
  const GoalPull goal = goalPull(material.alpha, h);
  step.ahead = h + goal.lead;
  step.gain = goal.gain;
  step.beta = material.beta;
  step.damping = material.damping;
  return step;
}

struct BodyBatch::Impl {
  std::size_t size = 0, particles = 0, padded = 0;
  bool has_quadratic = false;
  Floats fields, constants, motion, quadratic, quaternions;
  std::vector<std::uint8_t> flags;
  Points origins;

  float& field(std::size_t body, std::size_t particle, int f) {
    return fields[((body / kBlock * particles + particle) * kParticleFields + f) * kBlock + body % kBlock];
  }
  float& constant(std::size_t body, int f) {
    return constants[(body / kBlock * kBodyFields + f) * kBlock + body % kBlock];
  }

  void prepare(std::size_t body, const MatchInput& in) {
    const ClusterRest& rest = in.shape.clusters[0];
    const double inverse_size = rest.radius > 0.0 ? 1.0 / rest.radius : 0.0;
    constant(body, kSize) = static_cast<float>(rest.radius);
    const Mat3 m = rest.moment_inverse * (rest.mass * rest.radius);
    const double entries[6] = {m(0, 0), m(1, 1), m(2, 2), m(0, 1), m(1, 2), m(2, 0)};
    for (int k = 0; k < 6; ++k) constant(body, kMoment + k) = static_cast<float>(entries[k]);
    for (std::size_t i = 0; i < particles; ++i) {
      const Vec3 q = (in.rest[i] - rest.centre) * inverse_size;
      for (int k = 0; k < 3; ++k) field(body, i, kQx + k) = static_cast<float>(q[k]);
      field(body, i, kMass) = static_cast<float>(in.masses[i] / rest.mass);
    }
    constant(body, kHasQuadratic) = 0.0f;
    if (has_quadratic && rest.quadratic_rank) {
      const QuadraticRest& from = in.shape.quadratic[0];
      constant(body, kHasQuadratic) = 1.0f;
      float* to = &quadratic[body / kBlock * kQuadraticFields * kBlock + body % kBlock];
      for (int k = 0; k < 6; ++k, to += kBlock) *to = static_cast<float>(from.mean[3 + k]);
      for (int a = 0; a < 9; ++a)
        for (int b = a; b < 9; ++b, to += kBlock) *to = static_cast<float>(from.moment_inverse(a, b) * rest.mass);
    }
  }

  // The first particle is origin enough: the body is around it.
  void load(std::size_t body, const BatchBody& from) {
    const Vec3 origin = from.positions[0];
    origins[body] = origin;
    float* to = &field(body, 0, kX);
    for (std::size_t i = 0; i < particles; ++i, to += kParticleFields * kBlock)
      for (int k = 0; k < 3; ++k) {
        to[(kX + k) * kBlock] = static_cast<float>(from.positions[i][k] - origin[k]);
        to[(kVx + k) * kBlock] = static_cast<float>(from.velocities[i][k]);
      }
    for (int k = 0; k < 4; ++k) quaternions[k * padded + body] = static_cast<float>(from.rotation->coeffs()[k]);
  }

  void store(std::size_t body, const BatchBody& to) const {
    const Vec3 origin = origins[body];
    const float* from = &fields[(body / kBlock * particles * kParticleFields + kX) * kBlock + body % kBlock];
    for (std::size_t i = 0; i < particles; ++i, from += kParticleFields * kBlock)
      for (int k = 0; k < 3; ++k) {
        to.positions[i][k] = origin[k] + from[(kX + k) * kBlock];
        to.velocities[i][k] = from[(kVx + k) * kBlock];
      }
    Quat rotation;
    for (int k = 0; k < 4; ++k) rotation.coeffs()[k] = quaternions[k * padded + body];
    *to.rotation = rotation.normalized();
  }
};

bool BodyBatch::holds(const MatchInput& body) {
  if (!isUnplastic(body) || body.clusters.size() != 1 || body.clusters.members.size() != body.rest.size()) return false;
  for (Index i = 0; i < body.rest.size(); ++i)
    if (body.clusters.members[i] != i || body.clusters.weights[i] != 1.0) return false;
  return true;
}

BodyBatch::BodyBatch(const std::vector<MatchInput>& bodies, bool quadratic) : impl_(std::make_unique<Impl>()) {
  Impl& b = *impl_;
  b.size = bodies.size();
  b.has_quadratic = quadratic;
  if (bodies.empty()) return;
  b.particles = bodies[0].rest.size();
  b.padded = (b.size + kBlock - 1) / kBlock * kBlock;
  const std::size_t blocks = b.padded / kBlock;
  b.fields.assign(blocks * b.particles * kParticleFields * kBlock, 0.0f);
  b.constants.assign(blocks * kBodyFields * kBlock, 0.0f);
  b.motion.assign(blocks * kMotionFields * kBlock, 0.0f);
  if (quadratic) b.quadratic.assign(blocks * kQuadraticFields * kBlock, 0.0f);
  b.quaternions.assign(4 * b.padded, 0.0f);
  b.flags.assign(b.padded, 0);
  b.origins.assign(b.padded, Vec3::Zero());
  for (std::size_t i = 0; i < b.padded; ++i) {  // the first body stands in for those that are none
    const MatchInput& in = bodies[i < b.size ? i : 0];
    assert(holds(in) && in.rest.size() == b.particles);
    b.prepare(i, in);
  }
}

BodyBatch::~BodyBatch() = default;
BodyBatch::BodyBatch(BodyBatch&&) noexcept = default;
BodyBatch& BodyBatch::operator=(BodyBatch&&) noexcept = default;
std::size_t BodyBatch::bytes() const {
  const Impl& w = *impl_;
  return sizeof w + bytesOf(w.fields, w.constants, w.motion, w.quadratic, w.quaternions, w.flags, w.origins);
}

void BodyBatch::refit(std::size_t body, const MatchInput& in) {
  assert(holds(in) && in.rest.size() == impl_->particles);
  impl_->prepare(body, in);
}

void BodyBatch::step(const std::vector<BatchBody>& states, const BatchStep& step, MatchCounters& counters,
                     const ForEach& for_each) {
  Impl& b = *impl_;
  const std::size_t count = states.size();
  assert(count <= b.size);
  if (count == 0) return;
  const std::size_t padded = (count + kBlock - 1) / kBlock * kBlock;
  assert(step.mode != MatchMode::kQuadratic || b.has_quadratic);
  assert(step.ahead >= 0.0);
  const StepNumbers numbers = numbersOf(step);
  const Entries& entries = entriesOf(step.set);
  const BodiesView view = {static_cast<int>(b.particles),
                           b.fields.data(),
                           b.constants.data(),
                           b.motion.data(),
                           b.has_quadratic ? b.quadratic.data() : nullptr,
                           pseudoInverse};
  runEach(for_each, (padded + kChunk - 1) / kChunk, [&](std::size_t chunk) {
    const FlushDenormals flush;
    BodiesScratch scratch;
    const std::size_t first = chunk * kChunk, size = std::min<std::size_t>(kChunk, padded - first);
    const int first_block = static_cast<int>(first / kBlock), blocks = static_cast<int>(size / kBlock);
    for (std::size_t i = 0; i < size; ++i) b.load(first + i, states[std::min(first + i, count - 1)]);
    entries.measureBodies(view, first_block, blocks);
    entries.gatherBodies(view, numbers, first_block, blocks, scratch);
    RotationBatch<float> rotations;
    rotations.count = size;
    rotations.matrices = scratch.moment[0];
    rotations.matrix_stride = kChunk;
    rotations.quaternions = b.quaternions.data() + first;
    rotations.quaternion_stride = b.padded;
    rotations.rotations = scratch.rotation[0];
    rotations.rotation_stride = kChunk;
    rotations.flags = b.flags.data() + first;
    nearestRotationsWarm(rotations, step.set);
    entries.moveBodies(view, numbers, first_block, blocks, scratch);
    for (int k = 0; k < 3; ++k)
      for (std::size_t i = 0; i < size; ++i) b.origins[first + i][k] += scratch.shift[k][i];
    for (std::size_t i = first; i < std::min(first + size, count); ++i) b.store(i, states[i]);
  });
  match_sets::count(b.flags.data(), count, counters);
  if (numbers.beta > 0.0f) counters.linear_fits += count;
  if (numbers.quadratic) counters.quadratic_moments += count;
}

}  // namespace meshless
