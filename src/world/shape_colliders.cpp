#include "shape_colliders.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/dynamics/extent.h"
#include "meshless_surgery/world/quadratic_fit.h"

namespace meshless {
namespace {

constexpr double kLeastRigid = 0.5;  // of an impulse on an appearance material: share that moves the body as a whole
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

// Two spacings, or less for crumbs, whose whole surface is nearer to their few particles. Otherwise, where many crumbs
// lie together, each would be next to all.
double embeddedReachOf(const BodyModel& model) {
  const SurfaceBinding& binding = model.binding;
  double farthest = 0.0;  // squared, of an embedded vertex from its nearest carrier
  for (Index r = 0; r < binding.embedded.size(); ++r) {
    double nearest = std::numeric_limits<double>::infinity();
    for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k)
      nearest = std::min(nearest,
                         (model.surface.vertices[binding.embedded[r]] - model.rest[binding.carriers[k]]).squaredNorm());
    farthest = std::max(farthest, nearest);
  }
  return 2.0 * std::min(std::sqrt(farthest), model.spacing);
}

ShapeCollider shapeColliderOf(const BodyModel& model, const Material& material, BodyState& state, std::uint64_t key) {
  ShapeCollider collider;
  collider.key = key;
  collider.mass = model.mass;
  collider.friction = material.friction;
  collider.restitution = material.restitution;
  collider.positions = state.positions.data();
  collider.particles = static_cast<Index>(state.positions.size());
  collider.masses = model.masses.data();
  return collider;
}

ShapeCollider shapeColliderOf(WorldObstacle& obstacle, std::uint64_t key) {
  ShapeCollider collider;
  collider.key = key;
  collider.shape = &obstacle.shape;
  collider.positions = obstacle.def->mesh.vertices.data();
  collider.previous = collider.positions;
  collider.masses = obstacle.masses.data();
  collider.inverse_masses = obstacle.inverse_masses.data();
  collider.particles = static_cast<Index>(obstacle.def->mesh.vertices.size());
  collider.maps = obstacle.maps.data();
  collider.map_count = 1;
  collider.friction = obstacle.def->friction;
  collider.bounds = obstacle.bounds;
  collider.moves = false;
  return collider;
}

void readMotion(const BodyModel& model, const Material& material, const BodyState& state, double embedded_reach,
                ShapeCollider& collider) {
  collider.rigid_share = model.any_fixed || material.elastic() ? 0.0 : std::max(kLeastRigid, material.alpha);
  collider.bounds = extentOf(state.positions);
  const Box velocities = extentOf(state.velocities);
  collider.velocity = 0.5 * (velocities.min + velocities.max);
  collider.spread = 0.5 * velocities.diagonal();
  collider.bounds.min.array() -= embedded_reach;
  collider.bounds.max.array() += embedded_reach;
}

}  // namespace meshless
