// A body of overlapping clusters in a frame that moves and turns with it.
#include <Eigen/Eigenvalues>

#include "match_batch_common.h"
#include "meshless_surgery/dynamics/rotation.h"

namespace meshless {

using namespace match_sets;

namespace {

// How far the body may leave its frame before the frame follows: float then keeps most of its digits.
constexpr double kFarTurn = 0.05;   // half of the angle [rad]
constexpr double kFarShift = 0.05;  // of the size

std::size_t paddedTo(std::size_t n, std::size_t unit) { return (n + unit - 1) / unit * unit; }

}  // namespace

struct OverlapBatch::Impl {
  std::size_t particles = 0, clusters = 0, particle_stride = 0, cluster_stride = 0;
  double size = 0.0;  // [m] root of the mean square distance from the centre of mass at rest
  Points rest_exact;  // [m] from there
  Floats u, v, rest, mass, lever, share, moments, maps, constants, quaternions, goals;
  std::vector<std::uint32_t> member_offsets, membership_offsets, long_members, long_memberships;
  std::vector<std::uint16_t> short_members, short_memberships;
  Floats member_weights, membership_weights;
  std::vector<std::uint8_t> flags;
  std::vector<double> sums;  // of chunks
  Vec3 origin = Vec3::Zero();
  Quat frame = Quat::Identity();

  explicit Impl(const MatchInput& in) {
    particles = in.rest.size();
    clusters = in.clusters.size();
    particle_stride = paddedTo(particles, kBlock);
    cluster_stride = paddedTo(clusters, kBlock);
    makeParticles(in);
    makePairs(in);
    makeClusters(in);
    flags.assign(cluster_stride, 0);
    sums.assign((std::max(particle_stride, cluster_stride) / kChunk + 1) * kOverlapSums, 0.0);
  }

  void makeParticles(const MatchInput& in) {
    const std::size_t n = particle_stride;
    double total = 0.0;
    Vec3 sum = Vec3::Zero();
    for (std::size_t i = 0; i < particles; ++i) {
      total += in.masses[i];
      sum += in.masses[i] * (in.rest[i] - in.rest[0]);
    }
    const Vec3 centre = in.rest[0] + sum / total;
    u.assign(3 * n, 0.0f);
    v.assign(3 * n, 0.0f);
    goals.assign(3 * n, 0.0f);
    rest.assign(3 * n, 0.0f);
    mass.assign(n, 0.0f);
    share.assign(n, 1.0f);
    lever.assign(4 * n, 0.0f);
    moments.assign(16 * n, 0.0f);
    double spread = 0.0;
    for (std::size_t i = 0; i < particles; ++i) {
      rest_exact.push_back(in.rest[i] - centre);
      mass[i] = static_cast<float>(in.masses[i] / total);
      for (int k = 0; k < 3; ++k) rest[k * n + i] = static_cast<float>(rest_exact[i][k]);
      spread += in.masses[i] / total * rest_exact[i].squaredNorm();
    }
    size = std::sqrt(spread);
    origin = centre;
  }

