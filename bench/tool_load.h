// A body under a tool as a user has it: in a World with its defaults, stepped until it is at rest.
#pragma once

#include "meshless_surgery/body/body_def.h"
#include "truth_case.h"

namespace meshless::bench {

struct ToolResult {
  double spacing = 0.0;  // [m]
  std::size_t particles = 0;
  double force = 0.0;    // [N] that the tool reports; of an incision the opening of its mouth [m]
  double ratio = 0.0;    // of that to the truth's
  double error = 0.0;    // RMS distance of the samples over the truth's largest displacement
  double tip = 0.0;      // displacement over the truth's, where that is largest
  bool at_rest = false;
  double step_ms = 0.0;  // [ms] of a frame, mean
};

struct ToolOptions {
  double finer = 1.0;    // the default spacing over that of the body
  double spacing = 0.0;  // [m] 0: by `finer`
  double edge = 0.0;     // [m] of the surface's triangles as given; 0: 12.5 mm
  Vec3 beside = Vec3::Zero();  // [m] that the sphere comes down beside the place of the truth
};

/// The push sphere is lowered onto the block or cylinder and into it. Force: of the sphere, mean over the last steps.
/// Shape and tip are those of `beside` zero.
Result<ToolResult> press(const TruthCase& truth, const ToolOptions& options);

/// A pick takes the block at the middle of its top and pulls it up. The truth is scaled to the pick's force, and
/// `force` is what pulls.
Result<ToolResult> pull(const TruthCase& truth, const ToolOptions& options);

/// A body is incised, and hangs in its weight. `folder` holds the surface.
Result<ToolResult> hangIncised(const TruthCase& truth, const std::string& folder, const ToolOptions& options);

}  // namespace meshless::bench
