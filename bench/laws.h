// The laws that the deformer keeps, measured: patch, momentum, spin, tumbling, and the same motion at any step. Shared
// by the accuracy benchmark and its tests.
#pragma once

#include <string>
#include <vector>

#include "meshless_surgery/body/body.h"

namespace meshless::bench {

/// What is measured: a material of either family on one or many clusters.
struct Kind {
  std::string name;
  bool elastic = false;
  MatchMode mode = MatchMode::kLinear;  // where not elastic
  int clusters = 1;                     // 1, or many
};
std::vector<Kind> kinds();
/// What dynamics/match_batch.h holds: in_float below is for these alone.
bool runsInFloat(const Kind& kind);

/// How far the goals (beta = 1) are from a field that the mode can represent, relative to the body's size: a random
/// affine field of unit volume (linear) or a random quadratic one; turned, scaled, and `far` [m] from the origin. In
/// float by the batch, where beta acts up to 0.95 and the error is that of what the goal should be.
double patchError(const Kind& kind, bool in_float, double scale, double far);

struct Drift {
  double linear = 0.0;  // of the momentum, relative, per step
  double angular = 0.0;
  double energy = 0.0;  // largest rise of the kinetic energy above its start, relative to it (of appearance
                        // materials: at release from the rest shape, all energy is kinetic)
};
/// Of a free cloud of random overlapping clusters that spins and rings.
Drift momentumDrift(const Kind& kind, bool in_float, int steps);

/// Angle [rad] between a free block of alpha = 1 (or the stiff elastic block) and the solution of Euler's equations
/// after `seconds`, at steps of h [s]; about its axis of largest inertia, or about the middle one with a nudge.
double spinError(const Kind& kind, bool tumbling, double h, double seconds);
/// Relative change of the angular momentum after `seconds` of that spin.
double spinLoss(const Kind& kind, double h, double seconds);
/// Exponent p of error ~ h^p, least squares.
double fittedOrder(const std::vector<double>& steps, const std::vector<double>& errors);

struct Ringing {
  double frequency = 0.0;  // [1/s]
  double decay = 0.0;      // [1/s] of the amplitude
  int half_waves = 0;      // seen
};
/// Of a free block's length after a stretch of 4 %, in frames of 1/rate [s] and the substeps that the material needs.
/// Appearance materials: omega h = 0.1 at 1/60 s.
Ringing ringing(const Kind& kind, double rate, double damping = 0.8);
/// [m] of the free end of a block held at the other, at rest.
double sag(const Kind& kind, double rate);

struct Squeezed {
  double volume = 0.0, area = 0.0;  // relative to rest
  double speed = 0.0;               // [m/s] of the fastest particle at the end
  std::size_t gradients = 0;        // formed
};
/// A cube pressed to 60 % of its height between two slippery plates, for three seconds.
Squeezed squeeze(const Material& material);

}  // namespace meshless::bench