  // Both directions of the pairs; where a particle gives each cluster the same, the pairs need no weights.
  void makePairs(const MatchInput& in) {
    const ClusterSet& set = in.clusters;
    std::vector<double> common(particles, -1.0);
    bool equal = true;
    membership_offsets.assign(particle_stride + 1, 0);
    for (std::size_t k = 0; k < set.members.size(); ++k) {
      const Index i = set.members[k];
      if (common[i] < 0.0) common[i] = set.weights[k];
      equal = equal && std::abs(common[i] - set.weights[k]) <= 1e-14 * common[i];
      ++membership_offsets[i + 1];
    }
    for (std::size_t i = 0; i < particle_stride; ++i) membership_offsets[i + 1] += membership_offsets[i];
    member_offsets.assign(set.offsets.begin(), set.offsets.end());
    member_offsets.resize(cluster_stride + 1, member_offsets.back());
    std::vector<std::uint32_t> next(membership_offsets.begin(), membership_offsets.end());
    long_members.assign(set.members.begin(), set.members.end());
    long_memberships.resize(set.members.size());
    if (!equal) {
      member_weights.assign(set.weights.begin(), set.weights.end());
      membership_weights.resize(set.weights.size());
    }
    for (std::uint32_t c = 0; c < clusters; ++c)
      for (Index k = set.offsets[c]; k < set.offsets[c + 1]; ++k) {
        const std::uint32_t at = next[set.members[k]]++;
        long_memberships[at] = c;
        if (!equal) membership_weights[at] = static_cast<float>(set.weights[k]);
      }
    if (std::max(particles, clusters) <= 0x10000) {
      short_members.assign(long_members.begin(), long_members.end());
      short_memberships.assign(long_memberships.begin(), long_memberships.end());
    }
    for (std::size_t i = 0; i < particles; ++i) {
      if (equal) share[i] = static_cast<float>(common[i]);
      const double m = double(mass[i]) * (equal ? double(share[i]) : 1.0);
      for (int k = 0; k < 3; ++k) lever[4 * i + k] = static_cast<float>(m * rest_exact[i][k]);
      lever[4 * i + 3] = static_cast<float>(m);
    }
  }

  void makeClusters(const MatchInput& in) {
    const std::size_t n = cluster_stride;
    maps.assign(16 * n, 0.0f);
    constants.assign(kClusterFields * n, 0.0f);
    quaternions.assign(4 * n, 0.0f);
    double total = 0.0;
    for (double m : in.masses) total += m;
    const Vec3 centre = in.rest[0] - rest_exact[0];
    const auto put = [&](std::size_t c, int field, const Mat3& m) {
      const double entries[6] = {m(0, 0), m(1, 1), m(2, 2), m(0, 1), m(1, 2), m(2, 0)};
      for (int k = 0; k < 6; ++k) constants[(field + k) * n + c] = static_cast<float>(entries[k]);
    };
    for (std::size_t c = 0; c < n; ++c) {
      quaternions[3 * n + c] = 1.0f;
      if (c >= clusters) {
        put(c, kRestMoment, Mat3::Identity());
        continue;
      }
      const ClusterRest& shape = in.shape.clusters[c];
      Mat3 moment = Mat3::Zero();
      for (Index k = in.clusters.offsets[c]; k < in.clusters.offsets[c + 1]; ++k) {
        const Index i = in.clusters.members[k];
        const Vec3 q = in.rest[i] - shape.centre;
        moment += in.masses[i] * in.clusters.weights[k] / total * q * q.transpose();
      }
      put(c, kRestMoment, moment);
      for (int k = 0; k < 3; ++k) constants[(kCentre + k) * n + c] = static_cast<float>(shape.centre[k] - centre[k]);
      constants[kInverseMass * n + c] = static_cast<float>(total / shape.mass);
      put(c, kInverseMoment, shape.moment_inverse * total);
    }
  }

  OverlapView view() {
    OverlapView w;
    w.particles = particles, w.particle_stride = particle_stride;
    w.clusters = clusters, w.cluster_stride = cluster_stride;
    w.u = u.data(), w.v = v.data(), w.rest = rest.data(), w.mass = mass.data(), w.lever = lever.data();
    w.share = share.data(), w.moments = moments.data(), w.maps = maps.data();
    w.member_offsets = member_offsets.data(), w.membership_offsets = membership_offsets.data();
    w.short_members = short_members.empty() ? nullptr : short_members.data();
    w.short_memberships = short_memberships.empty() ? nullptr : short_memberships.data();
    w.long_members = long_members.data(), w.long_memberships = long_memberships.data();
    w.member_weights = member_weights.empty() ? nullptr : member_weights.data();
    w.membership_weights = membership_weights.empty() ? nullptr : membership_weights.data();
    w.cluster_constants = constants.data(), w.quaternions = quaternions.data();
    return w;
  }

