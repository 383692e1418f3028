#include "meshless_surgery/body/binding.h"

#include <algorithm>
#include <map>

#include "meshless_surgery/geometry/nearest.h"

namespace meshless {
namespace {

constexpr std::size_t kRiderNeighbours = 4;  // particles whose clusters a rider may follow
constexpr std::size_t kRiderClusters = 3;

}  // namespace

SurfaceBinding bindSurface(const Points& rest, const std::vector<double>& masses, const ClusterSet& clusters,
                           const RestShape& shape, const Points& surface_rest, std::vector<Index> vertex_particle) {
  SurfaceBinding binding;
  binding.particle = std::move(vertex_particle);
  binding.offsets.push_back(0);
  for (Index v = 0; v < surface_rest.size(); ++v)
    if (binding.particle[v] == kNoIndex) binding.riders.push_back(v);
  if (binding.riders.empty()) return binding;

  std::vector<std::vector<std::pair<Index, double>>> clusters_of(rest.size());
  for (Index c = 0; c < clusters.size(); ++c)
    for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k)
      clusters_of[clusters.members[k]].emplace_back(c, clusters.weights[k]);
  const NearestPoints nearest(rest);
  std::map<Index, double> pull;  // [1/kg] by particle: its share of a unit impulse on the rider over its mass
  for (Index v : binding.riders) {
    const std::vector<Index> near = nearest.nearest(surface_rest[v], kRiderNeighbours);
    const double reach = (rest[near.back()] - surface_rest[v]).norm() + 1e-300;
    std::map<Index, double> votes;
    for (Index i : near) {
      const double closeness = 1.0 / (0.05 + (rest[i] - surface_rest[v]).norm() / reach);
      for (const auto& [c, w] : clusters_of[i]) votes[c] += closeness * w;
    }
    std::vector<std::pair<double, Index>> order;
    for (const auto& [c, vote] : votes) order.emplace_back(-vote, c);
    std::sort(order.begin(), order.end());
    order.resize(std::min(order.size(), kRiderClusters));
    double total = 0.0;
    for (const auto& o : order) total -= o.first;

    pull.clear();
    for (const auto& [minus_vote, c] : order) {
      const double weight = -minus_vote / total;
      binding.clusters.push_back(c);
      binding.weights.push_back(weight);
      const ClusterRest& r = shape.clusters[c];
      const Vec3 lever = r.moment_inverse * (surface_rest[v] - r.centre);
      for (Index k = clusters.offsets[c]; k < clusters.offsets[c + 1]; ++k) {
        const Index i = clusters.members[k];
        pull[i] += weight * clusters.weights[k] * (1.0 / r.mass + lever.dot(rest[i] - r.centre));
      }
    }
    double mobility = 0.0;
    for (const auto& [i, p] : pull) mobility += masses[i] * p * p;
    binding.mobility.push_back(mobility);
    binding.offsets.push_back(static_cast<Index>(binding.clusters.size()));
  }
  return binding;
}

Vec3 riderPosition(const BodyModel& model, const std::vector<ClusterPose>& poses, Index r) {
  const Vec3& rest = model.surface.vertices[model.binding.riders[r]];
  Vec3 sum = Vec3::Zero();
  for (Index k = model.binding.offsets[r]; k < model.binding.offsets[r + 1]; ++k) {
    const Index c = model.binding.clusters[k];
    sum +=
        model.binding.weights[k] * (poses[c].centre + poses[c].deformation * (rest - model.shape.clusters[c].centre));
  }
  return sum;
}

}  // namespace meshless
