#include "meshless_surgery/dynamics/elastic_batch.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <thread>

#include <gtest/gtest.h>

#include "support/random.h"

namespace meshless {
namespace elastic_batch_test {

using test::Random;

const ElasticParameters kSoft = elasticParameters(5000.0, 0.4, 1000.0);
constexpr double kEdge = 0.01;  // [m]

struct Body {
  Points rest;
  std::vector<double> masses;
  ClusterSet clusters;
  RestShape shape;
  std::vector<ElasticRest> elastic;
  std::vector<ClusterPose> poses;

  MatchInput input() const { return {rest, masses, clusters, shape}; }
  void finish() {
    shape = makeRestShape(rest, masses, clusters);
    elastic = makeElasticRest(shape);
    poses.resize(clusters.size());
  }
};

// Cells of 2x2x2 particles; jitter moves the particles off the lattice, so that no cell is a box.
Body lattice(int nx, int ny, int nz, double jitter = 0.0) {
  Body body;
  Random random(1);
  for (int z = 0; z <= nz; ++z)
    for (int y = 0; y <= ny; ++y)
      for (int x = 0; x <= nx; ++x) body.rest.push_back(kEdge * (Vec3(x, y, z) + random.vector(jitter)));
  std::vector<std::array<Index, 8>> cells;
  for (int z = 0; z < nz; ++z)
    for (int y = 0; y < ny; ++y)
      for (int x = 0; x < nx; ++x) {
        std::array<Index, 8> cell;
        for (int k = 0; k < 8; ++k)
          cell[k] = static_cast<Index>(x + (k & 1) + (nx + 1) * (y + (k >> 1 & 1) + (ny + 1) * (z + (k >> 2 & 1))));
        cells.push_back(cell);
      }
  // Cells at the border of an organ are filled in part.
  std::vector<double> cell_masses;
  body.masses.assign(body.rest.size(), 0.0);
  for (const auto& cell : cells) {
    cell_masses.push_back(1000.0 * kEdge * kEdge * kEdge * random.uniform(0.3, 1.0));
    for (Index i : cell) body.masses[i] += cell_masses.back() / 8.0;
  }
  body.clusters = clustersOfCells(cells, cell_masses, body.masses);
  body.finish();
  return body;
}

// Clusters of every kind: cells, parts of cells, planar, collinear, single and large ones.
Body mixture(unsigned seed) {
  Body body = lattice(4, 3, 3);
  Random random(seed);
  const ClusterSet whole = body.clusters;
  body.clusters = ClusterSet();
  body.clusters.offsets.push_back(0);
  std::vector<double> total(body.rest.size(), 0.0);
  const auto add = [&](const std::vector<Index>& members) {
    for (Index i : members) {
      body.clusters.members.push_back(i);
      body.clusters.weights.push_back(random.uniform(0.5, 1.0));
      total[i] += body.clusters.weights.back();
    }
    body.clusters.offsets.push_back(static_cast<Index>(body.clusters.members.size()));
  };
  std::vector<Index> everything;
  for (Index i = 0; i < body.rest.size(); ++i) everything.push_back(i);
  add(everything);
  for (Index c = 0; c < whole.size(); ++c) {
    std::vector<Index> members(whole.members.begin() + whole.offsets[c], whole.members.begin() + whole.offsets[c + 1]);
    switch (c % 6) {
      case 0:
        members.resize(4);
        break;  // a face
      case 1:
        members.resize(2);
        break;
      case 2:
        members.resize(1);
        break;
      case 3:
        members.erase(members.begin() + random.integer(0, 7));
        break;
      case 4:
        members = {members[0], members[1], members[2], members[4]};
        break;  // a corner
      default:
        break;
    }
    add(members);
  }
  for (std::size_t k = 0; k < body.clusters.members.size(); ++k)
    body.clusters.weights[k] /= total[body.clusters.members[k]];
  body.finish();
  return body;
}

Points moved(const Body& body, const Mat3& map, const Vec3& shift, double noise, Random& random) {
  Points y;
  for (const Vec3& p : body.rest) y.push_back(map * (p + random.vector(noise)) + shift);
  return y;
}

// Infinite where anything is not finite.
double largest(const Points& points) {
  double most = 0.0;
  for (const Vec3& p : points) {
    if (!(p.norm() < 1e300)) return std::numeric_limits<double>::infinity();
    most = std::max(most, p.norm());
  }
  return most;
}

double farthest(Points a, const Points& b) {
  if (a.size() != b.size()) return std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < a.size(); ++i) a[i] -= b[i];
  return largest(a);
}

std::vector<InstructionSet> sets() {
  std::vector<InstructionSet> available;
  for (InstructionSet set : {InstructionSet::kBaseline, InstructionSet::kAvx2, InstructionSet::kAvx512})
    if (instructionSetAvailable(set)) available.push_back(set);
  return available;
}

struct Result {
  Points accelerations;
  double stretch = 0.0;
  MatchCounters counters;
  ElasticBatchState state;
};

Result batchOf(const Body& body, const Points& y, InstructionSet set, double swelling = 1.0,
               const ForEach& for_each = nullptr) {
  const ElasticBatch batch(body.input(), body.elastic);
  Result result;
  batch.setRotations(body.poses, result.state);
  result.stretch = batch.accelerate(body.input(), kSoft, y, result.state, result.accelerations, result.counters,
                                    swelling, set, for_each);
  return result;
}

void expectAsReference(const Body& body, const Points& y, double allowed, double swelling = 1.0) {
  std::vector<ClusterPose> poses = body.poses;
  Points expected;
  MatchCounters counters;
  const double stretch =
      elasticAccelerations(body.input(), body.elastic, kSoft, y, poses, expected, counters, swelling);
  // At ease nothing is left but rounding of what cancels: E / (rho d) times 1e-14.
  ASSERT_LT(largest(expected), 1e300);
  const double scale = largest(expected) + kSoft.youngs / (kSoft.density * kEdge);
  for (InstructionSet set : sets()) {
    const Result result = batchOf(body, y, set, swelling);
    EXPECT_LE(farthest(result.accelerations, expected), allowed * scale) << "set " << static_cast<int>(set);
    EXPECT_NEAR(result.stretch, stretch, allowed * stretch);
    EXPECT_EQ(result.counters.clusters, counters.clusters);
    EXPECT_EQ(result.counters.rotations, counters.rotations);
    EXPECT_EQ(result.counters.linear_fits, counters.linear_fits);
    EXPECT_EQ(result.counters.rank_fallbacks, counters.rank_fallbacks);
    const ElasticBatch batch(body.input(), body.elastic);
    std::vector<ClusterPose> found = body.poses;
    batch.getRotations(result.state, found);
    for (std::size_t c = 0; c < found.size(); ++c) EXPECT_NEAR(found[c].rotation.norm(), 1.0, 1e-14);
  }
}

std::vector<Body> bodies() {
  std::vector<Body> all;
  for (int cells = 1; cells <= 17; ++cells) all.push_back(lattice(cells, 1, 1));  // every tail of a vector
  all.push_back(lattice(13, 5, 1));                                               // of a block
  all.push_back(lattice(13, 5, 1, 0.1));
  all.push_back(lattice(3, 2, 2, 0.1));
  for (unsigned seed = 0; seed < 5; ++seed) all.push_back(mixture(seed));
  return all;
}

TEST(ElasticBatch, LeavesWhatIsLargeToTheReference) {
  const Body mixed = mixture(0);
  EXPECT_GT(ElasticBatch(mixed.input(), mixed.elastic).others(), 1u);
}

TEST(ElasticBatch, IsTheReferenceForEveryShapeOfBody) {
  Random random(2);
  for (const Body& body : bodies())
    for (double noise : {0.0, 1e-9, 1e-5, 1e-4, 1e-3})
      expectAsReference(body, moved(body, Mat3::Identity(), Vec3::Zero(), noise, random), 1e-11);
}

TEST(ElasticBatch, IsTheReferenceWhereTheBodyIsTurnedStretchedSquashed) {
  Random random(3);
  for (const Body& body : {lattice(5, 4, 3), lattice(5, 4, 3, 0.1), mixture(7)})
    for (int trial = 0; trial < 30; ++trial) {
      const Mat3 turn = random.rotation().toRotationMatrix(), axes = random.rotation().toRotationMatrix();
      const Vec3 stretch(random.uniform(0.3, 3.0), random.uniform(0.3, 3.0), random.uniform(0.3, 3.0));
      const Points y =
          moved(body, turn * axes * stretch.asDiagonal() * axes.transpose(), random.vector(10.0), 2e-4, random);
      expectAsReference(body, y, 1e-10);
    }
}

TEST(ElasticBatch, IsTheReferenceWhereCellsAreInsideOutOrFlat) {
  Random random(4);
  for (const Body& body : {lattice(5, 4, 3), lattice(5, 4, 3, 0.1)})
    for (int trial = 0; trial < 30; ++trial) {
      const Mat3 axes = random.rotation().toRotationMatrix();
      // Singular values well apart from where the rotation is not unique.
      const Vec3 stretch(random.uniform(1.2, 1.6), random.uniform(0.8, 1.1),
                         trial % 3 == 0 ? 0.0 : random.uniform(-0.5, 0.1));
      expectAsReference(body, moved(body, axes * stretch.asDiagonal() * axes.transpose(), Vec3::Zero(), 1e-5, random),
                        1e-8);
    }
}

TEST(ElasticBatch, IsTheReferenceWhereEveryCellIsThrownAbout) {
  Random random(5);
  const Body body = lattice(5, 4, 3);
  for (int trial = 0; trial < 10; ++trial)
    expectAsReference(body, moved(body, Mat3::Identity(), Vec3::Zero(), 0.5 * kEdge, random), 1e-6);
}

TEST(ElasticBatch, IsTheReferenceWhereTheBodySwells) {
  Random random(14);
  for (const Body& body : {lattice(5, 4, 3), lattice(5, 4, 3, 0.1), mixture(2)})
    for (double swelling : {0.6, 0.9, 1.1, 1.6})
      expectAsReference(body, moved(body, Mat3::Identity(), Vec3::Zero(), 1e-3, random), 1e-11, swelling);
}

TEST(ElasticBatch, AKilometreAwayLosesNoMoreThanTheReference) {
  Random random(6);
  for (const Body& body : {lattice(5, 4, 3), lattice(5, 4, 3, 0.1)})
    expectAsReference(body, moved(body, Mat3::Identity(), Vec3(1000, -1000, 1000), 1e-4, random), 1e-9);
}

TEST(ElasticBatch, ABodyThatMovesRigidlyIsAtEase) {
  Random random(7);
  const Body body = lattice(5, 4, 3);
  for (int trial = 0; trial < 10; ++trial) {
    const Points y = moved(body, random.rotation().toRotationMatrix(), random.vector(1.0), 0.0, random);
    for (InstructionSet set : sets()) EXPECT_LT(largest(batchOf(body, y, set).accelerations), 1e-8);
  }
}

TEST(ElasticBatch, KeepsMomentum) {
  Random random(8);
  for (const Body& body : bodies())
    for (double noise : {1e-5, 1e-3, 1e-2}) {
      const Points y = moved(body, random.rotation().toRotationMatrix(), Vec3::Zero(), noise, random);
      for (InstructionSet set : sets()) {
        const Points a = batchOf(body, y, set).accelerations;
        Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
        double scale = 0.0, reach = 0.0;
        for (std::size_t i = 0; i < y.size(); ++i) {
          force += body.masses[i] * a[i];
          torque += body.masses[i] * y[i].cross(a[i]);
          scale += body.masses[i] * a[i].norm();
          reach = std::max(reach, y[i].norm());
        }
        EXPECT_LT(force.norm(), 1e-12 * scale);
        EXPECT_LT(torque.norm(), 1e-11 * scale * reach);
      }
    }
}

TEST(ElasticBatch, FollowsABodyThatTurns) {
  // As in a simulation: each call starts from the rotations of the last one, and none needs the exact method.
  Random random(9);
  const Body body = lattice(5, 4, 3);
  const ElasticBatch batch(body.input(), body.elastic);
  for (InstructionSet set : sets()) {
    ElasticBatchState state;
    batch.setRotations(body.poses, state);
    std::vector<ClusterPose> poses = body.poses;
    MatchCounters counters, reference;
    for (int step = 0; step < 400; ++step) {
      const Mat3 turn = Eigen::AngleAxisd(0.02 * step, Vec3(1, 2, 3).normalized()).toRotationMatrix();
      const Points y = moved(body, turn, Vec3::Zero(), 5e-4, random);
      Points a, expected;
      batch.accelerate(body.input(), kSoft, y, state, a, counters, 1.0, set);
      elasticAccelerations(body.input(), body.elastic, kSoft, y, poses, expected, reference);
      ASSERT_LT(largest(expected), 1e300);
      ASSERT_LE(farthest(a, expected), 1e-11 * largest(expected));
    }
    EXPECT_EQ(counters.cold_rotations, 0u);
    EXPECT_GT(reference.rotations, 0u);
  }
}

bool sameBits(const Vec3& a, const Vec3& b) { return std::memcmp(a.data(), b.data(), sizeof(Vec3)) == 0; }

TEST(ElasticBatch, NotANumberStaysWhereItIs) {
  Random random(10);
  for (const Body& body : {lattice(9, 4, 3), lattice(9, 4, 3, 0.1)})
    for (double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e300})
      for (InstructionSet set : sets()) {
        Points y = moved(body, Mat3::Identity(), Vec3::Zero(), 5e-4, random);
        const Points before = batchOf(body, y, set).accelerations;
        const Index spoilt = static_cast<Index>(random.integer(0, static_cast<int>(y.size()) - 1));
        y[spoilt].y() = bad;
        Result result = batchOf(body, y, set);
        std::vector<bool> touched(y.size(), false);
        for (Index c = 0; c < body.clusters.size(); ++c) {
          const auto first = body.clusters.members.begin() + body.clusters.offsets[c];
          const auto last = body.clusters.members.begin() + body.clusters.offsets[c + 1];
          if (std::find(first, last, spoilt) != last)
            for (auto i = first; i != last; ++i) touched[*i] = true;
        }
        for (std::size_t i = 0; i < y.size(); ++i)
          EXPECT_TRUE(touched[i] || sameBits(result.accelerations[i], before[i]));
        EXPECT_GE(result.stretch, 1.0);
        for (double q : result.state.rotations) EXPECT_LE(std::abs(q), 1.0 + 1e-14);
      }
}

