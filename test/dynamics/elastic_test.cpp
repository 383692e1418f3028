#include "meshless_surgery/dynamics/elastic.h"

#include <gtest/gtest.h>

#include "support/random.h"

namespace meshless {
namespace elastic_test {

// A block of nx x ny x nz cells of edge d, every particle with its share of the cells' masses.
struct Lattice {
  Points rest;
  std::vector<double> masses;
  ClusterSet clusters;
  RestShape shape;
  std::vector<ElasticRest> elastic;
  std::vector<ClusterPose> poses;

  MatchInput input() const { return {rest, masses, clusters, shape}; }
};

Lattice lattice(int nx, int ny, int nz, double d, double density) {
  Lattice l;
  for (int z = 0; z <= nz; ++z)
    for (int y = 0; y <= ny; ++y)
      for (int x = 0; x <= nx; ++x) l.rest.emplace_back(d * x, d * y, d * z);
  std::vector<std::array<Index, 8>> cells;
  const auto at = [&](int x, int y, int z) { return static_cast<Index>(x + (nx + 1) * (y + (ny + 1) * z)); };
  for (int z = 0; z < nz; ++z)
    for (int y = 0; y < ny; ++y)
      for (int x = 0; x < nx; ++x) {
        std::array<Index, 8> cell;
        for (int k = 0; k < 8; ++k) cell[k] = at(x + (k & 1), y + (k >> 1 & 1), z + (k >> 2 & 1));
        cells.push_back(cell);
      }
  const double mass = density * d * d * d;
  l.masses.assign(l.rest.size(), 0.0);
  for (const auto& cell : cells)
    for (Index i : cell) l.masses[i] += mass / 8.0;
  l.clusters = clustersOfCells(cells, std::vector<double>(cells.size(), mass), l.masses);
  l.shape = makeRestShape(l.rest, l.masses, l.clusters);
  l.elastic = makeElasticRest(l.shape);
  l.poses.resize(l.clusters.size());
  return l;
}

Points accelerations(Lattice& l, const ElasticParameters& material, const Points& y) {
  Points a;
  MatchCounters counters;
  elasticAccelerations(l.input(), l.elastic, material, y, l.poses, a, counters);
  return a;
}

const ElasticParameters kSoft = elasticParameters(5000.0, 0.4, 1000.0);

TEST(ElasticParameters, AreLames) {
  const ElasticParameters p = elasticParameters(3000.0, 0.25, 900.0);
  EXPECT_NEAR(p.mu, 1200.0, 1e-9);
  EXPECT_NEAR(p.lambda, 1200.0, 1e-9);
  EXPECT_EQ(p.density, 900.0);
}

TEST(ElasticAccelerations, ABodyThatMovesRigidlyIsAtEase) {
  Lattice l = lattice(3, 2, 2, 0.01, 1000.0);
  test::Random random(3);
  for (int trial = 0; trial < 20; ++trial) {
    const Quat turn = random.rotation();
    const Vec3 shift = random.vector(10.0);
    Points y;
    for (const Vec3& p : l.rest) y.push_back(turn * p + shift);
    // Accelerations of the material are of the order of E / (rho d) = 500 m/s^2.
    for (const Vec3& a : accelerations(l, kSoft, y)) EXPECT_LT(a.norm(), 1e-8);
    for (const ClusterPose& pose : l.poses) EXPECT_LT(pose.rotation.angularDistance(turn), 1e-6);
  }
}

TEST(ElasticAccelerations, AreTheGradientOfTheEnergyAndKeepMomentum) {
  Lattice l = lattice(2, 2, 1, 0.01, 1000.0);
  test::Random random(5);
  for (int trial = 0; trial < 10; ++trial) {
    Points y;
    const Quat turn = random.rotation();
    for (const Vec3& p : l.rest) y.push_back(turn * (p + random.vector(0.0012)));
    const Points a = accelerations(l, kSoft, y);
    Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
    double scale = 0.0;
    for (std::size_t i = 0; i < y.size(); ++i) {
      force += l.masses[i] * a[i];
      torque += l.masses[i] * y[i].cross(a[i]);
      scale += l.masses[i] * a[i].norm();
    }
    EXPECT_LT(force.norm(), 1e-12 * scale);
    EXPECT_LT(torque.norm(), 1e-12 * scale * 0.03);
    for (std::size_t i = 0; i < y.size(); ++i)
      for (int axis = 0; axis < 3; ++axis) {
        const double step = 1e-7;
        Points up = y, down = y;
        up[i][axis] += step;
        down[i][axis] -= step;
        const double slope = (elasticEnergy(l.input(), l.elastic, kSoft, up, l.poses) -
                              elasticEnergy(l.input(), l.elastic, kSoft, down, l.poses)) /
                             (2.0 * step);
        EXPECT_NEAR(-slope, l.masses[i] * a[i][axis], 1e-5 * scale);
      }
  }
}

TEST(ElasticAccelerations, AStretchedBarPullsWithYoungsModulus) {
  // Stretched by e along x and thinned by nu e, the ends pull with E e times the area, and the sides are free.
  const double e = 1e-5, d = 0.01, nu = 0.4, youngs = 5000.0;
  Lattice l = lattice(4, 3, 3, d, 1000.0);
  Points y;
  for (const Vec3& p : l.rest) y.emplace_back((1.0 + e) * p.x(), (1.0 - nu * e) * p.y(), (1.0 - nu * e) * p.z());
  const Points a = accelerations(l, kSoft, y);
  double pull = 0.0;
  for (std::size_t i = 0; i < y.size(); ++i) {
    if (l.rest[i].x() == 0.0) pull += l.masses[i] * a[i].x();
    if (l.rest[i].x() > 0.0 && l.rest[i].x() < 4 * d - 1e-9) EXPECT_LT(a[i].norm(), 1e-4 * youngs * e / (1000.0 * d));
  }
  EXPECT_NEAR(pull, youngs * e * 9.0 * d * d, 1e-4 * youngs * e * 9.0 * d * d);
}

TEST(ElasticAccelerations, CrushedTornAndFlatBodiesStayFinite) {
  Lattice l = lattice(2, 2, 2, 0.01, 1000.0);
  test::Random random(8);
  for (int trial = 0; trial < 30; ++trial) {
    Points y;
    const double size = std::pow(10.0, random.uniform(-6.0, 2.0));
    for (std::size_t i = 0; i < l.rest.size(); ++i)
      y.push_back(trial % 3 == 0 ? Vec3(l.rest[i].x(), 0, 0) : random.vector(size));
    for (const Vec3& a : accelerations(l, kSoft, y)) EXPECT_TRUE(a.allFinite());
  }
  for (const Vec3& a : accelerations(l, kSoft, Points(l.rest.size(), Vec3::Zero()))) EXPECT_TRUE(a.allFinite());
}

// Drawn out, torn and crushed cells pull by the gradient of the energy too, and need at most five times the substeps:
// an estimate that grew with the stretch, and a pressure that did, threw bodies apart that were drawn out tenfold.
TEST(ElasticAccelerations, FarFromRestAreTheGradientToo) {
  Lattice l = lattice(1, 1, 1, 0.01, 1000.0);
  test::Random random(9);
  Points a;
  MatchCounters counters;
  for (int trial = 0; trial < 60; ++trial) {
    const double size = std::pow(10.0, random.uniform(-1.0, 2.0));
    const Mat3 map = random.matrix(size) + Mat3(Vec3(random.uniform(0, 20), 1, 1).asDiagonal());
    Points y;
    for (const Vec3& p : l.rest) y.push_back(map * p + random.vector(0.0001 * size));
    std::vector<ClusterPose> poses = l.poses;
    EXPECT_LT(elasticAccelerations(l.input(), l.elastic, kSoft, y, poses, a, counters), 5.0) << map;
    double scale = 0.0;
    for (std::size_t i = 0; i < y.size(); ++i) scale += l.masses[i] * a[i].norm();
    for (std::size_t i = 0; i < y.size(); ++i)
      for (int axis = 0; axis < 3; ++axis) {
        const double step = 1e-6 * size * 0.01;
        Points up = y, down = y;
        up[i][axis] += step;
        down[i][axis] -= step;
        const double slope = (elasticEnergy(l.input(), l.elastic, kSoft, up, poses) -
                              elasticEnergy(l.input(), l.elastic, kSoft, down, poses)) /
                             (2.0 * step);
        EXPECT_NEAR(-slope, l.masses[i] * a[i][axis], 1e-4 * scale) << map;
      }
  }
}

TEST(ElasticAccelerations, AFlatClusterResistsAsARigidOne) {
  Lattice l;
  l.rest = {{0, 0, 0}, {0.01, 0, 0}, {0, 0.01, 0}, {0.01, 0.01, 0}};
  l.masses.assign(4, 0.001);
  l.clusters = makeClusters(l.rest, makeGraph(l.rest, {{0, 1}, {0, 2}, {1, 3}, {2, 3}}), {});
  l.shape = makeRestShape(l.rest, l.masses, l.clusters);
  l.elastic = makeElasticRest(l.shape);
  l.poses.resize(1);
  Points y = l.rest;
  y[3].x() += 0.001;
  const Points a = accelerations(l, kSoft, y);
  EXPECT_LT(a[3].x(), 0.0);
  EXPECT_LT((a[0] + a[1] + a[2] + a[3]).norm(), 1e-12 * a[3].norm());
}

TEST(HighestFrequency, IsWhereAStepOfOneOverItIsStable) {
  for (const double nu : {0.0, 0.3, 0.45}) {
    Lattice l = lattice(4, 4, 4, 0.01, 1000.0);
    const ElasticParameters material = elasticParameters(5000.0, nu, 1000.0);
    const double frequency = highestFrequency(l.input(), l.elastic, material);
    // Of the order of the speed of sound over half a cell.
    const double sound = std::sqrt((material.lambda + 2.0 * material.mu) / material.density);
    EXPECT_GT(frequency, 1.2 * sound / 0.01);
    EXPECT_LT(frequency, 4.0 * sound / 0.01);
    // It scales as it must: with the root of the stiffness, and against the size.
    Lattice large = lattice(4, 4, 4, 1.0, 1000.0);
    const ElasticParameters stiff = elasticParameters(500000.0, nu, 1000.0);
    EXPECT_NEAR(highestFrequency(large.input(), large.elastic, stiff), 0.1 * frequency, 1e-4 * frequency);
  }
}

}  // namespace elastic_test
}  // namespace meshless
