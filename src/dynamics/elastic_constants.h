// Numbers of the elastic law, which the plain step and the one in vectors share. No functions: see
// elastic_batch_avx2.cpp.
#pragma once

namespace meshless::elastic_law {

constexpr double kLeastVolume = -0.8;  // J below which the pressure does not grow
constexpr double kMostVolume = 1.5;    // J above which it falls
constexpr double kDrawnOut = 12.0;     // |F|^2, 3 at rest, above which the volume counts less and less

constexpr double kMostStiffening = 10.0;  // the most that the slope of the energy by q grows
constexpr double kLevel = 40.0;           // a^2 |d|^2 from which q grows with |d|^2 again: stress stays bounded
constexpr double kFourth = 0.25;          // of a^2 |d|^4 in q; it is convex from 0.2 on
// q'' is within a twentieth at most 2 + (kCurved - 2) x / (kCurvedFrom + x), x = a^2 |d|^2.
constexpr double kCurved = 40.0, kCurvedFrom = 3.0;

constexpr double kTurns = 1e-3;  // the least determinant of tr S - S over its trace^3 at which a rotation has a slope
constexpr double kModeSquare = 2.0 / 3.0;  // of an edge along each of two axes, in the mean over three

}  // namespace meshless::elastic_law
