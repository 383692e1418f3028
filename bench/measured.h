// What was measured of tissue and rubber, beside what the elastic law gives: strains that are the same everywhere, so
// that the law alone answers, through the kernel that the node steps with.
#pragma once

#include <string>
#include <vector>

#include "meshless_surgery/dynamics/elastic.h"

namespace meshless::bench {

enum class Loading { kUniaxial, kEquibiaxial, kPureShear, kSimpleShear };
const char* toString(Loading loading);

/// A nominal stress (force over the area at rest) [Pa] at a stretch; at an amount of shear where simple shear is.
struct MeasuredPoint {
  Loading loading;
  double at = 1.0;
  double stress = 0.0;
};

struct MeasuredTissue {
  std::string name, source;
  std::vector<MeasuredPoint> points;
};
const std::vector<MeasuredTissue>& measuredTissues();

/// Nominal stress [Pa] of a cube of the material; what is not loaded is free. Its cells are those of ElasticBatch.
double nominalStress(const ElasticParameters& material, Loading loading, double at);

struct Fit {
  ElasticParameters material;
  std::vector<double> stresses;  // [Pa] of the tissue's points
  double error = 0.0;            // root of the mean square of relative errors
  double worst = 0.0;            // largest relative error
};
Fit fitOf(const MeasuredTissue& tissue, const ElasticParameters& material);
/// Least squares of the relative errors at the tissue's points: Young's modulus alone, or all three numbers. In
/// seconds.
Fit fitYoungs(const MeasuredTissue& tissue, double poissons_ratio);
Fit fitAll(const MeasuredTissue& tissue, double poissons_ratio);

}  // namespace meshless::bench
