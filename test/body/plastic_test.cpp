#include "meshless_surgery/dynamics/plastic.h"

#include <cmath>

#include <Eigen/SVD>

#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/body/deform.h"
#include "support/bodies.h"
#include "support/random.h"

namespace meshless {
namespace plastic_test {

using test::prepared;
using test::Random;

PreparedBody dough(bool elastic, MatchMode mode = MatchMode::kLinear) {
  BodyDef def = test::block("dough", Vec3::Zero());
  def.material.mode = mode;
  def.material.alpha = 0.5;
  def.material.damping = 20.0;
  def.material.plasticity = {0.1, 10.0, 0.6};
  if (elastic) {
    def.material.youngs_modulus = 5000.0;
    def.spacing = 0.025;
  }
  return prepared(def);
}

// A stretch of x by s that keeps the volume.
Points drawnOut(const Points& rest, double s) {
  Points x;
  for (const Vec3& p : rest) x.emplace_back(s * p.x(), p.y() / std::sqrt(s), p.z() / std::sqrt(s));
  return x;
}

double strainOf(double s) { return Vec3(s - 1.0, 1.0 / std::sqrt(s) - 1.0, 1.0 / std::sqrt(s) - 1.0).norm(); }

// Of what a shape does not take up of its cluster's deformation.
double strainLeft(const BodyState& state, std::size_t c) {
  const Mat3 f = state.poses[c].deformation * state.plastic[c].inverse;
  return (Eigen::JacobiSVD<Mat3>(f).singularValues() / std::cbrt(f.determinant()) - Vec3::Ones()).norm();
}

double strainOf(const Mat3& stretch) { return (stretch - Mat3::Identity()).norm(); }

void run(PreparedBody& body, int steps, double h) {
  StepScratch scratch;
  MatchCounters counters;
  for (int step = 0; step < steps; ++step) {
    matchAndMove(*body.model, body.def.material, Vec3::Zero(), h, body.state, scratch, counters);
    velocitiesFromPositions(h, body.state, scratch);
  }
}

double lengthOf(const Points& x) {
  double low = 1e9, high = -1e9;
  for (const Vec3& p : x) low = std::min(low, p.x()), high = std::max(high, p.x());
  return high - low;
}

TEST(Flow, StrainBeyondTheYieldDecaysAtItsRateWhateverTheStep) {
  PreparedBody body = dough(false);
  const double start = 1.5;
  const Points held = drawnOut(body.model->rest, start);
  for (double h : {1.0 / 960, 1.0 / 120, 1.0 / 30}) {
    BodyState state = body.state;
    fitClusters(matchInput(*body.model), held, state.poses);
    const int steps = static_cast<int>(std::lround(0.1 / h));
    for (int step = 0; step < steps; ++step) {
      flow(body.def.material.plasticity, h, &body.model->shape, state.poses, state.plastic);
      fitClusters(matchInput(*body.model, state), held, state.poses);
    }
    const double left = strainLeft(state, 0);
    const double expected = 0.1 + (strainOf(start) - 0.1) * std::exp(-10.0 * 0.1);
    EXPECT_NEAR(left, expected, 1e-6) << "h " << h;
  }
}

TEST(Flow, EndsAtTheYieldAndNeverBelowEvenInOneHugeStep) {
  PreparedBody body = dough(false);
  BodyState state = body.state;
  fitClusters(matchInput(*body.model), drawnOut(body.model->rest, 1.4), state.poses);
  Plasticity plasticity{0.1, 1e6, 3.0};
  for (int step = 0; step < 20; ++step) {
    flow(plasticity, 1.0, &body.model->shape, state.poses, state.plastic);
    for (std::size_t c = 0; c < state.plastic.size(); ++c) EXPECT_GE(strainLeft(state, c), 0.1 - 1e-6);
  }
  for (std::size_t c = 0; c < state.plastic.size(); ++c) EXPECT_NEAR(strainLeft(state, c), 0.1, 1e-6);
}

TEST(Flow, KeepsTheVolumeAndTheMaximum) {
  Random random(3);
  PreparedBody body = dough(false);
  BodyState state = body.state;
  const Plasticity plasticity{0.02, 50.0, 0.4};
  for (int step = 0; step < 200; ++step) {
    Mat3 f = Mat3::Identity();
    for (int k = 0; k < 9; ++k) f(k) += random.uniform(-0.6, 0.6);
    if (f.determinant() < 0.0) f.col(0) *= -1.0;
    Points y;
    for (const Vec3& p : body.model->rest) y.push_back(f * p);
    fitClusters(matchInput(*body.model, state), y, state.poses);
    flow(plasticity, 0.02, &body.model->shape, state.poses, state.plastic);
    for (const PlasticShape& shape : state.plastic) {
      EXPECT_NEAR(shape.stretch.determinant(), 1.0, 1e-9);
      EXPECT_LE(strainOf(shape.stretch), 0.4 + 1e-9);
      EXPECT_LT((shape.stretch * shape.inverse - Mat3::Identity()).norm(), 1e-9);
      EXPECT_LT((shape.stretch - shape.stretch.transpose()).norm(), 1e-12);
    }
  }
}

TEST(Flow, BelowTheYieldNothingChangesToTheBit) {
  for (bool elastic : {false, true}) {
    PreparedBody body = dough(elastic), plain = dough(elastic);
    body.def.material.plasticity.yield = 9.0;
    plain.def.material.plasticity = {9.0, 1e-300, 0.5};  // the same path, without any flow
    body.state.positions = plain.state.positions = drawnOut(body.model->rest, 1.3);
    run(body, 60, 1.0 / 240);
    run(plain, 60, 1.0 / 240);
    EXPECT_TRUE(body.state.plastic.empty() && body.state.plastic_cells.empty());
    for (std::size_t i = 0; i < body.state.positions.size(); ++i)
      EXPECT_EQ(body.state.positions[i], plain.state.positions[i]);
  }
}

TEST(Flow, KeepsAShapeAfterRelease) {
  for (bool elastic : {false, true})
    for (MatchMode mode : {MatchMode::kRigid, MatchMode::kLinear, MatchMode::kQuadratic}) {
      if (elastic && mode != MatchMode::kLinear) continue;
      PreparedBody body = dough(elastic, mode);
      const double rest = lengthOf(body.model->rest);
      const Points held = drawnOut(body.model->rest, 1.4);
      for (int step = 0; step < 400; ++step) {  // held for 0.8 s
        body.state.positions = held;
        for (Vec3& v : body.state.velocities) v.setZero();
        run(body, 1, 1.0 / 500);
      }
      ASSERT_FALSE(body.state.plastic_cells.empty());
      run(body, 4000, 1.0 / 500);
      const double kept = lengthOf(body.state.positions) / rest;
      // What has not flowed springs back: the yield's strain and what the rate has left of the rest.
      const double back = strainOf(1.4 / kept), left = 0.1 + (strainOf(1.4) - 0.1) * std::exp(-10.0 * 0.8);
      EXPECT_NEAR(back, left, elastic ? 4e-5 : 3e-3)
          << elastic << toString(mode);  // 8.2e-6, 1.5e-3: cells against goals
      updateSurface(*body.model, body.state);
      const double volume = measureBody(*body.model, body.state).volume / body.model->rest_volume;
      EXPECT_NEAR(volume, 1.0, elastic ? 3e-13 : 3e-4);                       // 6.4e-14, 9e-5
      EXPECT_LT(measureBody(*body.model, body.state).kinetic_energy, 1e-22);  // [J] rounding: 1.3e-26
    }
}

TEST(Flow, LeavesMomentumAndTakesNoEnergyIn) {
  Random random(5);
  for (bool elastic : {false, true}) {
    PreparedBody body = dough(elastic);
    body.def.material.damping = 0.0;
    body.def.material.plasticity.yield = 0.01;
    for (std::size_t i = 0; i < body.state.positions.size(); ++i) {
      body.state.positions[i].x() *= 1.3;
      body.state.velocities[i] = Vec3(1, 2, 3).cross(body.state.positions[i]) + random.vector(0.02);
    }
    updateSurface(*body.model, body.state);
    const ElasticParameters material = elasticParameters(5000.0, body.def.material.poissons_ratio, 1000.0);
    const auto energy = [&] {  // of looks without the stretch's, which has no measure
      const double moving = measureBody(*body.model, body.state).kinetic_energy;
      if (!elastic) return moving;
      return moving + elasticEnergy(*body.model->cells, material, body.state.positions, body.state.cells, 1.0,
                                    &body.state.plastic_cells);
    };
    const BodyMeasures before = measureBody(*body.model, body.state);
    const double energy_before = energy(), movement = std::sqrt(2.0 * body.model->mass * before.kinetic_energy);
    run(body, 2000, 1.0 / 1000);
    ASSERT_FALSE(body.state.plastic_cells.empty());
    updateSurface(*body.model, body.state);
    const BodyMeasures after = measureBody(*body.model, body.state);
    // Worst of 20 seeds: 2.2e-13, 9.2e-14, 0.054 of elastic tissue's energy, 1.30 of that of looks.
    EXPECT_LT((after.linear_momentum - before.linear_momentum).norm(), 1e-12 * movement);
    EXPECT_LT((after.angular_momentum - before.angular_momentum).norm(), 4.5e-13 * before.angular_momentum.norm());
    EXPECT_LT(energy(), (elastic ? 0.07 : 1.5) * energy_before);
  }
}

TEST(Flow, ForcesAreTheGradientOfTheEnergyOfTheNewShape) {
  Random random(7);
  PreparedBody body = dough(true);
  for (std::size_t c = 0; c < body.model->cells->cells.size(); ++c) {
    Mat3 l = Mat3::Zero();
    for (int k = 0; k < 9; ++k) l(k) = random.uniform(-0.2, 0.2);
    l = Mat3(0.5 * (l + l.transpose()));
    body.state.plastic_cells.push_back(plasticShape(l - l.trace() / 3.0 * Mat3::Identity()));
  }
  const ElasticCells& cells = *body.model->cells;
  const std::vector<PlasticShape>* shapes = &body.state.plastic_cells;
  const ElasticParameters material = elasticParameters(5000.0, 0.45, 1000.0);
  Points y = body.model->rest;
  for (Vec3& p : y) p += random.vector(0.002);
  Points a;
  MatchCounters counters;
  elasticAccelerations(cells, material, y, body.state.cells, a, counters, 1.0, shapes);
  const double step = 1e-7;
  for (Index i = 0; i < y.size(); i += 7)
    for (int axis = 0; axis < 3; ++axis) {
      Points there = y;
      there[i][axis] += step;
      const double up = elasticEnergy(cells, material, there, body.state.cells, 1.0, shapes);
      there[i][axis] -= 2.0 * step;
      const double down = elasticEnergy(cells, material, there, body.state.cells, 1.0, shapes);
      const double force = -(up - down) / (2.0 * step);
      EXPECT_NEAR(body.model->masses[i] * a[i][axis], force, 1e-4 * (1.0 + std::abs(force)));
    }
}

TEST(Flow, FlatAndInvertedClustersKeepTheirShape) {
  PreparedBody body = dough(false);
  BodyState state = body.state;
  Points y = body.model->rest;
  for (Vec3& p : y) p.z() = 0.0;
  fitClusters(matchInput(*body.model), y, state.poses);
  EXPECT_EQ(flow({0.01, 10.0, 1.0}, 0.1, &body.model->shape, state.poses, state.plastic), 0u);
  for (std::size_t i = 0; i < y.size(); ++i) y[i] = -1.5 * body.model->rest[i];
  fitClusters(matchInput(*body.model), y, state.poses);
  EXPECT_EQ(flow({0.01, 10.0, 1.0}, 0.1, &body.model->shape, state.poses, state.plastic), 0u);
  EXPECT_TRUE(state.plastic.empty());
}

TEST(Flow, PiecesOfACutKeepTheirShape) {
  for (bool elastic : {false, true}) {
    PreparedBody body = dough(elastic);
    const Points held = drawnOut(body.model->rest, 1.4);
    for (int step = 0; step < 400; ++step) {
      body.state.positions = held;
      for (Vec3& v : body.state.velocities) v.setZero();
      run(body, 1, 1.0 / 500);
    }
    run(body, 4000, 1.0 / 500);
    updateSurface(*body.model, body.state);
    const Result<CutBody> cut =
        cutBody(*body.model, body.state, Blade::through(Plane{Vec3(1, 0.1, 0).normalized(), Vec3(0.013, 0, 0)}));
    ASSERT_TRUE(cut.ok());
    for (const BodyPiece& from : cut->pieces) {
      PreparedBody piece;
      piece.def = body.def;
      piece.model = from.model;
      piece.state = from.state;
      ASSERT_EQ(piece.state.plastic.size(), piece.model->clusters.size());
      ASSERT_EQ(piece.state.plastic_cells.size(), piece.model->cells->cells.size());
      const double length = lengthOf(piece.state.positions);
      run(piece, 1000, 1.0 / 500);
      EXPECT_NEAR(lengthOf(piece.state.positions), length, (elastic ? 2e-6 : 5e-4) * length);  // 4.6e-7, 1.9e-4
    }
  }
}

}  // namespace plastic_test
}  // namespace meshless
