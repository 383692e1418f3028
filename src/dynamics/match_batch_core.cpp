// The steps of a body of overlapping clusters.
#include "match_batch_core.h"

#include <cassert>

namespace meshless::match_sets {
namespace {

// How far the body may leave its frame before the frame follows: float then keeps most of its digits.
constexpr double kFarTurn = 0.05;   // half of the angle [rad]
constexpr double kFarShift = 0.05;  // of the size

}  // namespace

void OverlapCore::setState(const Points& positions, const Points& velocities, const std::vector<Quat>& rotations) {
  OverlapCore& b = *this;
  b.frame = Quat::Identity();  // what was before leaves no trace
  b.place(positions);
  const Mat3 back = b.frame.toRotationMatrix().transpose();
  for (std::size_t i = 0; i < b.particles; ++i) {
    const Vec3 turned = back * velocities[i];
    for (int k = 0; k < 3; ++k) b.v[k * b.particle_stride + i] = static_cast<float>(turned[k]);
  }
  for (std::size_t c = 0; c < b.clusters; ++c) b.setRotation(c, rotations[c]);
}

void OverlapCore::getState(Points& positions, Points& velocities, std::vector<Quat>& rotations) const {
  const OverlapCore& b = *this;
  const Mat3 forth = b.frame.toRotationMatrix();
  const std::size_t n = b.particle_stride;
  positions.resize(b.particles);
  velocities.resize(b.particles);
  rotations.resize(b.clusters);
  for (std::size_t i = 0; i < b.particles; ++i) {
    positions[i] = b.origin + forth * (b.rest_exact[i] + Vec3(b.u[i], b.u[n + i], b.u[2 * n + i]));
    velocities[i] = forth * Vec3(b.v[i], b.v[n + i], b.v[2 * n + i]);
  }
  for (std::size_t c = 0; c < b.clusters; ++c) rotations[c] = b.rotation(c);
}

void OverlapCore::step(const BatchStep& step, MatchCounters& counters, const ForEach& for_each) {
  OverlapCore& b = *this;
  if (b.particles == 0) return;
  assert(step.ahead >= 0.0);
  const Entries& entries = entriesOf(step.set);
  const OverlapView w = b.view();
  StepNumbers numbers = numbersOf(step);
  const Mat3 back = b.frame.toRotationMatrix().transpose();
  const Vec3 gravity = back * step.gravity;
  for (int k = 0; k < 3; ++k) numbers.gravity[k] = static_cast<float>(gravity[k]);
  const std::size_t chunks = (b.particle_stride + kChunk - 1) / kChunk;

  b.forChunks(for_each, b.particle_stride,
              [&](std::size_t first, std::size_t count, double* sum) { entries.sumParticles(w, first, count, sum); });
  const auto sums = b.addUp(chunks, kOverlapSums);
  const Vec3 centre(sums[kSumX], sums[kSumX + 1], sums[kSumX + 2]);
  const Vec3 velocity(sums[kSumV], sums[kSumV + 1], sums[kSumV + 2]);
  OverlapMotion motion = {};
  for (int k = 0; k < 3; ++k) {
    motion.centre[k] = static_cast<float>(centre[k]);
    motion.velocity[k] = static_cast<float>(velocity[k]);
    motion.normal[k] = static_cast<float>(back(k, 2));
  }
  if (step.ground) motion.height = static_cast<float>(*step.ground - b.origin.z());
  const double* const m = sums.data() + kSumMoment;
  Mat3 moment;
  moment << m[0], m[3], m[5], m[3], m[1], m[4], m[5], m[4], m[2];
  moment -= centre * centre.transpose();
  const double trace = 2.0 * moment.trace();
  Mat3 inverse = Mat3::Zero();
  if (trace > 0.0) inverse = inverseWithoutNull(Mat3::Identity() * 0.5 - moment / trace) / trace;
  const Vec3 spin = inverse * (Vec3(sums[kSumSpin], sums[kSumSpin + 1], sums[kSumSpin + 2]) - centre.cross(velocity));
  for (int k = 0; k < 3; ++k) motion.spin[k] = static_cast<float>(spin[k]);

  if (numbers.pull > 0.0f || numbers.lost > 0.0f)
    b.forChunks(for_each, b.particle_stride, [&](std::size_t first, std::size_t count, double*) {
      entries.spreadParticles(w, numbers, motion, first, count);
    });
  Quat turn = Quat::Identity();
  if (numbers.pull > 0.0f) {
    turn = b.fit(w, numbers, step.set, for_each, counters, [](std::size_t, std::size_t, const ClusterScratch&) {});
    b.forChunks(for_each, b.particle_stride, [&](std::size_t first, std::size_t count, double* sum) {
      entries.pullParticles(w, numbers, motion, first, count, nullptr, sum);
    });
    const auto leaked = b.addUp(chunks, 3);
    const Vec3 restore = inverse * Vec3(leaked[0], leaked[1], leaked[2]);
    for (int k = 0; k < 3; ++k) motion.restore[k] = static_cast<float>(restore[k]);
  }
  b.forChunks(for_each, b.particle_stride, [&](std::size_t first, std::size_t count, double*) {
    entries.moveParticles(w, numbers, motion, first, count);
  });

  const double length = turn.norm();
  if (!(length > 0.1 * static_cast<double>(b.clusters)) || numbers.pull <= 0.0f) turn = Quat::Identity();
  turn.normalize();
  if (turn.vec().norm() > kFarTurn || centre.norm() > kFarShift * b.size) b.follow(turn, centre, for_each);
}

void OverlapCore::match(const Points& y, MatchMode mode, double beta, std::vector<ClusterPose>& poses, Points& goals,
                        MatchCounters& counters, const ForEach& for_each) {
  OverlapCore& b = *this;
  BatchStep settings;
  settings.mode = mode;
  settings.beta = beta;
  StepNumbers numbers = numbersOf(settings);
  if (mode != MatchMode::kRigid) numbers.beta = static_cast<float>(beta);
  numbers.h = numbers.ahead = 0.0f;
  b.place(y);
  std::fill(b.v.begin(), b.v.end(), 0.0f);
  for (std::size_t c = 0; c < b.clusters; ++c) b.setRotation(c, poses[c].rotation);
  const Entries& entries = entriesOf(settings.set);
  const OverlapView w = b.view();
  const OverlapMotion still = {};
  b.forChunks(for_each, b.particle_stride, [&](std::size_t first, std::size_t count, double*) {
    entries.spreadParticles(w, numbers, still, first, count);
  });
  const Mat3 forth = b.frame.toRotationMatrix();
  const std::size_t n = b.cluster_stride;
  b.fit(w, numbers, settings.set, for_each, counters,
        [&](std::size_t first, std::size_t count, const ClusterScratch& s) {
          for (std::size_t i = 0; i < count && first + i < b.clusters; ++i) {
            const std::size_t c = first + i;
            ClusterPose& pose = poses[c];
            pose.rotation = b.rotation(c);
            const float* const f = b.constants.data() + c;
            pose.centre = b.origin + forth * Vec3(double(f[kCentre * n]) + s.mean[0][i],
                                                  double(f[(kCentre + 1) * n]) + s.mean[1][i],
                                                  double(f[(kCentre + 2) * n]) + s.mean[2][i]);
            pose.deformation = pose.rotation.toRotationMatrix();
            const float* const g = f + kInverseMoment * n;
            if (numbers.beta > 0.0f && g[0] > 0.0f) {
              Mat3 a, inverse;
              for (int k = 0; k < 9; ++k) a(k / 3, k % 3) = s.moment[k][i];
              inverse << g[0], g[3 * n], g[5 * n], g[3 * n], g[n], g[4 * n], g[5 * n], g[4 * n], g[2 * n];
              pose.deformation = forth * a * inverse;
            }
          }
        });
  b.forChunks(for_each, b.particle_stride, [&](std::size_t first, std::size_t count, double* sum) {
    entries.pullParticles(w, numbers, still, first, count, b.goals.data(), sum);
  });
  goals.resize(b.particles);
  const std::size_t p = b.particle_stride;
  for (std::size_t i = 0; i < b.particles; ++i)
    goals[i] = b.origin + forth * (b.rest_exact[i] + Vec3(b.goals[i], b.goals[p + i], b.goals[2 * p + i]));
}

}  // namespace meshless::match_sets
