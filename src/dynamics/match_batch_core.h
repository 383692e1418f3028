// A body of overlapping clusters in a frame that moves and turns with it: what the batch of general clusters and the
// one of summed neighbourhoods share.
#pragma once

#include <array>
#include <cassert>
#include <cstdint>
#include <optional>

#include "match_batch_common.h"
#include "meshless_surgery/dynamics/rotation.h"

namespace meshless::match_sets {

inline std::size_t paddedTo(std::size_t n, std::size_t unit) { return (n + unit - 1) / unit * unit; }

/// Where particles lie in a lattice: site (z size[1] + y) size[0] + x of each. Cluster i is of all particles at most
/// `width` sites from particle i along each axis.
struct Lattice {
  std::array<std::uint32_t, 3> size{};
  std::uint32_t width = 0;
  std::vector<std::uint32_t> sites;

  std::size_t layer() const { return std::size_t{size[0]} * size[1]; }
};

/// State and constants of one body of overlapping clusters. With a lattice, a cluster is the neighbourhood of a
/// particle in it and sums are summed neighbourhoods; else they go over lists of pairs.
struct OverlapCore {
  std::optional<Lattice> lattice;
  std::size_t particles = 0, clusters = 0, particle_stride = 0, cluster_stride = 0;
  double size = 0.0;  // [m] root of the mean square distance from the centre of mass at rest
  Points rest_exact;  // [m] from there
  Floats u, v, rest, mass, lever, share, moments, maps, constants, quaternions, goals;
  std::vector<std::uint32_t> member_offsets, membership_offsets, long_members, long_memberships;
  std::vector<std::uint16_t> short_members, short_memberships;
  Floats member_weights, membership_weights;
  std::vector<std::uint32_t> layer_begin, layer_count;  // rows that a particle sums, one a layer
  std::vector<std::uint32_t> absent_offsets, absent;    // rows of sites without a particle, layer by layer
  std::vector<std::uint8_t> flags;
  std::vector<double> sums;  // of chunks
  Vec3 origin = Vec3::Zero();
  Quat frame = Quat::Identity();

  OverlapCore(const MatchInput& in, std::optional<Lattice> with) : lattice(std::move(with)) {
    assert(isUnplastic(in));
    particles = in.rest.size();
    clusters = in.clusters.size();
    particle_stride = paddedTo(particles, kBlock);
    cluster_stride = paddedTo(clusters, kBlock);
    makeParticles(in);
    makePairs(in);
    makeClusters(in);
    if (lattice) makeLattice();
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

  // Rows lie at the lattice's sites, those that stand in for no particle beyond them.
  void makeLattice() {
    const std::size_t layer = lattice->layer(), rows = layer * lattice->size[2], n = particle_stride;
    lattice->sites.resize(n, static_cast<std::uint32_t>(rows));
    moments.assign(16 * (rows + 1), 0.0f);
    maps.assign(16 * (rows + 1), 0.0f);
    layer_begin.assign(n, 0);
    layer_count.assign(n, 0);
    std::vector<bool> taken(rows, false);
    const std::uint32_t width = lattice->width;
    for (std::size_t i = 0; i < particles; ++i) {
      const std::uint32_t site = lattice->sites[i], z = static_cast<std::uint32_t>(site / layer);
      const std::uint32_t low = z - std::min(width, z), high = std::min(z + width, lattice->size[2] - 1);
      taken[site] = true;
      layer_begin[i] = static_cast<std::uint32_t>(site - (z - low) * layer);
      layer_count[i] = high - low + 1;
    }
    for (std::size_t z = 0; z < lattice->size[2]; ++z) {
      absent_offsets.push_back(static_cast<std::uint32_t>(absent.size()));
      for (std::size_t row = z * layer; row < (z + 1) * layer; ++row)
        if (!taken[row]) absent.push_back(static_cast<std::uint32_t>(row));
    }
    absent_offsets.push_back(static_cast<std::uint32_t>(absent.size()));
    long_members = long_memberships = {};
    short_members = short_memberships = {};
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
    w.sites = lattice ? lattice->sites.data() : nullptr;
    w.layer_begin = layer_begin.data(), w.layer_count = layer_count.data();
    w.layer = lattice ? lattice->layer() : 0;
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
    // What pads the arrays goes along with the body, into what is not finite too: it comes back here.
    for (int k = 0; k < 3; ++k) {
      std::fill(u.begin() + k * n + particles, u.begin() + (k + 1) * n, 0.0f);
      std::fill(v.begin() + k * n + particles, v.begin() + (k + 1) * n, 0.0f);
    }
    for (int k = 0; k < 4; ++k)
      std::fill(quaternions.begin() + k * cluster_stride + clusters, quaternions.begin() + (k + 1) * cluster_stride,
                k == 3 ? 1.0f : 0.0f);
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

  // Rows of a lattice summed along x and y, each layer for itself; sums along z are made where they are used.
  void sumLayers(Floats& rows, const Entries& entries, const ForEach& for_each) {
    if (!lattice) return;
    for_each(lattice->size[2], [&](std::size_t z) {
      const FlushDenormals flush;
      for (std::uint32_t k = absent_offsets[z]; k < absent_offsets[z + 1]; ++k)
        std::fill_n(rows.data() + 16 * std::size_t{absent[k]}, 16, 0.0f);
      Floats line(16 * std::size_t{std::max(lattice->size[0], lattice->size[1])});
      entries.sumLayer(rows.data() + 16 * z * lattice->layer(), lattice->size[0], lattice->size[1], lattice->width,
                       line.data());
    });
  }

  // Maps of all clusters; counts them, gives the sum of their rotations in the frame. seen(first, count, scratch) sees
  // each chunk.
  template <class Seen>
  Quat fit(const OverlapView& w, const StepNumbers& numbers, InstructionSet set, const ForEach& for_each,
           MatchCounters& counters, const Seen& seen) {
    const Entries& entries = entriesOf(set);
    sumLayers(moments, entries, for_each);
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
      MatchCounters counted;
      match_sets::count(rotations.flags, std::min(count, clusters - std::min(first, clusters)), counted);
      sum[4] = static_cast<double>(counted.cold_rotations);
      sum[5] = static_cast<double>(counted.rank_fallbacks);
      seen(first, count, scratch);
    });
    sumLayers(maps, entries, for_each);
    const auto sum = addUp((cluster_stride + kChunk - 1) / kChunk, 6);
    counters.clusters += clusters;
    counters.rotations += clusters;
    counters.cold_rotations += static_cast<std::size_t>(sum[4]);
    counters.rank_fallbacks += static_cast<std::size_t>(sum[5]);
    if (numbers.beta > 0.0f) counters.linear_fits += clusters;
    return Quat(sum[3], sum[0], sum[1], sum[2]);
  }