TEST(ElasticBatch, ACellFindsTheSameInEveryLane) {
  // Cells that share no particle, all of them deformed alike, among neighbours that are not.
  Random random(11);
  Body body;
  std::vector<std::array<Index, 8>> cells;
  constexpr int kCells = 150;
  for (int c = 0; c < kCells; ++c) {
    cells.emplace_back();
    for (Index k = 0; k < 8; ++k) {
      cells.back()[k] = static_cast<Index>(body.rest.size());
      body.rest.emplace_back(kEdge * (k & 1), kEdge * (k >> 1 & 1), kEdge * (k >> 2 & 1));
    }
  }
  body.masses.assign(body.rest.size(), 1e-4);
  body.clusters = clustersOfCells(cells, std::vector<double>(kCells, 8e-4), body.masses);
  body.finish();
  Points cell;
  for (int k = 0; k < 8; ++k) cell.push_back(body.rest[k] + random.vector(1e-3));
  for (InstructionSet set : sets())
    for (int trial = 0; trial < 4; ++trial) {
      Points y = moved(body, random.rotation().toRotationMatrix(), Vec3::Zero(), trial * 2e-3, random);
      for (int c = trial; c < kCells; c += 3)
        for (int k = 0; k < 8; ++k) y[8 * c + k] = cell[k];
      const Points a = batchOf(body, y, set).accelerations;
      for (int c = trial; c < kCells; c += 3)
        for (int k = 0; k < 8; ++k) EXPECT_TRUE(sameBits(a[8 * c + k], a[8 * trial + k]));
    }
}

