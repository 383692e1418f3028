// Stress that fades: a Prony series on what a cell's strain costs without change of volume.
#include <cmath>
#include <complex>

#include <gtest/gtest.h>

#include "meshless_surgery/dynamics/elastic_batch.h"
#include "support/cells.h"

namespace meshless {
namespace relaxation_test {

using test::CellBody;
using test::cutCells;
using test::kCellDensity;
using test::kCellEdge;
using test::Random;
using test::wholeCells;

const std::vector<Relaxation> kSeries = {{0.3, 0.02}, {0.2, 0.5}, {0.15, 20.0}};
const ElasticParameters kSoft = elasticParameters(5000.0, 0.4, kCellDensity);

ElasticParameters relaxing(const std::vector<Relaxation>& series, double h, double asymmetry = 0.0) {
  ElasticParameters material = kSoft;
  material.asymmetry = asymmetry;
  material.relaxation = relaxationStep(series, h);
  return material;
}

// A whole cell that is sheared step by step, by the vectorised kernel; its shear stress.
class Sheared {
 public:
  Sheared(const std::vector<Relaxation>& series, double h)
      : body_(wholeCells(1, 1, 1)), batch_(body_.cells), material_(relaxing(series, h)) {
    batch_.setRotations(body_.poses, state_);
    batch_.setRelaxed(std::vector<RelaxedStrain>(1), material_.relaxation.branches, state_);
  }
  double step(double shear) {
    Mat3 f = Mat3::Identity();
    f(0, 1) = shear;
    Points y, a;
    for (const Vec3& p : body_.rest) y.push_back(f * p);
    MatchCounters counters;
    batch_.accelerate({body_.rest, body_.cells.masses, {}, {}}, material_, y, state_, a, counters);
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) sum -= body_.cells.masses[i] * a[i].x() * body_.rest[i].y();
    return sum / std::pow(kCellEdge, 3);
  }

 private:
  CellBody body_;
  ElasticBatch batch_;
  ElasticParameters material_;
  ElasticBatchState state_;
};

constexpr double kShear = 1e-4;

TEST(Relaxation, StressAfterARampFallsAsTheSeriesSays) {
  for (const double time : {0.01, 0.1, 1.0, 10.0, 100.0}) {
    const std::vector<Relaxation> series = {{0.6, time}};
    const double h = 1.0 / 3840.0, ramp = 0.5 * time;  // [s] as substeps of a liver are
    Sheared cell(series, h);
    for (double t = h; t < 4.0 * time; t += h) {
      const double stress = cell.step(kShear * std::min(1.0, t / ramp));
      if (t <= ramp) continue;
      const double at_end = kShear / ramp * (ramp - time * (1.0 - std::exp(-ramp / time)));
      const double taken = kShear - (kShear - at_end) * std::exp(-(t - ramp) / time);
      const double expected = kSoft.mu * (kShear - 0.6 * taken);
      ASSERT_NEAR(stress, expected, 0.01 * expected) << "time " << time << " at " << t;
    }
  }
}

TEST(Relaxation, ModuliByFrequencyAreThoseOfTheSeries) {
  constexpr double h = 1.0 / 1920.0;
  for (const double frequency : {0.05, 0.3, 1.0, 5.0, 20.0}) {
    const double omega = 2.0 * M_PI * frequency;
    std::complex<double> expected = kSoft.mu;
    for (const Relaxation& branch : kSeries)
      expected -= kSoft.mu * branch.share / (1.0 + std::complex<double>(0.0, omega * branch.time));
    Sheared cell(kSeries, h);
    // After the slowest branch has come to swing too.
    const double from = 100.0, periods = std::max(1.0, std::round(frequency * 5.0)), until = from + periods / frequency;
    double in_phase = 0.0, out_of_phase = 0.0, count = 0.0;
    for (double t = 0.0; t < until; t += h) {
      const double stress = cell.step(kShear * std::sin(omega * t));
      if (t < from) continue;
      in_phase += stress * std::sin(omega * t);
      out_of_phase += stress * std::cos(omega * t);
      count += 1.0;
    }
    const double storage = 2.0 * in_phase / (count * kShear), loss = 2.0 * out_of_phase / (count * kShear);
    EXPECT_NEAR(storage, expected.real(), 0.03 * expected.real()) << frequency;
    EXPECT_NEAR(loss, expected.imag(), 0.03 * expected.imag() + 0.003 * expected.real()) << frequency;
  }
}

Points moved(const CellBody& body, double noise, Random& random) {
  const Quat turn = random.rotation();
  Points y;
  for (const Vec3& p : body.rest) y.push_back(turn * (p + random.vector(noise)));
  return y;
}

TEST(Relaxation, TheVectorisedStepIsTheReferenceAndTheGradientOfTheEnergy) {
  Random random(61);
  for (const double asymmetry : {0.0, 10.0})
    for (unsigned seed = 1; seed <= 9; ++seed) {
      const CellBody body = seed % 3 == 0 ? test::mixed(cutCells(3, 2, 2, seed), seed) : cutCells(3, 2, 1, seed);
      const ElasticParameters material = relaxing(kSeries, 0.003, asymmetry);
      const ElasticBatch batch(body.cells);
      for (const InstructionSet set : {InstructionSet::kBaseline, InstructionSet::kAvx2, InstructionSet::kAvx512}) {
        if (!instructionSetAvailable(set)) continue;
        ElasticBatchState state;
        batch.setRotations(body.poses, state);
        std::vector<ClusterPose> poses = body.poses;
        std::vector<RelaxedStrain> expected(body.cells.cells.size()), found(body.cells.cells.size());
        batch.setRelaxed(expected, material.relaxation.branches, state);
        Points y, a, b;
        for (int step = 0; step < 5; ++step) {
          y = moved(body, 1e-3, random);
          MatchCounters counters;
          elasticAccelerations(body.cells, material, y, poses, a, counters, 1.0, nullptr, &expected);
          batch.accelerate({body.rest, body.cells.masses, {}, {}}, material, y, state, b, counters, 1.0, set);
          for (std::size_t i = 0; i < y.size(); ++i) ASSERT_LT((a[i] - b[i]).norm(), 1e-9 * (1.0 + a[i].norm()));
        }
        batch.getRelaxed(state, found);
        for (std::size_t c = 0; c < found.size(); ++c)
          for (std::size_t k = 0; k < kSeries.size(); ++k)
            for (std::size_t n = 0; n < 6; ++n) EXPECT_NEAR(found[c].of[k][n], expected[c].of[k][n], 1e-12);
        double scale = 0.0;
        for (std::size_t i = 0; i < y.size(); ++i) scale += body.cells.masses[i] * a[i].norm();
        for (std::size_t i = 0; i < y.size(); i += 3)
          for (int axis = 0; axis < 3; ++axis) {
            Points up = y, down = y;
            up[i][axis] += 1e-8;
            down[i][axis] -= 1e-8;
            const double slope = (elasticEnergy(body.cells, material, up, poses, 1.0, nullptr, &expected) -
                                  elasticEnergy(body.cells, material, down, poses, 1.0, nullptr, &expected)) /
                                 2e-8;
            EXPECT_NEAR(-slope, body.cells.masses[i] * a[i][axis], 1e-5 * scale);
          }
      }
    }
}

// As body/deform.h steps: the longest substep, stress a quarter of it ahead.
struct Swinging {
  const CellBody& body;
  double time, asymmetry;
  Points x, v;
  std::vector<ClusterPose> poses;
  std::vector<RelaxedStrain> relaxed;
  double stretch = 1.0;

