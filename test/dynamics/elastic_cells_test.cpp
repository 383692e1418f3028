#include "meshless_surgery/dynamics/elastic_cells.h"

#include <cmath>
#include <deque>
#include <utility>

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "meshless_surgery/dynamics/elastic_batch.h"
#include "meshless_surgery/dynamics/plastic.h"
#include "support/cells.h"

namespace meshless {
namespace elastic_cells_test {

using test::CellBody;
using test::cutCells;
using test::kCellDensity;
using test::kCellEdge;
using test::Random;
using test::wholeCells;

const ElasticParameters kSoft = elasticParameters(5000.0, 0.4, kCellDensity);
// Materials that stiffen: by all strain, where pressed, where pulled, as much as may be asked for.
std::vector<ElasticParameters> stiffening() {
  std::vector<ElasticParameters> all;
  for (const auto& [stiffening, asymmetry] :
       {std::pair{20.0, 0.0}, {0.0, 12.0}, {0.0, -12.0}, {10.0, 10.0}, {1000.0, 30.0}, {1000.0, -30.0}}) {
    all.push_back(kSoft);
    all.back().stiffening = stiffening;
    all.back().asymmetry = asymmetry;
  }
  return all;
}
const double kScale = kSoft.youngs / (kSoft.density * kCellEdge);  // [m/s^2] of the material's accelerations

Points accelerations(const CellBody& body, const Points& y, double swelling = 1.0,
                     const std::vector<PlasticShape>* plastic = nullptr) {
  Points a;
  MatchCounters counters;
  std::vector<ClusterPose> poses = body.poses;
  elasticAccelerations(body.cells, kSoft, y, poses, a, counters, swelling, plastic);
  return a;
}

Points moved(const CellBody& body, const Mat3& map, const Vec3& shift, double noise, Random& random) {
  Points y;
  for (const Vec3& p : body.rest) y.push_back(map * (p + random.vector(noise)) + shift);
  return y;
}

std::vector<PlasticShape> someShapes(std::size_t count, Random& random) {
  std::vector<PlasticShape> shapes;
  for (std::size_t c = 0; c < count; ++c) {
    Mat3 logarithm = random.matrix(0.2);
    logarithm = (logarithm + logarithm.transpose()).eval();
    logarithm -= logarithm.trace() / 3.0 * Mat3::Identity();
    shapes.push_back(plasticShape(logarithm));
  }
  return shapes;
}

// Inertial mass times acceleration, its largest and its sums.
struct Balance {
  Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
  double scale = 0.0, reach = 0.0;

