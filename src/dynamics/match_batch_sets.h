// What the vectorised steps compute on, and one set of entry points for each instruction set, each compiled in a file
// of its own. Raw pointers only: no type here may hold an inline function that another file shares.
#pragma once

#include <cstddef>
#include <cstdint>

#include "rotation_sets.h"

namespace meshless::match_sets {

constexpr int kBlock = 16;   // bodies side by side; a multiple of every set's lanes
constexpr int kChunk = 128;  // bodies, particles or clusters between two calls of the rotations: stays in the L2 cache

enum ParticleField { kX, kY, kZ, kVx, kVy, kVz, kQx, kQy, kQz, kMass, kParticleFields };
enum MotionField { kMotionCentre, kMotionVelocity = 3, kMotionSpin = 6, kMotionInverse = 9, kMotionFields = 15 };
enum BodyField { kSize, kMoment, kGround = kMoment + 6, kHasQuadratic, kBodyFields };
constexpr int kQuadraticFields = 6 + 45;  // mean of the second order terms, upper triangle of the inverse moment

struct StepNumbers {
  float h;      // [s]
  float ahead;  // [s] how far what deforms goes for the match
  float pull;   // [1/s] share of the way to the goal over h
  float beta;   // 0: no fit is formed
  float lost;   // share of the motion that deforms
  float gravity[3];
  float friction;
  bool ground;
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

/// One body of overlapping clusters, in a frame that turns with it: x = origin + frame (rest + u). Particle arrays are
/// [3][particle_stride], cluster arrays [..][cluster_stride]. Rows of 16 floats hold 3 rows of 4, the last 4 are 0.
struct OverlapView {
  std::size_t particles, particle_stride, clusters, cluster_stride;
  float* u;            // [m] displacement
  float* v;            // [m/s]
  const float* rest;   // [m] from the centre of mass
  const float* mass;   // share of the body's
  const float* lever;  // of a particle: 4 floats (rest, 1) times the mass that it gives (to each cluster, where equal)
  const float* share;  // of a particle in each of its clusters; 1 where pairs have weights of their own
  float* moments;      // of a particle: row of 16
  float* maps;         // of a cluster: row of 16
  const std::uint32_t* member_offsets;                     // clusters + 1
  const std::uint32_t* membership_offsets;                 // particles + 1
  const std::uint16_t *short_members, *short_memberships;  // null: the long ones
  const std::uint32_t *long_members, *long_memberships;
  const float *member_weights, *membership_weights;  // null: equal shares
  /// Of a lattice, else null: the row of a particle and of the cluster around it. Rows are then summed along x and y by
  /// sumLayer(), and along z over layer_count rows from layer_begin on that are `layer` rows apart.
  const std::uint32_t *sites, *layer_begin, *layer_count;
  std::size_t layer;
  const float* cluster_constants;  // [16]: moment at rest (xx yy zz xy yz zx), centre, 1 / mass, inverse moment
  float* quaternions;              // [4] in the frame
};
enum ClusterField { kRestMoment, kCentre = 6, kInverseMass = 9, kInverseMoment = 10, kClusterFields = 16 };

struct alignas(64) ClusterScratch {
  float moment[9][kChunk];
  float mean[3][kChunk];  // of u
  float rotation[9][kChunk];
};

enum OverlapSum { kSumX = 0, kSumV = 3, kSumMoment = 6, kSumSpin = 12, kOverlapSums = 15 };

struct OverlapMotion {
  float centre[3], velocity[3], spin[3];  // [m], [m/s], [rad/s] of the body before the pull
  float restore[3];                       // [rad/s] what the pull leaked
  float normal[3];                        // of the ground, in the frame
  float height;                           // [m] of the ground along it, from the frame's origin
};

/// gatherBodies, moveBodies: what comes before and after the rotations; the latter leaves the motion of the new state.
/// spreadParticles: damps, and spreads the moments of where the particles are going.
/// sumLayer: replaces each of nx * ny rows by the sum over those at most `width` away along x and y. `line` is room for
/// the longer of nx and ny in rows.
/// measureBodies: the motion that moveBodies leaves, of bodies whose state comes from outside.
#define MESHLESS_MATCH_ENTRIES                                                                                         \
  void measureBodies(const BodiesView& view, int first_block, int blocks);                                             \
  void gatherBodies(const BodiesView& view, const StepNumbers& step, int first_block, int blocks, BodiesScratch& s);   \
  void moveBodies(const BodiesView& view, const StepNumbers& step, int first_block, int blocks, BodiesScratch& s);     \
  void sumParticles(const OverlapView& view, std::size_t first, std::size_t count, double* sums);                      \
  void spreadParticles(const OverlapView& view, const StepNumbers& step, const OverlapMotion& motion,                  \
                       std::size_t first, std::size_t count);                                                          \
  void sumLayer(float* rows, std::size_t nx, std::size_t ny, std::size_t width, float* line);                          \
  void gatherClusters(const OverlapView& view, std::size_t first, std::size_t count, ClusterScratch& s);               \
  void mapClusters(const OverlapView& view, const StepNumbers& step, std::size_t first, std::size_t count,             \
                   const ClusterScratch& s, double* quaternion_sum);                                                   \
  void pullParticles(const OverlapView& view, const StepNumbers& step, const OverlapMotion& motion, std::size_t first, \
                     std::size_t count, float* goals, double* leaked);                                                 \
  void moveParticles(const OverlapView& view, const StepNumbers& step, const OverlapMotion& motion, std::size_t first, \
                     std::size_t count);

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
  decltype(&baseline::sumParticles) sumParticles;
  decltype(&baseline::spreadParticles) spreadParticles;
  decltype(&baseline::sumLayer) sumLayer;
  decltype(&baseline::gatherClusters) gatherClusters;
  decltype(&baseline::mapClusters) mapClusters;
  decltype(&baseline::pullParticles) pullParticles;
  decltype(&baseline::moveParticles) moveParticles;
};
const Entries& entriesOf(InstructionSet set);

}  // namespace meshless::match_sets