TEST(ElasticBatch, ThreadsChangeNothing) {
  const ForEach on_threads = [](std::size_t count, const std::function<void(std::size_t)>& work) {
    std::vector<std::thread> threads;
    for (std::size_t part = 0; part < 3; ++part)
      threads.emplace_back([&, part] {
        for (std::size_t i = part; i < count; i += 3) work(i);
      });
    for (std::thread& thread : threads) thread.join();
  };
  Random random(12);
  for (const Body& body : {lattice(12, 12, 12), lattice(9, 9, 9, 0.1), mixture(3)}) {
    const Points y = moved(body, Mat3::Identity(), Vec3::Zero(), 1e-3, random);
    for (InstructionSet set : sets()) {
      const Result one = batchOf(body, y, set), three = batchOf(body, y, set, 1.0, on_threads);
      EXPECT_EQ(one.stretch, three.stretch);
      for (std::size_t i = 0; i < y.size(); ++i) EXPECT_TRUE(sameBits(one.accelerations[i], three.accelerations[i]));
    }
  }
}

TEST(ElasticBatch, RotationsGoInAndOutAsTheyAre) {
  Body body = mixture(1);
  Random random(13);
  for (ClusterPose& pose : body.poses) pose.rotation = random.rotation();
  const ElasticBatch batch(body.input(), body.elastic);
  ElasticBatchState state;
  batch.setRotations(body.poses, state);
  std::vector<ClusterPose> poses(body.poses.size());
  for (std::size_t c = 0; c < poses.size(); ++c) poses[c].rotation = body.poses[c].rotation;
  batch.getRotations(state, poses);
  for (std::size_t c = 0; c < poses.size(); ++c) EXPECT_EQ(poses[c].rotation.coeffs(), body.poses[c].rotation.coeffs());
}

}  // namespace elastic_batch_test
}  // namespace meshless