  Balance(const CellBody& body, const Points& y, const Points& a) {
    for (std::size_t i = 0; i < y.size(); ++i) {
      force += body.cells.masses[i] * a[i];
      torque += body.cells.masses[i] * (y[i] - y[0]).cross(a[i]);
      scale += body.cells.masses[i] * a[i].norm();
      reach = std::max(reach, (y[i] - y[0]).norm());
    }
  }
};

TEST(ElasticCells, AnAffineMapStressesEachAsItShouldAndNoModeFeelsIt) {
  // Forces of the stress of the map, by the trilinear shape functions' gradients at the centroid.
  Random random(2);
  const CellBody body = cutCells(4, 3, 2, 1);
  for (int trial = 0; trial < 10; ++trial) {
    const Mat3 map = Mat3::Identity() + random.matrix(0.15);
    const Vec3 shift = random.vector(0.1);
    const Points y = moved(body, map, shift, 0.0, random);
    const Eigen::JacobiSVD<Mat3> svd(map, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Mat3 rotation = svd.matrixU() * svd.matrixV().transpose();
    const double j = map.determinant();
    ASSERT_LT(j, 1.5);
    const Mat3 stress = 2.0 * kSoft.mu * (map - rotation) + kSoft.lambda * (j - 1.0) * j * map.inverse().transpose();
    Points expected(y.size(), Vec3::Zero()), a;
    for (const ElasticCell& cell : body.cells.cells)
      for (int k = 0; k < 8; ++k) {
        Vec3 sign, gradient;
        for (int axis = 0; axis < 3; ++axis) sign[axis] = k >> axis & 1 ? 1.0 : -1.0;
        for (int axis = 0; axis < 3; ++axis) {
          const int b = (axis + 1) % 3, c = (axis + 2) % 3;
          gradient[axis] = sign[axis] / 8.0 * (1.0 + sign[b] * cell.centroid[b]) * (1.0 + sign[c] * cell.centroid[c]) /
                           body.cells.half_edge;
        }
        const Index i = cell.corners[k];
        expected[i] -= cell.mass / kSoft.density / body.cells.masses[i] * stress * gradient;
      }
    MatchCounters counters;
    std::vector<ClusterPose> poses = body.poses;
    elasticAccelerations(body.cells, kSoft, y, poses, a, counters);
    for (std::size_t i = 0; i < y.size(); ++i) EXPECT_LT((a[i] - expected[i]).norm(), 1e-12 * 10.0 * kScale);
    for (std::size_t c = 0; c < poses.size(); ++c) {
      const ElasticCell& cell = body.cells.cells[c];
      const Vec3 middle = body.rest[cell.corners[0]] + 0.5 * kCellEdge * (Vec3::Ones() + cell.centroid);
      // A copy's own corners lie where the cell's are.
      EXPECT_LT((poses[c].centre - (map * middle + shift)).norm(), 1e-14);
      EXPECT_LT((poses[c].deformation - map).norm(), 1e-12);
      EXPECT_LT((poses[c].rotation.toRotationMatrix() - rotation).norm(), 1e-6);
    }
  }
}

TEST(ElasticCells, PullWithYoungsModulusHoweverThickTheBarIs) {
  // A bar whose outermost cells are filled in part has the area that is filled.
  const double e = 1e-5, nu = 0.4;
  for (double width : {1.0, 0.6, 0.1}) {
    CellBody body = wholeCells(4, 3, 1);
    for (std::size_t c = 8; c < 12; ++c) test::fill({-1, -1, -1}, {1, 2.0 * width - 1.0, 1}, body.cells.cells[c]);
    test::finish(body);
    Points y;
    for (const Vec3& p : body.rest) y.emplace_back((1 + e) * p.x(), (1 - nu * e) * p.y(), (1 - nu * e) * p.z());
    const Points a = accelerations(body, y);
    double pull = 0.0;
    for (std::size_t i = 0; i < y.size(); ++i)
      if (body.rest[i].x() == 0.0) pull += body.cells.masses[i] * a[i].x();
    // The cell's own centroid is clamped at 0.9, and its gradient is the same anywhere.
    const double expected = kSoft.youngs * e * (2.0 + width) * kCellEdge * kCellEdge;
    EXPECT_NEAR(pull, expected, 1e-4 * expected) << width;
  }
}

// A cell of a layer, as thin as a plate across `normal`, with another amount in the other directions.
CellBody layerCell(int normal, double thickness) {
  CellBody body = wholeCells(1, 1, 1);
  ElasticCell& cell = body.cells.cells[0];
  cell.centroid[normal] = 0.3;
  cell.variance[normal] = thickness * thickness / 3.0;
  cell.mass *= thickness;
  return body;
}

// The corners where a map of the place in the cell, from its centroid and in half edges, puts them.
template <class Map>
Points mapped(const CellBody& body, const Map& map) {
  const ElasticCell& cell = body.cells.cells[0];
  Points y = body.rest;
  for (int k = 0; k < 8; ++k) {
    Vec3 at;
    for (int axis = 0; axis < 3; ++axis) at[axis] = (k >> axis & 1 ? 1.0 : -1.0) - cell.centroid[axis];
    y[cell.corners[k]] += map(at);
  }
  return y;
}

TEST(ElasticCells, ThinOnesBendAndTwistAsPlatesDo) {
  const double half = 0.5 * kCellEdge, nu = 0.4;
  for (int normal = 0; normal < 3; ++normal)
    for (double thickness : {1.0, 0.5, 0.1}) {
      const CellBody body = layerCell(normal, thickness);
      const int i = (normal + 1) % 3, j = (normal + 2) % 3;
      const double area = kCellEdge * kCellEdge, t = thickness * kCellEdge;
      const double plate = kSoft.youngs * t * t * t / (12.0 * (1.0 - nu * nu));
      const auto energy = [&](const auto& map) {
        return elasticEnergy(body.cells, kSoft, mapped(body, map), body.poses);
      };
      // In-plane displacement of a curvature, in half edges across the layer: the deflection has no product of its own.
      const double curvature = 1e-3 / half;
      const auto bent = [&](double along_i, double along_j) {
        return [=](const Vec3& at) {
          Vec3 u = Vec3::Zero();
          u[i] = -along_i * curvature * half * half * at[i] * at[normal];
          u[j] = -along_j * curvature * half * half * at[j] * at[normal];
          return u;
        };
      };
      const double one = 0.5 * plate * curvature * curvature * area;
      EXPECT_NEAR(energy(bent(1, 0)), one, 1e-6 * one) << normal << " " << thickness;
      EXPECT_NEAR(energy(bent(0, 1)), one, 1e-6 * one) << normal << " " << thickness;
      EXPECT_NEAR(energy(bent(1, 1)), 2 * (1 + nu) * one, 1e-5 * one) << normal << " " << thickness;
      EXPECT_NEAR(energy(bent(1, -1)), 2 * (1 - nu) * one, 1e-5 * one) << normal << " " << thickness;
      const double twist = 2 * (1 - nu) * one;  // w = c x_i x_j
      EXPECT_NEAR(energy([&](const Vec3& at) {
                    Vec3 u;
                    u[normal] = curvature * half * half * at[i] * at[j];
                    u[i] = -curvature * half * half * at[j] * at[normal];
                    u[j] = -curvature * half * half * at[i] * at[normal];
                    return u;
                  }),
                  twist, 1e-5 * one)
          << normal << " " << thickness;
    }
}

TEST(ElasticCells, NoModeIsWithoutStiffness) {
  Random random(3);
  for (double thickness : {1.0, 0.2}) {
    const CellBody body = layerCell(2, thickness);
    for (int mode : {3, 5, 6, 7})
      for (int trial = 0; trial < 20; ++trial) {
        const Vec3 a = random.vector(1.0).normalized() * 1e-3 * kCellEdge;
        const double energy = elasticEnergy(body.cells, kSoft,
                                            mapped(body,
                                                   [&](const Vec3& at) -> Vec3 {
                                                     double product = 1.0;
                                                     for (int axis = 0; axis < 3; ++axis)
                                                       if (mode >> axis & 1) product *= at[axis];
                                                     return product * a;
                                                   }),
                                            body.poses);
        EXPECT_GT(energy, 0.1 * kSoft.mu * 1e-6 * kCellEdge * kCellEdge * kCellEdge * std::pow(thickness, 3)) << mode;
      }
  }
}

TEST(ElasticCells, AreTheGradientOfTheEnergyAndKeepMomentum) {
  Random random(4);
  for (int trial = 0; trial < 6; ++trial) {
    CellBody body = cutCells(2, 2, 1, 10 + trial);
    if (trial % 3 == 2) body = mixed(body, 7);
    const std::vector<PlasticShape> shapes = someShapes(trial % 2 == 0 ? 0 : body.cells.cells.size(), random);
    const double swelling = trial < 3 ? 1.0 : 0.9;
    const Points y = moved(body, random.rotation().toRotationMatrix(), Vec3::Zero(), 0.0012, random);
    const Points a = accelerations(body, y, swelling, &shapes);
    const Balance balance(body, y, a);
    EXPECT_LT(balance.force.norm(), 1e-12 * balance.scale);
    EXPECT_LT(balance.torque.norm(), 1e-12 * balance.scale * balance.reach);
    for (std::size_t i = 0; i < y.size(); ++i)
      for (int axis = 0; axis < 3; ++axis) {
        const double step = 1e-7;
        Points up = y, down = y;
        up[i][axis] += step;
        down[i][axis] -= step;
        const double slope = (elasticEnergy(body.cells, kSoft, up, body.poses, swelling, &shapes) -
                              elasticEnergy(body.cells, kSoft, down, body.poses, swelling, &shapes)) /
                             (2.0 * step);
        EXPECT_NEAR(-slope, body.cells.masses[i] * a[i][axis], 1e-6 * balance.scale);
      }
  }
}

// By the strain's eigenvalues, as elastic.h has it: over mu, without lambda.
double distortionOf(const Vec3& e, double stiffening, double asymmetry) {
  const Vec3 d = e - Vec3::Constant(e.sum() / 3.0);
  const double m = d.squaredNorm(), a = asymmetry, u = 1.0 / std::sqrt(1.0 + a * a * m / 40.0);
  const double q = e.squaredNorm() - a * d.array().cube().sum() * u + 0.25 * a * a * m * m * u * u;
  const double rate = stiffening / 9.0;
  return q + (rate > 0.0 ? 9.0 * (q - std::log1p(rate * q) / rate) : 0.0);
}

TEST(ElasticCells, StiffenAsTheirLawSays) {
  Random random(41);
  const CellBody body = wholeCells(1, 1, 1);
  const double volume = std::pow(kCellEdge, 3);
  for (const ElasticParameters& soft : stiffening()) {
    ElasticParameters material = elasticParameters(soft.youngs, 0.0, kCellDensity);
    material.stiffening = soft.stiffening;
    material.asymmetry = soft.asymmetry;
    for (const double size : {0.01, 0.1, 0.4, 2.0})
      for (int trial = 0; trial < 10; ++trial) {
        const Vec3 stretch(std::exp(random.uniform(-size, size)), std::exp(random.uniform(-size, size)),
                           std::exp(random.uniform(-size, size)));
        const Mat3 turn = random.rotation().toRotationMatrix(), axes = random.rotation().toRotationMatrix();
        const Mat3 map = turn * axes * stretch.asDiagonal() * axes.transpose();
        const double expected =
            volume * material.mu * distortionOf(stretch - Vec3::Ones(), material.stiffening, material.asymmetry);
        const double found =
            elasticEnergy(body.cells, material, moved(body, map, Vec3::Zero(), 0.0, random), body.poses);
        EXPECT_NEAR(found, expected, 1e-7 * expected + 1e-15) << stretch.transpose();
      }
  }
}

// Tissue gives way nowhere: however it is strained, more strain costs more force.
TEST(ElasticCells, NoStrainMakesWhatStiffensGiveWay) {
  Random random(42);
  for (int trial = 0; trial < 200000; ++trial) {
    const double size = std::pow(10.0, random.uniform(-3.0, 1.0)), step = 1e-3 * size;
    const double asymmetry = random.uniform(-30.0, 30.0), stiffening = std::pow(10.0, random.uniform(-2.0, 3.0));
    Vec3 e = random.vector(size), along = random.vector(1.0).normalized();
    if (trial % 2 == 0) e = size * random.uniform(0.0, 1.0) * Vec3(1.0, -0.5, -0.5) + 0.1 * e;
    if (trial % 4 == 0) e = -e;
    const auto at = [&](double t) { return distortionOf(e + t * along, stiffening, asymmetry); };
    const double middle = at(0.0);
    ASSERT_GT(at(step) - 2.0 * middle + at(-step), 0.2 * step * step - 1e-13 * middle)
        << e.transpose() << ", " << asymmetry;
  }
}

TEST(ElasticCells, WhatStiffensIsTheGradientOfItsEnergyAndKeepsMomentum) {
  Random random(43);
  int trial = 0;
  for (const ElasticParameters& material : stiffening())
    for (const double noise : {2e-4, 1.2e-3, 6e-3}) {
      CellBody body = cutCells(2, 2, 1, 50 + ++trial);
      if (trial % 3 == 2) body = mixed(body, 7);
      const std::vector<PlasticShape> shapes = someShapes(trial % 2 == 0 ? 0 : body.cells.cells.size(), random);
      const Points y = moved(body, random.rotation().toRotationMatrix(), Vec3::Zero(), noise, random);
      std::vector<ClusterPose> poses = body.poses;
      Points a;
      MatchCounters counters;
      elasticAccelerations(body.cells, material, y, poses, a, counters, 0.95, &shapes);
      const Balance balance(body, y, a);
      EXPECT_LT(balance.force.norm(), 1e-12 * balance.scale);
      EXPECT_LT(balance.torque.norm(), 1e-12 * balance.scale * balance.reach);
      for (std::size_t i = 0; i < y.size(); ++i)
        for (int axis = 0; axis < 3; ++axis) {
          const double step = 1e-8;
          Points up = y, down = y;
          up[i][axis] += step;
          down[i][axis] -= step;
          const double slope = (elasticEnergy(body.cells, material, up, poses, 0.95, &shapes) -
                                elasticEnergy(body.cells, material, down, poses, 0.95, &shapes)) /
                               (2.0 * step);
          EXPECT_NEAR(-slope, body.cells.masses[i] * a[i][axis], 1e-5 * balance.scale)
              << material.stiffening << " " << material.asymmetry << " " << noise;
        }
    }
}

TEST(ElasticCells, KeepMomentumWhateverTheMassesAreAndHoweverTheyAreThrown) {
  Random random(5);
  for (double noise : {1e-6, 1e-4, 1e-2, 1.0}) {
    CellBody body = cutCells(4, 3, 3, 3);
    for (double& m : body.cells.masses) m = std::pow(10.0, random.uniform(-5.0, -1.0));
    const Points y = moved(body, random.rotation().toRotationMatrix(), Vec3::Zero(), noise, random);
    const Balance balance(body, y, accelerations(body, y));
    EXPECT_LT(balance.force.norm(), 1e-12 * balance.scale);
    EXPECT_LT(balance.torque.norm(), 1e-12 * balance.scale * balance.reach);
  }
}

TEST(ElasticCells, TurnedInputGivesTurnedOutput) {
  Random random(6);
  const CellBody body = cutCells(3, 3, 2, 4);
  const Points y = moved(body, Mat3::Identity(), Vec3::Zero(), 1e-3, random);
  const Points a = accelerations(body, y);
  for (int trial = 0; trial < 10; ++trial) {
    const Mat3 turn = random.rotation().toRotationMatrix();
    const Vec3 shift = random.vector(0.1);
    Points turned;
    for (const Vec3& p : y) turned.push_back(turn * p + shift);
    const Points b = accelerations(body, turned);
    for (std::size_t i = 0; i < a.size(); ++i) EXPECT_LT((b[i] - turn * a[i]).norm(), 1e-11 * kScale);
  }
}

TEST(ElasticCells, FarFromRestAreTheGradientTooAndStayFinite) {
  Random random(7);
  for (int trial = 0; trial < 60; ++trial) {
    const CellBody body = cutCells(1, 1, 1, 20 + trial);
    const double size = std::pow(10.0, random.uniform(-1.0, 2.0));
    const Mat3 map = random.matrix(size) + Mat3(Vec3(random.uniform(0, 20), 1, 1).asDiagonal());
    const Points y = moved(body, map, Vec3::Zero(), 1e-4, random);
    std::vector<ClusterPose> poses = body.poses;
    Points a;
    MatchCounters counters;
    EXPECT_LT(elasticAccelerations(body.cells, kSoft, y, poses, a, counters), 5.0) << map;
    const double scale = Balance(body, y, a).scale;
    for (std::size_t i = 0; i < y.size(); ++i)
      for (int axis = 0; axis < 3; ++axis) {
        const double step = 1e-8 * size;
        Points up = y, down = y;
        up[i][axis] += step;
        down[i][axis] -= step;
        const double slope =
            (elasticEnergy(body.cells, kSoft, up, poses) - elasticEnergy(body.cells, kSoft, down, poses)) /
            (2.0 * step);
        EXPECT_NEAR(-slope, body.cells.masses[i] * a[i][axis], 1e-4 * scale) << map;
      }
  }
  const CellBody body = cutCells(2, 2, 2, 5);
  for (const Points& y : {Points(body.rest.size(), Vec3::Zero()),
                          moved(body, Mat3(Vec3(1, 0, 0).asDiagonal()), Vec3::Zero(), 0.0, random)})
    for (const Vec3& a : accelerations(body, y)) EXPECT_TRUE(a.allFinite());
}

// By differences of the accelerations at rest, and all eigenvalues.
double frequencyOf(const CellBody& body, const ElasticParameters& material) {
  const Eigen::Index size = static_cast<Eigen::Index>(3 * body.rest.size());
  Eigen::MatrixXd stiffness(size, size);
  const double step = 1e-6 * kCellEdge;
  std::vector<ClusterPose> poses = body.poses;
  MatchCounters counters;
  for (Eigen::Index column = 0; column < size; ++column) {
    Points up = body.rest, down = body.rest, a, b;
    up[column / 3][column % 3] += step;
    down[column / 3][column % 3] -= step;
    elasticAccelerations(body.cells, material, up, poses, a, counters);
    elasticAccelerations(body.cells, material, down, poses, b, counters);
    for (Eigen::Index row = 0; row < size; ++row)
      stiffness(row, column) = -std::sqrt(body.cells.masses[row / 3] / body.cells.masses[column / 3]) *
                               (a[row / 3][row % 3] - b[row / 3][row % 3]) / (2.0 * step);
  }
  const Eigen::MatrixXd symmetric = 0.5 * (stiffness + stiffness.transpose());
  return std::sqrt(
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(symmetric, Eigen::EigenvaluesOnly).eigenvalues()[size - 1]);
}

TEST(HighestFrequencyOfCells, IsTheLargestEigenvalueFromBelow) {
  for (double nu : {0.0, 0.3, 0.45}) {
    const ElasticParameters material = elasticParameters(5000.0, nu, kCellDensity);
    for (const CellBody& body : {wholeCells(1, 1, 1), wholeCells(4, 3, 3), cutCells(3, 3, 2, 1), cutCells(4, 3, 2, 2),
                                 cutCells(4, 2, 2, 3, 0.2), cutCells(1, 1, 1, 4)}) {
      const double exact = frequencyOf(body, material), found = highestFrequency(body.cells, material);
      EXPECT_LT(found, (1.0 + 1e-5) * exact);
      EXPECT_GT(found, 0.99 * exact);
    }
  }
  EXPECT_EQ(highestFrequency(ElasticCells(), kSoft), 0.0);
}

TEST(HighestFrequencyOfCells, NoStepOfOneOverItMakesEnergyGrow) {
  // As body/deform.h steps: a margin of 1.1, the stretch of the last step, accelerations at x + v / frequency.
  Random random(8);
  std::vector<ElasticParameters> materials = stiffening();
  materials.push_back(kSoft);
  for (unsigned seed = 0; seed < 7; ++seed)
    for (double noise : {1e-5, 5e-4, 5e-3}) {
      const ElasticParameters& material = materials[seed];
      const CellBody body = cutCells(4, 3, 2, 30 + seed);
      const double frequency = highestFrequency(body.cells, kSoft);
      Points x = moved(body, Mat3::Identity(), Vec3::Zero(), noise, random), v(x.size(), Vec3::Zero()), a;
      std::vector<ClusterPose> poses = body.poses;
      MatchCounters counters;
      double stretch = elasticAccelerations(body.cells, material, x, poses, a, counters), before = 0.0;
      const double start = elasticEnergy(body.cells, material, x, poses);
      for (int step = 0; step < 300; ++step) {
        const double h = 1.0 / (1.1 * stretch * frequency);
        Points y = x;
        for (std::size_t i = 0; i < x.size(); ++i) y[i] += h * v[i];
        stretch = elasticAccelerations(body.cells, material, y, poses, a, counters);
        double kinetic = 0.0;
        for (std::size_t i = 0; i < x.size(); ++i) {
          v[i] += h * a[i];
          x[i] += h * v[i];
          kinetic += 0.5 * body.cells.masses[i] * v[i].squaredNorm();
        }
        before = kinetic + elasticEnergy(body.cells, material, x, poses);
        ASSERT_LT(before, 1.001 * start) << "seed " << seed << " noise " << noise << " step " << step;
      }
      EXPECT_LT(before, 0.5 * start);
    }
}

// The vectorised step is the plain one, whatever the instructions, the tail of a vector and the shape that the body
// has.
TEST(ElasticCells, InVectorsAreTheReference) {
  Random random(31);
  std::deque<ElasticParameters> materials(1, kSoft);
  for (const ElasticParameters& material : stiffening()) materials.push_back(material);
  std::vector<CellBody> bodies = {wholeCells(3, 2, 2), cutCells(13, 5, 2, 3), mixed(wholeCells(5, 3, 2), 1),
                                  mixed(cutCells(9, 2, 2, 5), 2)};
  for (unsigned n = 1; n <= 17; ++n) bodies.push_back(cutCells(static_cast<int>(n), 1, 1, n));
  for (const CellBody& body : bodies) {
    const ElasticBatch batch(body.cells);
    EXPECT_EQ(batch.others(), 0u);
    for (const double noise : {0.0, 1e-5, 1e-3, 6e-3})
      for (const double swelling : {1.0, 1.1}) {
        materials.push_back(materials.front());
        materials.pop_front();
        const ElasticParameters& material = materials.front();
        const Points y = moved(body, random.rotation().toRotationMatrix(), random.vector(0.1), noise, random);
        std::vector<PlasticShape> shapes;
        if (random.integer(0, 1)) shapes = someShapes(body.cells.cells.size(), random);
        Points expected;
        MatchCounters counted;
        std::vector<ClusterPose> poses = body.poses;
        const double stretch =
            elasticAccelerations(body.cells, material, y, poses, expected, counted, swelling, &shapes);
        double scale = kScale;
        for (const Vec3& a : expected) scale = std::max(scale, a.norm());
        for (const InstructionSet set : {InstructionSet::kBaseline, InstructionSet::kAvx2, InstructionSet::kAvx512}) {
          if (!instructionSetAvailable(set)) continue;
          ElasticBatchState state;
          Points found;
          MatchCounters counters;
          batch.setRotations(body.poses, state);
          batch.setUnstressed(shapes, state);
          EXPECT_NEAR(batch.accelerate({body.rest, body.cells.masses, {}, {}}, material, y, state, found, counters,
                                       swelling, set),
                      stretch, 1e-9 * stretch);
          ASSERT_EQ(found.size(), expected.size());
          for (std::size_t i = 0; i < y.size(); ++i) EXPECT_LE((found[i] - expected[i]).norm(), 1e-9 * scale);
          const Balance balance(body, y, found);
          EXPECT_LT(balance.force.norm(), 1e-12 * (balance.scale + body.cells.masses[0] * kScale));
          EXPECT_LT(balance.torque.norm(), 1e-12 * (balance.scale + body.cells.masses[0] * kScale) * balance.reach);
          EXPECT_EQ(counters.rotations, counted.rotations);
        }
      }
  }
  EXPECT_EQ(ElasticBatch(wholeCells(3, 2, 2).cells).whole(), 12u);
  EXPECT_LT(ElasticBatch(cutCells(3, 2, 2, 1).cells).whole(), 12u);
}

}  // namespace elastic_cells_test
}  // namespace meshless
