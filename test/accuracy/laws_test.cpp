// The laws that the deformer keeps, with the bounds that docs/accuracy.md promises.
#include "laws.h"

#include <gtest/gtest.h>

namespace meshless::bench {
namespace {

constexpr double kRates[] = {60.0, 120.0, 240.0, 480.0, 960.0};  // [1/s]

TEST(Patch, FieldsOfTheModeAreReproduced) {
  for (const Kind& kind : kinds()) {
    if (kind.elastic) continue;
    for (double scale : {1e-6, 1.0, 1e6}) {
      EXPECT_LT(patchError(kind, false, scale, 0.0), 1e-12) << kind.name << " scale " << scale;
      if (runsInFloat(kind)) EXPECT_LT(patchError(kind, true, scale, 0.0), 1e-5) << kind.name << " scale " << scale;
    }
    // 1 km away a double holds 1e-13 of a metre.
    EXPECT_LT(patchError(kind, false, 1.0, 1000.0), 1e-12) << kind.name;
    if (runsInFloat(kind)) EXPECT_LT(patchError(kind, true, 1.0, 1000.0), 1e-5) << kind.name;
  }
}

TEST(Momentum, DriftsByRoundingAlone) {
  for (const Kind& kind : kinds()) {
    const Drift drift = momentumDrift(kind, false, 10000);
    EXPECT_LT(drift.linear, 1e-12) << kind.name;
    EXPECT_LT(drift.angular, 1e-12) << kind.name;
    EXPECT_LT(drift.energy, 1e-9) << kind.name;
    if (!runsInFloat(kind)) continue;
    const Drift in_float = momentumDrift(kind, true, 10000);
    EXPECT_LT(in_float.linear, 1e-6) << kind.name;
    EXPECT_LT(in_float.angular, 1e-6) << kind.name;
  }
}

TEST(Spin, ConvergesToEulersEquationsAndKeepsTheMomentum) {
  for (const Kind& kind : kinds())
    for (bool tumbling : {false, true}) {
      std::vector<double> steps, errors;
      for (double rate : kRates) {
        steps.push_back(1.0 / rate);
        errors.push_back(spinError(kind, tumbling, 1.0 / rate, 2.0));
      }
      if (kind.elastic) {  // substeps of its own: what is left is that it stretches
        for (double error : errors) EXPECT_LT(error, 1e-3) << kind.name;
      } else {
        if (kind.clusters > 1) {  // cells take substeps of 1/240 s themselves
          steps.erase(steps.begin(), steps.begin() + 2);
          errors.erase(errors.begin(), errors.begin() + 2);
        }
        EXPECT_GT(fittedOrder(steps, errors), kind.clusters > 1 ? 1.7 : 1.8) << kind.name;
        EXPECT_LT(errors.back(), kind.clusters == 1 ? 2e-4 : 5e-3) << kind.name;
      }
    }
}

TEST(Spin, TenSecondsKeepTheAngularMomentum) {
  for (const Kind& kind : kinds()) EXPECT_LT(spinLoss(kind, 1.0 / 60.0, 10.0), 1e-12) << kind.name;
}

TEST(Steps, RingingAndDecayAreTheSameAtAnyStep) {
  for (const Kind& kind : kinds()) {
    const Ringing finest = ringing(kind, 1920.0);
    ASSERT_GE(finest.half_waves, 4) << kind.name;
    for (double rate : kRates) {
      const Ringing here = ringing(kind, rate);
      EXPECT_NEAR(here.frequency, finest.frequency, 0.01 * finest.frequency) << kind.name << " at " << rate;
      EXPECT_NEAR(here.decay, finest.decay, 0.05 * finest.decay) << kind.name << " at " << rate;
    }
  }
}

// As docs/reference/materials.md says of `damping`: speed decays at it, an amplitude at half of it, beside what decays
// without.
TEST(Steps, AnAmplitudeDecaysAtHalfOfTheDamping) {
  for (const Kind& kind : kinds())
    EXPECT_NEAR(ringing(kind, 960.0, 1.8).decay - ringing(kind, 960.0, 0.8).decay, 0.5, 0.05) << kind.name;
}

TEST(Steps, SagIsTheSameAtAnyStep) {
  for (const Kind& kind : kinds()) {
    const double finest = sag(kind, 1920.0);
    EXPECT_GT(finest, 0.001) << kind.name;
    for (double rate : kRates) EXPECT_NEAR(sag(kind, rate), finest, 0.01 * finest) << kind.name << " at " << rate;
  }
}

}  // namespace
}  // namespace meshless::bench
