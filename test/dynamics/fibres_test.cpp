// Fibres in cells: they pull where they are longer than at rest, and never push.
#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/dynamics/elastic_batch.h"
#include "support/cells.h"

namespace meshless {
namespace fibres_test {

using test::CellBody;
using test::cutCells;
using test::kCellDensity;
using test::Random;
using test::wholeCells;

ElasticParameters fibrous(double stiffness, double stiffening = 0.0) {
  ElasticParameters material = elasticParameters(5000.0, 0.4, kCellDensity);
  material.fibres = stiffness;
  material.fibre_stiffening = stiffening;
  return material;
}

CellBody along(CellBody body, Random& random) {
  for (ElasticCell& cell : body.cells.cells) cell.fibre = random.rotation() * Vec3::UnitX();
  return body;
}

Points moved(const CellBody& body, const Mat3& map, double noise, Random& random) {
  Points y;
  for (const Vec3& p : body.rest) y.push_back(map * (p + random.vector(noise)));
  return y;
}

TEST(Fibres, AddTheirPullAlongThemAndNoneWhereTheyAreSlack) {
  Random random(1);
  for (int trial = 0; trial < 20; ++trial) {
    const CellBody body = along(wholeCells(1, 1, 1), random);
    const Vec3 a = body.cells.cells[0].fibre;
    const Mat3 map = random.rotation().toRotationMatrix() * (Mat3::Identity() + random.matrix(0.3));
    const Points y = moved(body, map, 0.0, random);
    std::vector<ClusterPose> poses = body.poses;
    const Mat3 with = cellStresses(body.cells, fibrous(2e4), y, poses)[0];
    const Mat3 without = cellStresses(body.cells, fibrous(0.0), y, poses)[0];
    const double length = (map * a).norm(), pull = length > 1.0 ? 2e4 * (length - 1.0) : 0.0;
    EXPECT_LT((with - without - pull / length * map * a * a.transpose()).norm(), 1e-6 * 2e4);
  }
}

// b q W' as tissue's: ten times at most.
TEST(Fibres, StiffenToTenTimesAtMost) {
  Random random(2);
  CellBody body = wholeCells(1, 1, 1);
  body.cells.cells[0].fibre = Vec3::UnitX();
  for (const double stretch : {1.001, 1.2, 2.0, 30.0}) {
    const Points y = moved(body, Vec3(stretch, 1.0, 1.0).asDiagonal(), 0.0, random);
    std::vector<ClusterPose> poses = body.poses;
    const double pull = cellStresses(body.cells, fibrous(2e4, 40.0), y, poses)[0](0, 0) -
                        cellStresses(body.cells, fibrous(0.0), y, poses)[0](0, 0);
    const double q = std::pow(stretch - 1.0, 2), slope = 1.0 + 40.0 * q / (1.0 + 40.0 * q / 9.0);
    EXPECT_NEAR(pull, 2e4 * (stretch - 1.0) * slope, 1e-9 * pull);
    EXPECT_LE(pull, 2e5 * (stretch - 1.0));
  }
}

TEST(Fibres, AreTheGradientOfTheirEnergyAndTheVectorisedStepIsTheReference) {
  Random random(3);
  for (unsigned seed = 1; seed <= 12; ++seed) {
    CellBody body = along(seed % 2 ? cutCells(3, 2, 1, seed) : wholeCells(3, 2, 2), random);
    if (seed % 3 == 0) body = test::mixed(body, seed);
    if (seed % 4 == 0) body.cells.cells[1].fibre.setZero();  // this one has none
    const ElasticParameters material = fibrous(3e4, seed % 5 ? 20.0 : 0.0);
    const double swelling = seed % 2 ? 1.0 : 1.1;
    const Points y = moved(body, random.rotation().toRotationMatrix(), 2e-3, random);
    Points expected;
    MatchCounters counters;
    std::vector<ClusterPose> poses = body.poses;
    const double stretch = elasticAccelerations(body.cells, material, y, poses, expected, counters, swelling);
    Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
    double scale = 0.0;
    for (std::size_t i = 0; i < y.size(); ++i) {
      force += body.cells.masses[i] * expected[i];
      torque += body.cells.masses[i] * y[i].cross(expected[i]);
      scale += body.cells.masses[i] * expected[i].norm();
    }
    EXPECT_LT(force.norm(), 1e-12 * scale);
    EXPECT_LT(torque.norm(), 1e-12 * scale);
    for (std::size_t i = 0; i < y.size(); ++i)
      for (int axis = 0; axis < 3; ++axis) {
        Points up = y, down = y;
        up[i][axis] += 1e-7;
        down[i][axis] -= 1e-7;
        const double slope = (elasticEnergy(body.cells, material, up, body.poses, swelling) -
                              elasticEnergy(body.cells, material, down, body.poses, swelling)) /
                             2e-7;
        EXPECT_NEAR(-slope, body.cells.masses[i] * expected[i][axis], 1e-6 * scale);
      }
    const ElasticBatch batch(body.cells);
    for (const InstructionSet set : {InstructionSet::kBaseline, InstructionSet::kAvx2, InstructionSet::kAvx512}) {
      if (!instructionSetAvailable(set)) continue;
      ElasticBatchState state;
      Points found;
      batch.setRotations(body.poses, state);
      EXPECT_NEAR(
          batch.accelerate({body.rest, body.cells.masses, {}, {}}, material, y, state, found, counters, swelling, set),
          stretch, 1e-9 * stretch);
      for (std::size_t i = 0; i < y.size(); ++i)
        EXPECT_LE((found[i] - expected[i]).norm(), 1e-9 * scale / body.cells.masses[i]);
    }
  }
}

// The longest step that the frequency at rest and the stretch allow is stable, however far fibres are drawn.
TEST(Fibres, NoStepOfTheirFrequencyMakesEnergyGrow) {
  Random random(4);
  for (const double stiffening : {0.0, 1000.0})
    for (const double drawn : {1.0, 1.5, 4.0}) {
      const CellBody body = along(wholeCells(3, 3, 3), random);
      const ElasticParameters material = fibrous(1e6, stiffening);
      const double frequency = highestFrequency(body.cells, material);
      Points x = moved(body, Vec3(drawn, 1.0, 1.0 / drawn).asDiagonal(), 1e-4, random), v(x.size(), Vec3::Zero());
      std::vector<ClusterPose> poses = body.poses;
      const auto energy = [&] {
        double kinetic = 0.0;
        for (std::size_t i = 0; i < x.size(); ++i) kinetic += 0.5 * body.cells.masses[i] * v[i].squaredNorm();
        return kinetic + elasticEnergy(body.cells, material, x, poses);
      };
      const double begin = energy();
      double stretch = 20.0;
      for (int step = 0; step < 3000; ++step) {
        const double h = 1.4 / (1.1 * stretch * frequency);
        Points y = x, a;
        for (std::size_t i = 0; i < x.size(); ++i) y[i] += 0.25 * h * v[i];
        MatchCounters counters;
        stretch = elasticAccelerations(body.cells, material, y, poses, a, counters);
        for (std::size_t i = 0; i < x.size(); ++i) {
          v[i] += h * a[i];
          x[i] += h * v[i];
        }
      }
      EXPECT_LT(energy(), begin) << stiffening << " " << drawn;
    }
}

}  // namespace fibres_test
}  // namespace meshless
