#include "elastic_cost.h"

#include <algorithm>

#include "clock.h"

namespace meshless::bench {
namespace {

// Bytes of a cell, by src/dynamics/elastic_batch.cpp. Blocks of 64 cells stay in the first-level cache, so that what a
// block reads again, and its Fits, count once or not at all. Positions are read once a particle, though eight times a
// cell: neighbours come from the cache.
constexpr double kIndices = 8 * 4;         // ElasticBatch::particles_
constexpr double kMass = 8;                // masses_
constexpr double kRotation = 2 * 4 * 8;    // ElasticBatchState::rotations, read and written
constexpr double kForces = 2 * 3 * 8 * 8;  // forces: written by a block, read by sumForces()
constexpr double kPlaces = 8 * 4;          // force_places_
constexpr double kBoxBytes = kIndices + kMass + kRotation + kForces + kPlaces;
constexpr double kFilling = 6 * 8;                        // cells_: kCellRows, of cells that are filled in part
constexpr double kParticleBytes = 3 * 8 + 4 + 8 + 3 * 8;  // y, force_offsets_, inverse_masses_, accelerations

// Operations of a cell, function by function of src/dynamics/elastic_batch_kernel.h, as written there. A fused
// multiplication and addition is two. Comparisons, choices and signs are none.
constexpr double kGather = 8 * 3;                     // each corner less the first
constexpr double kFitBox = 3 * 31;                    // an axis: 12 pairs of 2, seven scales
constexpr double kFitCell = 3 * 55;                   // an axis: 12 pairs of 4, seven scales
constexpr double kRotationMatrix = 24;                // 12 products, 12 sums
constexpr double kNewtonStep = 24 + 45                // the rotation's matrix, R^T F
                               + 12 + 18 + 5 + 1      // gradient and Hessian, cofactors, determinant, 0.5 over it
                               + 18 + 6               // the step, its length
                               + 2 + 2 + 2 + 24 + 6;  // trace and its cube, `sound`, quaternion, `close`
constexpr double kNewton = 2 * kNewtonStep + 8 + 13;  // two steps, `s` between them, the unit quaternion
constexpr double kStress = 9 + kRotationMatrix + 27 + 5 + 18 + 2  // F, R, cof F, J, |F|^2, `beyond`
                           + 1 + 1 + 3 + 18 + 36;                 // strain, pressure, steepness 3 and 18, P
constexpr double kMix = 6;                                        // shear and pressure of a cell filled in part
constexpr double kBend = 4 + 30 + 18 + 5                           // stiffness, F^T F, its square, longest
                         + 27 + 45 + 1                            // |modes|^2, modes along the columns, one over
                         + 27 + 48 + 3                            // slopes, and of the energy by them
                         + 3 * 75 + 6;                            // an axis: by F 48, by the modes 27; the last mode
constexpr double kPushBox = 2 + 3 * 31;                           // an axis: seven coefficients, 12 pairs of 2
constexpr double kPushCell = 2 + 3 * 55;                          // an axis: seven coefficients, 12 pairs of 4
constexpr double kSum = 8 * 3;                                    // sumForces()
constexpr double kBoxOperations = kGather + kFitBox + kNewton + kStress + kBend + kPushBox + kSum;
constexpr double kCellOperations = kGather + kFitCell + kNewton + kStress + kMix + kBend + kPushCell + kSum;
constexpr double kParticleOperations = 3;  // times the inverse mass

constexpr int kForcePasses = 7;
constexpr double kShortestPass = 0.05;  // [s] of a pass
constexpr double kTurn = 1e-3;          // [rad] from call to call, and as much strain

}  // namespace

ElasticWork elasticWork(const BodyModel& model) {
  const double cells = static_cast<double>(model.cells->cells.size());
  const double boxes = model.elastic_batch->whole(), filled = cells - boxes;
  const double particles = static_cast<double>(model.rest.size());
  return {cells * kBoxBytes + filled * kFilling + particles * kParticleBytes,
          boxes * kBoxOperations + filled * kCellOperations + particles * kParticleOperations};
}

ElasticTime timeElastic(const BodyModel& model, const Material& material) {
  const ElasticParameters parameters =
      elasticParameters(material.youngs_modulus, material.poissons_ratio, material.density);
  const Quat turn(Eigen::AngleAxisd(kTurn, Vec3(1.0, 2.0, 3.0).normalized()));
  Points places[2] = {model.rest, model.rest};
  for (Vec3& p : places[1]) p = turn * Vec3((1.0 + kTurn) * p.x(), p.y(), p.z());
  ElasticBatchState state;
  Points accelerations;
  MatchCounters counters;
  model.elastic_batch->setRotations(std::vector<ClusterPose>(model.cells->cells.size()), state);
  int calls = 2;
  ElasticTime time;
  for (int pass = 0; pass < kForcePasses;) {
    const double start = now();
    for (int n = 0; n < calls; ++n)
      model.elastic_batch->accelerate(matchInput(model), parameters, places[n % 2], state, accelerations, counters);
    const double seconds = now() - start;
    if (seconds < kShortestPass) {
      calls *= 2;
      continue;
    }
    time.seconds = pass == 0 ? seconds / calls : std::min(time.seconds, seconds / calls);
    ++pass;
  }
  time.cold = counters.cold_rotations;
  return time;
}

}  // namespace meshless::bench
