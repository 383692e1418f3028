// The frames before and after a cut of a ball that lies on a bed.
#pragma once

namespace meshless::bench {

struct AfterCut {
  bool elastic = false;  // else the default material
  bool upright = false;  // the plane; else nearly level, so that one half stays on the other
  int threads = 1;
};

/// [ms] of World::step; the second is the first after the cut. Negative where something was refused.
struct AfterCutTimes {
  double before = -1.0, first = -1.0, next = -1.0;  // next: the median of the five after that
};

/// A ball of 8,820 triangles in the middle of a block of 0.6 x 0.6 x 0.05 m, come to rest. The cut is answered in the
/// middle of a frame, as by the node: the step after it begins 1/60 s later.
AfterCutTimes timeAfterCut(const AfterCut& of);

}  // namespace meshless::bench
