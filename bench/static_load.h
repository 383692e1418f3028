// A body under a load of the finite-element truth, brought to rest by damped steps of the deformer.
#pragma once

#include "meshless_surgery/body/body.h"
#include "truth_case.h"

namespace meshless::bench {

struct StaticSettings {
  double spacing = 0.0125;       // [m] between particles
  ClusterOptions clusters;       // cells, unless another kind is tried
  Material material;             // elastic: E, nu and density are taken from the case; else as it is
  double appearance_rate = 0.0;  // [rad/s] of an appearance material: accelerations are appearance_rate^2 (goal - x)
  int max_steps = 60000;
  double rest = 1e-6;  // of the largest displacement, per characteristic time: then it is at rest
};

struct StaticResult {
  double error = 0.0;             // RMS distance to the truth over its largest displacement
  double contact_force = 0.0;     // [N] of the sphere, where there is one
  Vec3 end_force = Vec3::Zero();  // [N] on the body, of what holds the end that is moved
  double end_moment = 0.0;        // [N m] of it about the x axis
  double step_ms = 0.0;           // [ms] of one evaluation of all particles' accelerations, median
  std::size_t particles = 0;
  std::size_t clusters = 0;
  int steps = 0;
  bool at_rest = false;
  Points samples;        // [m] where the truth's samples are
  double largest = 0.0;  // [m] displacement of the truth
};

/// `folder` holds the case's other files (the organ's surface).
Result<StaticResult> solveStatic(const TruthCase& truth, const std::string& folder, const StaticSettings& settings);

}  // namespace meshless::bench
