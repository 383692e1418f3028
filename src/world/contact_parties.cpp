#include "contact_parties.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/dynamics/extent.h"
#include "meshless_surgery/world/quadratic_fit.h"

namespace meshless {
namespace {

constexpr double kLeastRigid = 0.5;  // share of a contact's impulse that moves a body for looks as a whole
constexpr double kFlattest = 1e-6;   // det of a map: below, the rotation stands in

// The affine fit of one cluster at given positions; the rotation that it has where the fit has no rank.
ContactMap fitMap(const MatchInput& in, Index c, const Vec3* positions, const ClusterPose& pose) {
  const ClusterRest& rest = in.shape.clusters[c];
  ContactMap map;
  map.rest = rest.centre;
  Vec3 sum = Vec3::Zero();
  Mat3 moment = Mat3::Zero();
  const Vec3 origin = positions[in.clusters.members[in.clusters.offsets[c]]];
  for (Index k = in.clusters.offsets[c]; k < in.clusters.offsets[c + 1]; ++k) {
    const Index i = in.clusters.members[k];
    const double m = in.masses[i] * in.clusters.weights[k];
    const Vec3 x = m * (positions[i] - origin), q = in.rest[i] - rest.centre;
    sum += x;
    for (int d = 0; d < 3; ++d) moment.col(d) += q[d] * x;
  }
  map.centre = origin + sum / rest.mass;
  map.from_rest = rest.linear_rank ? Mat3(moment * rest.moment_inverse) : pose.rotation.toRotationMatrix();
  double det = map.from_rest.determinant();
  if (!(std::abs(det) > kFlattest) || !(map.from_rest.squaredNorm() < 1e6)) {
    map.from_rest = pose.rotation.toRotationMatrix();
    map.to_rest = map.from_rest.transpose();
    return map;
  }
  map.flipped = det < 0.0;
  map.to_rest = map.from_rest.inverse();
  return map;
}

}  // namespace

void fitMaps(const BodyModel& model, const Material& material, const BodyState& state, std::vector<ContactMap>& maps,
             std::vector<QuadraticMap>& quadratic) {
  const MatchInput in = matchInput(model, state);
  const Vec3* positions = state.positions.data();
  maps.resize(in.clusters.size());
  for (Index c = 0; c < in.clusters.size(); ++c) maps[c] = fitMap(in, c, positions, state.poses[c]);
  if (!material.elastic() && material.mode == MatchMode::kQuadratic && !in.shape.quadratic.empty())
    fitQuadraticMaps(in, positions, maps, quadratic);
}

// Two spacings, but of crumbs, whose surface is all nearer to their few particles, no more than what they have: where
// many of them lie together each would be next to all.
double riderReachOf(const BodyModel& model) {
  const SurfaceBinding& binding = model.binding;
  double farthest = 0.0;  // squared, of a rider from its nearest carrier
  for (Index r = 0; r < binding.riders.size(); ++r) {
    double nearest = std::numeric_limits<double>::infinity();
    for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k)
      nearest = std::min(nearest,
                         (model.surface.vertices[binding.riders[r]] - model.rest[binding.carriers[k]]).squaredNorm());
    farthest = std::max(farthest, nearest);
  }
  return 2.0 * std::min(std::sqrt(farthest), model.spacing);
}

ContactParty partyOf(const BodyModel& model, const Material& material, BodyState& state, std::uint64_t key) {
  ContactParty party;
  party.key = key;
  party.mass = model.mass;
  party.friction = material.friction;
  party.restitution = material.restitution;
  party.positions = state.positions.data();
  party.particles = static_cast<Index>(state.positions.size());
  party.masses = model.masses.data();
  return party;
}

ContactParty partyOf(WorldObstacle& obstacle, std::uint64_t key) {
  ContactParty party;
  party.key = key;
  party.shape = &obstacle.shape;
  party.positions = obstacle.def->mesh.vertices.data();
  party.previous = party.positions;
  party.masses = obstacle.masses.data();
  party.inverse_masses = obstacle.inverse_masses.data();
  party.particles = static_cast<Index>(obstacle.def->mesh.vertices.size());
  party.maps = obstacle.maps.data();
  party.map_count = 1;
  party.friction = obstacle.def->friction;
  party.bounds = obstacle.bounds;
  party.moves = false;
  return party;
}

void readMotion(const BodyModel& model, const Material& material, const BodyState& state, double rider_reach,
                ContactParty& party) {
  party.rigid_share = model.any_fixed || material.elastic() ? 0.0 : std::max(kLeastRigid, material.alpha);
  party.bounds = extentOf(state.positions);
  const Box velocities = extentOf(state.velocities);
  party.velocity = 0.5 * (velocities.min + velocities.max);
  party.spread = 0.5 * velocities.diagonal();
  party.bounds.min.array() -= rider_reach;
  party.bounds.max.array() += rider_reach;
}

}  // namespace meshless