  // The frame of the given positions, and the positions in it.
  void place(const Points& positions) {
    const std::size_t n = particle_stride;
    Vec3 sum = Vec3::Zero();
    for (std::size_t i = 0; i < particles; ++i) sum += double(mass[i]) * (positions[i] - positions[0]);
    origin = positions[0] + sum;
    Mat3 moment = Mat3::Zero();
    for (std::size_t i = 0; i < particles; ++i)
      moment += double(mass[i]) * (positions[i] - origin) * rest_exact[i].transpose();
    frame = nearestRotation(moment, frame).rotation;
    const Mat3 back = frame.toRotationMatrix().transpose();
    for (std::size_t i = 0; i < particles; ++i) {
      const Vec3 d = back * (positions[i] - origin) - rest_exact[i];
      for (int k = 0; k < 3; ++k) u[k * n + i] = static_cast<float>(d[k]);
    }
  }

  void setRotation(std::size_t c, const Quat& rotation) {
    const Quat q = frame.conjugate() * rotation;
    for (int k = 0; k < 4; ++k) quaternions[k * cluster_stride + c] = static_cast<float>(q.coeffs()[k]);
  }
  Quat rotation(std::size_t c) const {
    Quat q;
    for (int k = 0; k < 4; ++k) q.coeffs()[k] = quaternions[k * cluster_stride + c];
    return (frame * q).normalized();
  }

  std::array<double, kOverlapSums> addUp(std::size_t chunks, int fields) const {
    std::array<double, kOverlapSums> all{};
    for (std::size_t c = 0; c < chunks; ++c)
      for (int k = 0; k < fields; ++k) all[k] += sums[c * kOverlapSums + k];
    return all;
  }

  template <class Work>
  void forChunks(const ForEach& for_each, std::size_t padded, const Work& work) {
    for_each((padded + kChunk - 1) / kChunk, [&](std::size_t chunk) {
      const FlushDenormals flush;
      const std::size_t first = chunk * kChunk;
      work(first, std::min<std::size_t>(kChunk, padded - first), sums.data() + chunk * kOverlapSums);
    });
  }

  // Maps of all clusters; gives the sum of their rotations in the frame. seen(first, count, scratch) sees each chunk.
  template <class Seen>
  Quat fit(const OverlapView& w, const StepNumbers& numbers, InstructionSet set, const ForEach& for_each,
           const Seen& seen) {
    const Entries& entries = entriesOf(set);
    forChunks(for_each, cluster_stride, [&](std::size_t first, std::size_t count, double* sum) {
      ClusterScratch scratch;
      entries.gatherClusters(w, first, count, scratch);
      RotationBatch<float> rotations;
      rotations.count = count;
      rotations.matrices = scratch.moment[0];
      rotations.matrix_stride = kChunk;
      rotations.quaternions = quaternions.data() + first;
      rotations.quaternion_stride = cluster_stride;
      rotations.rotations = scratch.rotation[0];
      rotations.rotation_stride = kChunk;
      rotations.flags = flags.data() + first;
      nearestRotationsWarm(rotations, set);
      entries.mapClusters(w, numbers, first, count, scratch, sum);
      seen(first, count, scratch);
    });
    const auto sum = addUp((cluster_stride + kChunk - 1) / kChunk, 4);
    return Quat(sum[3], sum[0], sum[1], sum[2]);
  }

