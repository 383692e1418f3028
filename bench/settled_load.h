// A body under a load of the truth as a user has it: placed, held and loaded in a World that steps until it is at rest.
#pragma once

#include "meshless_surgery/body/body_def.h"
#include "truth_case.h"

namespace meshless::bench {

struct SettledResult {
  double spacing = 0.0;  // [m]
  std::size_t particles = 0;
  double error = 0.0;  // RMS distance to the truth over its largest displacement; over the surface where it has areas
  double farthest = 0.0;  // largest distance to the truth, over the same
  double slope = 0.0;     // RMS error of what edges turn and stretch by, over the truth's RMS; 0 without a surface
  double tip = 0.0;       // displacement over the truth's, where that is largest
  double slower = 1.0;    // times as slowly as the material it deforms
  std::size_t substeps = 0;
  double moving = 0.0;   // of the largest displacement, in the last time constant
  double step_ms = 0.0;  // [ms] of a frame, mean
};

struct SettledOptions {
  double finer = 1.0;    // the default spacing over that of the body
  double spacing = 0.0;  // [m] 0: by `finer`
  double stiffer = 1.0;  // Young's modulus and gravity over the truth's: the displacements are the same
  int max_substeps = 64;
  bool sleeps = false;  // in a world with sleep, with the damping of the materials that ship
};

/// `folder` holds the surface.
Result<SettledResult> settle(const TruthCase& truth, const std::string& folder, const SettledOptions& options);

}  // namespace meshless::bench
