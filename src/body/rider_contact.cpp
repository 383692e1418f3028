#include "meshless_surgery/body/rider_contact.h"

#include "meshless_surgery/body/binding.h"

namespace meshless {
namespace {

constexpr int kSweeps = 4;

struct ClusterPush {
  Vec3 shift = Vec3::Zero();
  Mat3 map = Mat3::Zero();
  bool used = false;
};

}  // namespace

std::size_t pushRiders(const BodyModel& model, const Obstacle& obstacle, BodyState& state, std::vector<bool>* touched,
                       Vec3* impulse) {
  const SurfaceBinding& binding = model.binding;
  const MatchInput input = matchInput(model);
  fitClusters(input, state.positions, state.poses);
  std::vector<Index> hit;
  for (Index r = 0; r < binding.riders.size(); ++r)
    if (!obstacle(riderPosition(model, state.poses, r) + state.rider_offsets[r]).isZero(0.0)) hit.push_back(r);
  if (hit.empty()) return 0;

  std::vector<ClusterPush> pushes(model.clusters.size());
  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (Index r : hit) {
      const Vec3& rest = model.surface.vertices[binding.riders[r]];
      Vec3 moved = Vec3::Zero();
      double inverse_mass = 0.0;
      for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k) {
        const Index c = binding.clusters[k];
        const ClusterRest& cluster = model.shape.clusters[c];
        const Vec3 q = rest - cluster.centre;
        moved += binding.weights[k] * (pushes[c].shift + pushes[c].map * q);
        inverse_mass +=
            binding.weights[k] * binding.weights[k] * (1.0 / cluster.mass + q.dot(cluster.moment_inverse * q));
      }
      const Vec3 wanted = obstacle(riderPosition(model, state.poses, r) + state.rider_offsets[r] + moved);
      if (wanted.isZero(0.0)) continue;
      const Vec3 lambda = wanted / inverse_mass;
      for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k) {
        const Index c = binding.clusters[k];
        const ClusterRest& cluster = model.shape.clusters[c];
        pushes[c].used = true;
        pushes[c].shift += lambda * (binding.weights[k] / cluster.mass);
        pushes[c].map += lambda * (binding.weights[k] * (cluster.moment_inverse * (rest - cluster.centre))).transpose();
      }
    }
  for (Index c = 0; c < model.clusters.size(); ++c) {
    if (!pushes[c].used) continue;
    for (Index k = model.clusters.offsets[c]; k < model.clusters.offsets[c + 1]; ++k) {
      const Index i = model.clusters.members[k];
      if (model.fixed[i]) continue;
      const Vec3 shift = model.clusters.weights[k] *
                         (pushes[c].shift + pushes[c].map * (model.rest[i] - model.shape.clusters[c].centre));
      state.positions[i] += shift;
      if (impulse) *impulse += model.masses[i] * shift;
      if (touched) (*touched)[i] = true;
    }
  }
  fitClusters(input, state.positions, state.poses);
  for (Index r : hit) state.rider_offsets[r] += obstacle(riderPosition(model, state.poses, r) + state.rider_offsets[r]);
  return hit.size();
}

}  // namespace meshless
