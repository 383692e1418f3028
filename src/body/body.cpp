#include "meshless_surgery/body/body.h"

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/geometry/measures.h"

namespace meshless {

std::vector<double> matchMasses(const std::vector<double>& masses, const std::vector<bool>& fixed) {
  constexpr double kHeld = 50.0;  // enough that a cluster follows its held part, little enough to stay well conditioned
  std::vector<double> heavy = masses;
  for (std::size_t i = 0; i < heavy.size(); ++i)
    if (fixed[i]) heavy[i] *= kHeld;
  return heavy;
}

BodyModelPtr withMaterial(const BodyModelPtr& model, const Material& before, const Material& after) {
  const bool new_masses = before.density != after.density;
  const bool needs_quadratic = after.mode == MatchMode::kQuadratic && model->shape.quadratic.empty();
  if (!new_masses && !needs_quadratic) return model;
  auto changed = std::make_shared<BodyModel>(*model);
  if (new_masses) {
    const double ratio = after.density / before.density;
    for (double& m : changed->masses) m *= ratio;
    for (double& m : changed->match_masses) m *= ratio;
    changed->mass *= ratio;
    for (double& m : changed->binding.mobility) m /= ratio;
    const bool quadratic = !changed->shape.quadratic.empty();
    changed->shape = makeRestShape(changed->rest, changed->match_masses, changed->clusters);
    if (quadratic || needs_quadratic)
      addQuadraticRest(changed->rest, changed->match_masses, changed->clusters, changed->shape);
  } else {
    addQuadraticRest(changed->rest, changed->match_masses, changed->clusters, changed->shape);
  }
  return changed;
}

void updateSurface(const BodyModel& model, BodyState& state) {
  state.surface.resize(model.surface.vertices.size());
  for (std::size_t v = 0; v < state.surface.size(); ++v)
    if (model.binding.particle[v] != kNoIndex) state.surface[v] = state.positions[model.binding.particle[v]];
  if (model.binding.riders.empty()) return;
  std::vector<ClusterPose> poses = state.poses;  // a step's warm start must not depend on who looks
  fitClusters(matchInput(model), state.positions, poses);
  for (Index r = 0; r < model.binding.riders.size(); ++r)
    state.surface[model.binding.riders[r]] = riderPosition(model, poses, r) + state.rider_offsets[r];
}

BodyMeasures measureBody(const BodyModel& model, const BodyState& state) {
  BodyMeasures m;
  m.area = surfaceArea(state.surface, model.surface.triangles);
  if (model.solid) m.volume = signedVolume(state.surface, model.surface.triangles);
  const Vec3 origin = state.positions[0];
  Vec3 moment = Vec3::Zero();
  for (std::size_t i = 0; i < state.positions.size(); ++i) {
    moment += model.masses[i] * (state.positions[i] - origin);
    m.linear_momentum += model.masses[i] * state.velocities[i];
    m.kinetic_energy += 0.5 * model.masses[i] * state.velocities[i].squaredNorm();
  }
  m.centre_of_mass = origin + moment / model.mass;
  m.velocity = m.linear_momentum / model.mass;
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    m.angular_momentum += model.masses[i] * (state.positions[i] - m.centre_of_mass).cross(state.velocities[i]);
  return m;
}

}  // namespace meshless
