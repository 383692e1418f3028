#include "meshless_surgery/body/body.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/body/cavities.h"
#include "meshless_surgery/body/filled_cells.h"
#include "meshless_surgery/geometry/lattice/cell_regions.h"
#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {

void makeElastic(BodyModel& model) {
  model.elastic = makeElasticRest(model.shape);
  if (model.lattice) {
    model.cells = std::make_shared<ElasticCells>(elasticCellsOf(model));
    model.elastic_batch = std::make_shared<ElasticBatch>(*model.cells);
    return;
  }
  for (std::size_t c = 0; c < model.elastic.size(); ++c)
    if (model.elastic[c].spread_inverse.norm() > model.most_spread_inverse) {
      model.elastic[c].spread_inverse.setZero();
      model.shape.clusters[c].moment_inverse.setZero();
      model.shape.clusters[c].linear_rank = false;
    }
  model.elastic_batch = std::make_shared<ElasticBatch>(matchInput(model), model.elastic);
}

void makeClamp(BodyModel& model) {
  model.clamp.reset();
  if (model.clamp_points.empty()) return;
  const double density = model.cell_mass / std::pow(model.lattice->spacing, 3.0);
  model.clamp = std::make_shared<Clamp>(*model.lattice, model.clamp_points, model.masses, density);
  model.any_fixed = true;
}

void makeMoments(BodyModel& model, const Material& material) {
  constexpr double kHeld = 50.0;  // enough that a cluster follows its held part, little enough to stay well conditioned
  model.match_masses = model.masses;
  if (!material.elastic())  // stress already carries what is held
    for (std::size_t i = 0; i < model.masses.size(); ++i)
      if (model.fixed[i]) model.match_masses[i] *= kHeld;
  if (model.lattice) weighCells(model, material.elastic());
  makeClamp(model);
  model.shape = makeRestShape(model.rest, model.match_masses, model.clusters);
  model.elastic.clear();
  model.elastic_batch.reset();
  model.cells.reset();
  model.highest_frequency = 0.0;
  model.specific_stiffness = material.youngs_modulus / material.density;
  model.poissons_ratio = material.poissons_ratio;
  if (material.elastic()) {
    makeElastic(model);
    const ElasticParameters parameters =
        elasticParameters(material.youngs_modulus, material.poissons_ratio, material.density);
    model.highest_frequency = model.cells ? highestFrequency(*model.cells, parameters)
                                          : highestFrequency(matchInput(model), model.elastic, parameters);
  } else if (material.mode == MatchMode::kQuadratic) {
    addQuadraticRest(model.rest, model.match_masses, model.clusters, model.shape);
  }
}

BodyModelPtr withMaterial(const BodyModelPtr& model, const Material& before, const Material& after) {
  const bool new_masses = before.density != after.density;
  const bool new_elasticity = before.youngs_modulus != after.youngs_modulus ||
                              (after.elastic() && before.poissons_ratio != after.poissons_ratio);
  const bool needs_quadratic =
      !after.elastic() && after.mode == MatchMode::kQuadratic && model->shape.quadratic.empty();
  if (!new_masses && !new_elasticity && !needs_quadratic) return model;
  auto changed = std::make_shared<BodyModel>(*model);
  const double ratio = after.density / before.density;
  changed->cell_mass *= ratio;
  if (changed->regions.empty()) {
    for (double& m : changed->masses) m *= ratio;
    changed->mass *= ratio;
  } else {
    for (RegionTissue& region : changed->regions) region = regionTissue(region.material, after);
    makeParticlesOfCells(*changed);
    changed->mass = std::accumulate(changed->masses.begin(), changed->masses.end(), 0.0);
  }
  makeMoments(*changed, after);
  return changed;
}

RegionTissue regionTissue(const Material& own, const Material& body) {
  const ElasticParameters parameters = elasticParameters(own.youngs_modulus, own.poissons_ratio, own.density);
  return {own, own.density / body.density, parameters.mu / body.youngs_modulus, parameters.lambda / body.youngs_modulus,
          parameters.youngs / body.youngs_modulus};
}

double heldShare(const BodyModel& model) {
  double held = 0.0;
  for (std::size_t i = 0; i < model.masses.size(); ++i)
    if (model.fixed[i]) held += model.masses[i];
  return std::min(1.0, held / model.mass);
}

std::vector<double> regionShares(const BodyModel& model) {
  std::vector<double> shares(model.regions.size(), 0.0);
  if (shares.empty()) return shares;
  double all = 0.0;
  for (const LatticeCell& cell : model.lattice->cells) {
    all += cell.mass_share * countSamples(cell.filled);
    for (const CellRegions::Part& part : model.lattice->regions->at(cell.place))
      shares[part.region] += cell.mass_share * countSamples(cell.filled & part.samples);
  }
  for (double& share : shares) share /= all;
  return shares;
}

std::vector<std::uint8_t> surfaceRegions(const BodyModel& model) {
  std::vector<std::uint8_t> regions;
  if (model.regions.empty()) return regions;
  regions.reserve(model.surface.vertices.size());
  for (const Vec3& v : model.surface.vertices) {
    const Index region = model.lattice->regions->regionOf(*model.lattice, v);
    regions.push_back(region == kNoIndex ? 0 : static_cast<std::uint8_t>(region + 1));
  }
  return regions;
}

void updateSurface(const BodyModel& model, BodyState& state) {
  state.surface.resize(model.surface.vertices.size());
  for (std::size_t v = 0; v < state.surface.size(); ++v)
    if (model.binding.particle[v] != kNoIndex) state.surface[v] = state.positions[model.binding.particle[v]];
  std::vector<ClusterPose> poses;
  if (!model.binding.lever_clusters.empty()) {
    poses = state.poses;  // a copy: a step's warm start must not depend on when the surface is read
    fitClusters(matchInput(model, state), state.positions, model.binding.lever_clusters, poses);
  }
  for (Index r = 0; r < model.binding.embedded.size(); ++r)
    state.surface[model.binding.embedded[r]] = embeddedPosition(model.binding, state.positions, poses, r);
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
  m.cavities = measureCavities(model, state.cavities, state.positions);
  return m;
}

}  // namespace meshless
