// How smooth a movement is, as published, of samples at an even rate.
#pragma once

#include <vector>

#include "meshless_surgery/base/types.h"

namespace meshless {

/// Spectral arc length of a speed profile: minus the length of its normalised magnitude spectrum up to 10 Hz, or to the
/// last frequency below that at which it is at least 0.05; nearer to 0 is smoother. Balasubramanian, Melendez-Calderon,
/// Roby-Brami and Burdet 2015, "On the analysis of movement smoothness" (their padding of 4). NaN where nothing moves.
double spectralArcLength(const std::vector<double>& speeds, double rate);

/// -ln(T^3 / v_peak^2 * integral of |d2v/dt2|^2) of a movement's velocities [m/s]; nearer to 0 (or above) is smoother.
/// The same paper, of velocity. NaN where nothing moves or there are fewer than 4 samples.
double logDimensionlessJerk(const Points& velocities, double rate);

/// [m] amplitude of a sine whose mean square is that of the positions' part between the two frequencies [Hz], over all
/// axes: a Hann window over samples whose straight trend is taken off. For a whole number of periods of 1 / `from`.
double bandAmplitude(const Points& positions, double rate, double from, double to);

}  // namespace meshless
