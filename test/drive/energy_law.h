// What is left alone slows down.
#pragma once

#include "drive/finding.h"
#include "drive/seen.h"

namespace meshless {

/// A piece at one time, while nothing is held and no tool is near.
struct Motion {
  std::string name;
  double speed = 0.0;     // [m/s] root mean square over the piece
  double height = 0.0;    // [m] of its centre of mass, against gravity
  double diagonal = 0.0;  // [m] of its bounds at rest
};
struct AloneLook {
  double time = 0.0;  // [s]
  std::vector<Motion> pieces;
};
AloneLook alone(const Seen& seen);

/// Kinetic energy falls, but for what a fall gives. With e = v^2 / 2 + g z of each piece [m^2/s^2]: its largest value
/// over a second is not above that of the second before, but for depenetration (by allowedDepth() of
/// depth_law.h) and for what another piece can give it in a collision, 2 v^2 of the fastest in the second before. The
/// looks are in order of time, several a second.
Finding energyLaw(const std::vector<AloneLook>& looks, double gravity);

}  // namespace meshless
