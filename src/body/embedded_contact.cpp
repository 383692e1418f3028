#include "meshless_surgery/body/embedded_contact.h"

#include "meshless_surgery/body/binding.h"

namespace meshless {
namespace {

constexpr int kSweeps = 4;

}  // namespace

std::size_t pushEmbedded(const BodyModel& model, const Obstacle& obstacle, BodyState& state,
                         const std::function<void(Index particle, const Vec3& shift)>& moved,
                         const std::vector<Index>* among) {
  const SurfaceBinding& binding = model.binding;
  Points& x = state.positions;
  if (among ? among->empty() : binding.embedded.empty()) return 0;
  fitClusters(matchInput(model, state), x, binding.lever_clusters, state.poses);
  const auto place = [&](Index r) -> Vec3 {
    return embeddedPosition(binding, x, state.poses, r) + state.embedded_offsets[r];
  };
  std::vector<Index> hit;
  const auto check = [&](Index r) {
    if (!obstacle(place(r)).isZero(0.0)) hit.push_back(r);
  };
  if (among)
    for (Index r : *among) check(r);
  else
    for (Index r = 0; r < binding.embedded.size(); ++r) check(r);
  if (hit.empty()) return 0;

  for (int sweep = 0; sweep < kSweeps; ++sweep)
    for (Index r : hit) {
      const Vec3 wanted = obstacle(place(r));
      if (wanted.isZero(0.0)) continue;
      double mobility = 0.0;  // [1/kg]
      for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k) {
        const Index i = binding.carriers[k];
        if (!model.fixed[i]) mobility += binding.weights[k] * binding.weights[k] / model.masses[i];
      }
      if (!(mobility > 0.0)) continue;
      for (Index k = binding.offsets[r]; k < binding.offsets[r + 1]; ++k) {
        const Index i = binding.carriers[k];
        if (model.fixed[i]) continue;
        const Vec3 shift = binding.weights[k] / (model.masses[i] * mobility) * wanted;
        x[i] += shift;
        moved(i, shift);
      }
    }
  fitClusters(matchInput(model, state), x, binding.lever_clusters, state.poses);
  for (Index r : hit) state.embedded_offsets[r] += obstacle(place(r));
  return hit.size();
}

}  // namespace meshless
