// An organ on the ground, cut through its middle several times and left alone.
#pragma once

#include <cstdint>
#include <random>

#include "meshless_surgery/dynamics/material.h"
#include "meshless_surgery/world/world.h"

namespace meshless::bench {

/// [s] of wall time that so many steps take.
double secondsOf(World& world, int steps);

/// Cuts whatever a random plane through the centre of mass of all bodies meets. False where it was refused.
bool cutAll(World& world, std::mt19937_64& random);

struct Pieces {
  std::uint64_t seed = 1;  // of the organ and of the planes
  int genus = 0;
  int cuts = 4;
  Material material;
  int threads = 1;
  int triangles = 4120;
};

struct PiecesTimes {
  double uncut = -1.0, early = -1.0, late = -1.0;  // [s] for a simulated one: before, in the first half, in the third
  double first = -1.0;                             // [ms] of the first step after the cuts
  double least_volume = 0.0, most_volume = 0.0;    // of a piece, at the end, over rest
  double speed = 0.0;                              // [m/s] root mean square at the end
  std::size_t pieces = 0, asleep = 0;
};

/// A random organ of 0.2 m (geometry/random_organ.h) with the world's defaults at 120 Hz: two seconds
/// on the ground, the cuts, three seconds alone. Negative times where something was refused.
PiecesTimes timePieces(const Pieces& of);

/// [s] for a simulated one: the shipped liver, two of its kidneys, a ball of 44 mm and a box of 9 cm beside each other
/// on the ground, all elastic, in the second second; with `cut`, each cut through its middle, in the second after that.
/// Negative where something was refused.
double timeOrgans(bool cut, int threads);

}  // namespace meshless::bench
