// The pile of bench_contact and of the contact tests: unit cubes of 27 particles that fall on each other in columns.
#pragma once

#include "meshless_surgery/world/world.h"

namespace meshless::bench {

struct PileOptions {
  int bodies = 1000;
  double size = 1.0;  // [m] edge of a cube; gaps, heights and jitter scale with it
  double alpha = 0.9;
  int substeps = 4;
  ContactMethod contact = ContactMethod::kSurface;
  bool sleeping = false;
  int threads = 1;
  bool turned = true;     // by a random yaw
  bool straight = false;  // one column without jitter
};

/// Columns of ceil(sqrt(bodies / 4)) squared at 1.55 m, layers at 1.3 m from 1 m, jitter 0.05, mass 1, 1/60 s.
/// cubes: where they begin (for peers to begin there as well).
struct PileStart {
  std::vector<Pose> poses;
  int columns = 1;
};
PileStart startPile(const PileOptions& options);
World makePile(const PileOptions& options);

/// Of a settled pile.
struct PileMeasures {
  double deepest = 0.0;  // of a particle in another cube or in the ground, relative to the size
  double p99 = 0.0;      // of those that are in another at all
  double height = 0.0;   // mean over the cubes of their centre's height, relative to what stacks of true cubes have
  double fastest = 0.0;  // [m/s]
  double highest = 0.0;  // [m]
  bool finite = true;
};
/// positions: 27 particles a cube, in the order of startPile(); depths by the cubes' faces as their corners span them.
PileMeasures measurePile(const PileOptions& options, const std::vector<Points>& positions);
PileMeasures measurePile(const PileOptions& options, World& world);

}  // namespace meshless::bench
