// The hands in the tissue: springs, the push sphere and the scissors. Their state only; World moves them.
#pragma once

#include "meshless_surgery/body/tissue_place.h"
#include "meshless_surgery/tools/command.h"

namespace meshless {

/// A spring on a patch of tissue around a particle. It pulls the patch's weighted mean, implicitly: any stiffness is
/// stable.
struct Pick {
  PickId id = 0;
  BodyId body;
  Index particle = 0;           // where the tissue was grabbed
  TissuePlace place;            // likewise, of a body of cells
  std::vector<Index> patch;     // particles that the grasp holds, the first is `particle`
  std::vector<double> weights;  // add up to 1; some are below 0
  Vec3 target = Vec3::Zero();   // [m] the free end
  Vec3 reached = Vec3::Zero();  // [m] where it was at the end of the last step: it moves evenly over the substeps
  bool locked = false;
  bool latch = false;            // of the jaws of an instrument: nobody else moves it or lets it go
  double stiffness = 0.0;        // [N/m]
  Vec3 position = Vec3::Zero();  // [m] of the tissue's end
  Vec3 force = Vec3::Zero();     // [N] on the tissue, mean over the last step
};

struct PushSphere {
  bool enabled = false;
  double radius = 0.0;           // [m]
  Vec3 position = Vec3::Zero();  // [m]
  Vec3 target = Vec3::Zero();    // [m]
  double speed = 0.0;            // [m/s] towards target
  bool streamed = false;         // the last to move it was a stream
  bool touching = false;
  Vec3 force = Vec3::Zero();  // [N] on the sphere, mean over the last step
};

struct Scissors {
  bool shown = false;
  ScissorBlades blades;
  double angle = 0.5;  // [rad] opening
};

}  // namespace meshless