  // Moves the frame by `turn` about its origin after bringing its origin to `shift` (both in the frame).
  void follow(const Quat& turn, const Vec3& shift, const ForEach& for_each) {
    origin += frame * shift;
    frame = (frame * turn).normalized();
    const Mat3 rest_of_turn = turn.toRotationMatrix().transpose() - Mat3::Identity();
    float d[9], s[3];
    for (int k = 0; k < 9; ++k) d[k] = static_cast<float>(rest_of_turn(k / 3, k % 3));
    for (int k = 0; k < 3; ++k) s[k] = static_cast<float>(shift[k]);
    const std::size_t n = particle_stride, m = cluster_stride;
    forChunks(for_each, n, [&](std::size_t first, std::size_t count, double*) {
      float *ux = u.data() + first, *uy = ux + n, *uz = uy + n, *vx = v.data() + first, *vy = vx + n, *vz = vy + n;
      const float *rx = rest.data() + first, *ry = rx + n, *rz = ry + n;
      for (std::size_t i = 0; i < count; ++i) {  // small differences alone, so that nothing is lost
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
    });
    const float tx = static_cast<float>(-turn.x()), ty = static_cast<float>(-turn.y());
    const float tz = static_cast<float>(-turn.z()), tw = static_cast<float>(turn.w());
    forChunks(for_each, m, [&](std::size_t first, std::size_t count, double*) {
      float *qx = quaternions.data() + first, *qy = qx + m, *qz = qy + m, *qw = qz + m;
      for (std::size_t i = 0; i < count; ++i) {
        const float x = qx[i], y = qy[i], z = qz[i], w = qw[i];
        qx[i] = tw * x + tx * w + ty * z - tz * y;
        qy[i] = tw * y + ty * w + tz * x - tx * z;
        qz[i] = tw * z + tz * w + tx * y - ty * x;
        qw[i] = tw * w - tx * x - ty * y - tz * z;
      }
    });
  }

  void setState(const Points& positions, const Points& velocities, const std::vector<Quat>& rotations);
  void getState(Points& positions, Points& velocities, std::vector<Quat>& rotations) const;
  void step(const BatchStep& step, MatchCounters& counters, const ForEach& for_each);
  void match(const Points& y, MatchMode mode, double beta, std::vector<ClusterPose>& poses, Points& goals,
             MatchCounters& counters, const ForEach& for_each);
};

}  // namespace meshless::match_sets
