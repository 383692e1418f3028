// What the vectorised steps compute on, and one set of entry points for each instruction set, each compiled in a file
// of its own. Raw pointers only: no type here may hold an inline function that another file shares.
#pragma once

#include <cstddef>

#include "rotation_sets.h"

namespace meshless::match_sets {

constexpr int kBlock = 16;   // bodies side by side; a multiple of every set's lanes
constexpr int kChunk = 128;  // bodies between two calls of the rotations: stays in the L2 cache

enum ParticleField { kX, kY, kZ, kVx, kVy, kVz, kQx, kQy, kQz, kMass, kParticleFields };
enum MotionField { kMotionCentre, kMotionVelocity = 3, kMotionSpin = 6, kMotionInverse = 9, kMotionFields = 15 };
enum BodyField { kSize, kMoment, kHasQuadratic = kMoment + 6, kBodyFields };
constexpr int kQuadraticFields = 6 + 45;  // mean of the second order terms, upper triangle of the inverse moment

struct StepNumbers {
  float h;      // [s]
  float ahead;  // [s] how far what deforms goes for the match
  float pull;   // [1/s] share of the way to the goal over h
  float beta;   // 0: no fit is formed
  float lost;   // share of the motion that deforms
  float gravity[3];
  bool quadratic;
};

/// Bodies of one cluster each. Masses are shares of the body's, rest positions q are centred and in units of its size.
struct BodiesView {
  int particles;           // a body
  float* fields;           // of block b, particle i: [kParticleFields][kBlock]
  float* constants;        // of block b: [kBodyFields][kBlock]
  float* motion;           // of block b, for the present x and v: [kMotionFields][kBlock]
  const float* quadratic;  // of block b: [kQuadraticFields][kBlock]
  /// Pseudo-inverse of a symmetric matrix (xx yy zz xy yz zx), for bodies that are nearly a line.
  void (*pseudoInverse)(const float matrix[6], float inverse[6]);
};

struct alignas(64) BodiesScratch {
  float moment[9][kChunk];   // sum m y q^T
  float second[18][kChunk];  // the same with the second order terms, row by row
  float rotation[9][kChunk];
  float shift[3][kChunk];  // by which the positions were brought nearer to their origin
};

/// gatherBodies, moveBodies: what comes before and after the rotations; the latter leaves the motion of the new state.
/// measureBodies: the motion that moveBodies leaves, of bodies whose state comes from outside.
#define MESHLESS_MATCH_ENTRIES                                                                                       \
  void measureBodies(const BodiesView& view, int first_block, int blocks);                                           \
  void gatherBodies(const BodiesView& view, const StepNumbers& step, int first_block, int blocks, BodiesScratch& s); \
  void moveBodies(const BodiesView& view, const StepNumbers& step, int first_block, int blocks, BodiesScratch& s);

namespace baseline {
MESHLESS_MATCH_ENTRIES
}
#if MESHLESS_ROTATION_X86
namespace avx2 {
MESHLESS_MATCH_ENTRIES
}
namespace avx512 {
MESHLESS_MATCH_ENTRIES
}
#endif

struct Entries {
  decltype(&baseline::measureBodies) measureBodies;
  decltype(&baseline::gatherBodies) gatherBodies;
  decltype(&baseline::moveBodies) moveBodies;
};
const Entries& entriesOf(InstructionSet set);

}  // namespace meshless::match_sets