  Swinging(const CellBody& of, double branch, double more, Points start)
      : body(of),
        time(branch),
        asymmetry(more),
        x(std::move(start)),
        v(x.size(), Vec3::Zero()),
        poses(of.poses),
        relaxed(of.cells.cells.size()) {}
  void step(double frequency) {
    const double h = 1.4 / (1.1 * stretch * frequency);
    const ElasticParameters material = relaxing({{0.9, time}}, h, asymmetry);
    Points y = x, a;
    for (std::size_t i = 0; i < x.size(); ++i) y[i] += 0.25 * h * v[i];
    MatchCounters counters;
    stretch = elasticAccelerations(body.cells, material, y, poses, a, counters, 1.0, nullptr, &relaxed);
    for (std::size_t i = 0; i < x.size(); ++i) {
      v[i] += h * a[i];
      x[i] += h * v[i];
    }
  }
  double energy() const {
    double kinetic = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) kinetic += 0.5 * body.cells.masses[i] * v[i].squaredNorm();
    return kinetic +
           elasticEnergy(body.cells, relaxing({{0.9, time}}, 1.0, asymmetry), x, poses, 1.0, nullptr, &relaxed);
  }
};

// What swings loses energy at any time constant, from far below the step to far above.
TEST(Relaxation, EnergyNeverGrows) {
  Random random(62);
  const CellBody body = cutCells(4, 3, 2, 70);
  const double frequency = highestFrequency(body.cells, kSoft);
  for (const double time : {1e-4, 1e-3, 1e-2, 1.0, 1e3})
    for (const double asymmetry : {0.0, 12.0}) {
      Swinging swing(body, time, asymmetry, moved(body, 1e-3, random));
      const double start = swing.energy();
      for (int step = 0; step < 400; ++step) {
        swing.step(frequency);
        // Velocities are half a step behind positions: one step counts up to twice the energy.
        ASSERT_LT(swing.energy(), (step < 20 ? 2.0 : 1.0) * start) << "time " << time << " step " << step;
      }
      EXPECT_LT(swing.energy(), 0.7 * start);
    }
}

// Tissue that was held torn, crushed or inside out until it had relaxed comes back and does not throw itself apart.
TEST(Relaxation, WhatWasHeldTornOrInsideOutCalmsDown) {
  Random random(63);
  const CellBody body = wholeCells(2, 2, 2);
  const double frequency = highestFrequency(body.cells, kSoft);
  for (int trial = 0; trial < 60; ++trial) {
    const Mat3 map = random.matrix(trial % 2 == 0 ? 8.0 : 1.5);
    Swinging swing(body, 30.0 / frequency, trial % 3 == 0 ? 10.0 : 0.0, body.rest);
    for (Vec3& p : swing.x) p = map * p;
    const Points held = swing.x;
    for (int step = 0; step < 300; ++step) {
      swing.step(frequency);
      swing.x = held;
      for (Vec3& v : swing.v) v.setZero();
    }
    if (trial % 4 < 2) swing.x = moved(body, 1e-4, random);  // put back at once
    const double start = swing.energy();
    double most = 0.0;
    for (int step = 0; step < 3000; ++step) {
      swing.step(frequency);
      most = std::max(most, swing.energy());
    }
    EXPECT_LT(most, 3.0 * start) << trial;
    EXPECT_LT(swing.energy(), 0.6 * start) << trial;
  }
}

}  // namespace relaxation_test
}  // namespace meshless