  // Moves the frame by `turn` about its origin after bringing its origin to `shift` (both in the frame).
  void follow(const Quat& turn, const Vec3& shift) {
    origin += frame * shift;
    frame = (frame * turn).normalized();
    const Mat3 rest_of_turn = turn.toRotationMatrix().transpose() - Mat3::Identity();
    float d[9], s[3];
    for (int k = 0; k < 9; ++k) d[k] = static_cast<float>(rest_of_turn(k / 3, k % 3));
    for (int k = 0; k < 3; ++k) s[k] = static_cast<float>(shift[k]);
    const std::size_t n = particle_stride;
    float *ux = u.data(), *uy = ux + n, *uz = uy + n, *vx = v.data(), *vy = vx + n, *vz = vy + n;
    const float *rx = rest.data(), *ry = rx + n, *rz = ry + n;
    for (std::size_t i = 0; i < n; ++i) {  // small differences alone, so that nothing is lost
      const float x = ux[i] - s[0], y = uy[i] - s[1], z = uz[i] - s[2];
      const float px = rx[i] + x, py = ry[i] + y, pz = rz[i] + z;
      const float a = vx[i], b = vy[i], c = vz[i];
      ux[i] = x + (d[0] * px + d[1] * py + d[2] * pz);
      uy[i] = y + (d[3] * px + d[4] * py + d[5] * pz);
      uz[i] = z + (d[6] * px + d[7] * py + d[8] * pz);
      vx[i] = a + (d[0] * a + d[1] * b + d[2] * c);
      vy[i] = b + (d[3] * a + d[4] * b + d[5] * c);
      vz[i] = c + (d[6] * a + d[7] * b + d[8] * c);
    }
    const float tx = static_cast<float>(-turn.x()), ty = static_cast<float>(-turn.y());
    const float tz = static_cast<float>(-turn.z()), tw = static_cast<float>(turn.w());
    const std::size_t m = cluster_stride;
    float *qx = quaternions.data(), *qy = qx + m, *qz = qy + m, *qw = qz + m;
    for (std::size_t i = 0; i < m; ++i) {
      const float x = qx[i], y = qy[i], z = qz[i], w = qw[i];
      qx[i] = tw * x + tx * w + ty * z - tz * y;
      qy[i] = tw * y + ty * w + tz * x - tx * z;
      qz[i] = tw * z + tz * w + tx * y - ty * x;
      qw[i] = tw * w - tx * x - ty * y - tz * z;
    }
  }
};

OverlapBatch::OverlapBatch(const MatchInput& body) : impl_(std::make_unique<Impl>(body)) {}
OverlapBatch::~OverlapBatch() = default;
OverlapBatch::OverlapBatch(OverlapBatch&&) noexcept = default;
OverlapBatch& OverlapBatch::operator=(OverlapBatch&&) noexcept = default;

void OverlapBatch::setState(const Points& positions, const Points& velocities, const std::vector<Quat>& rotations) {
  Impl& b = *impl_;
  b.place(positions);
  const Mat3 back = b.frame.toRotationMatrix().transpose();
  for (std::size_t i = 0; i < b.particles; ++i) {
    const Vec3 turned = back * velocities[i];
    for (int k = 0; k < 3; ++k) b.v[k * b.particle_stride + i] = static_cast<float>(turned[k]);
  }
  for (std::size_t c = 0; c < b.clusters; ++c) b.setRotation(c, rotations[c]);
}

void OverlapBatch::getState(Points& positions, Points& velocities, std::vector<Quat>& rotations) const {
  const Impl& b = *impl_;
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

void OverlapBatch::step(const BatchStep& step, MatchCounters& counters, const ForEach& for_each) {
  Impl& b = *impl_;
  if (b.particles == 0) return;
  const Entries& entries = entriesOf(step.set);
  const OverlapView w = b.view();
  StepNumbers numbers = numbersOf(step);
  const Mat3 back = b.frame.toRotationMatrix().transpose();
  const Vec3 gravity = back * step.gravity;
  for (int k = 0; k < 3; ++k) numbers.gravity[k] = static_cast<float>(gravity[k]);
  const std::size_t chunks = (b.particle_stride + kChunk - 1) / kChunk;

  b.forChunks(for_each, b.particle_stride, [&](std::size_t first, std::size_t count, double* sum) {
    entries.spreadParticles(w, numbers, first, count, sum);
  });
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
  Quat turn = Quat::Identity();
  const double* const m = sums.data() + kSumMoment;
  Mat3 moment;
  moment << m[0], m[3], m[5], m[3], m[1], m[4], m[5], m[4], m[2];
  moment -= centre * centre.transpose();
  const double trace = 2.0 * moment.trace();
  Mat3 inverse = Mat3::Zero();
  if (trace > 0.0) inverse = inverseWithoutNull(Mat3::Identity() * 0.5 - moment / trace) / trace;
  if (numbers.pull > 0.0f) {
    turn = b.fit(w, numbers, step.set, for_each, [](std::size_t, std::size_t, const ClusterScratch&) {});
    b.forChunks(for_each, b.particle_stride, [&](std::size_t first, std::size_t count, double* sum) {
      entries.pullParticles(w, numbers, motion.centre, first, count, nullptr, sum);
    });
    const auto leaked = b.addUp(chunks, 3);
    const Vec3 restore = inverse * Vec3(leaked[0], leaked[1], leaked[2]);
    for (int k = 0; k < 3; ++k) motion.restore[k] = static_cast<float>(restore[k]);
    match_sets::count(b.flags.data(), b.clusters, counters);
    if (numbers.beta > 0.0f) counters.linear_fits += b.clusters;
  }
  if (numbers.lost > 0.0f) {
    const Vec3 spin = inverse * (Vec3(sums[kSumSpin], sums[kSumSpin + 1], sums[kSumSpin + 2]) - centre.cross(velocity));
    for (int k = 0; k < 3; ++k) motion.spin[k] = static_cast<float>(spin[k]);
  }
  b.forChunks(for_each, b.particle_stride, [&](std::size_t first, std::size_t count, double*) {
    entries.moveParticles(w, numbers, motion, first, count);
  });

  const double length = turn.norm();
  if (!(length > 0.1 * static_cast<double>(b.clusters)) || numbers.pull <= 0.0f) turn = Quat::Identity();
  turn.normalize();
  if (turn.vec().norm() > kFarTurn || centre.norm() > kFarShift * b.size) b.follow(turn, centre);
}

void OverlapBatch::match(const Points& y, MatchMode mode, double beta, std::vector<ClusterPose>& poses, Points& goals,
                         MatchCounters& counters, const ForEach& for_each) {
  Impl& b = *impl_;
  BatchStep settings;
  settings.mode = mode;
  settings.beta = beta;
  StepNumbers numbers = numbersOf(settings);
  if (mode != MatchMode::kRigid) numbers.beta = static_cast<float>(beta);
  numbers.h = 0.0f;
  b.place(y);
  std::fill(b.v.begin(), b.v.end(), 0.0f);
  for (std::size_t c = 0; c < b.clusters; ++c) b.setRotation(c, poses[c].rotation);
  const Entries& entries = entriesOf(settings.set);
  const OverlapView w = b.view();
  b.forChunks(for_each, b.particle_stride, [&](std::size_t first, std::size_t count, double* sum) {
    entries.spreadParticles(w, numbers, first, count, sum);
  });
  const Mat3 forth = b.frame.toRotationMatrix();
  const std::size_t n = b.cluster_stride;
  b.fit(w, numbers, settings.set, for_each, [&](std::size_t first, std::size_t count, const ClusterScratch& s) {
    for (std::size_t i = 0; i < count && first + i < b.clusters; ++i) {
      const std::size_t c = first + i;
      ClusterPose& pose = poses[c];
      pose.rotation = b.rotation(c);
      const float* const f = b.constants.data() + c;
      pose.centre =
          b.origin + forth * Vec3(double(f[kCentre * n]) + s.mean[0][i], double(f[(kCentre + 1) * n]) + s.mean[1][i],
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
  const float centre[3] = {};
  b.forChunks(for_each, b.particle_stride, [&](std::size_t first, std::size_t count, double* sum) {
    entries.pullParticles(w, numbers, centre, first, count, b.goals.data(), sum);
  });
  goals.resize(b.particles);
  const std::size_t p = b.particle_stride;
  for (std::size_t i = 0; i < b.particles; ++i)
    goals[i] = b.origin + forth * (b.rest_exact[i] + Vec3(b.goals[i], b.goals[p + i], b.goals[2 * p + i]));
  match_sets::count(b.flags.data(), b.clusters, counters);
  if (numbers.beta > 0.0f) counters.linear_fits += b.clusters;
}

}  // namespace meshless
