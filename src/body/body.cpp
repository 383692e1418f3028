#include "meshless_surgery/body/body.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/body/cavities.h"
#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/body/filled_cells.h"
#include "meshless_surgery/geometry/lattice/cell_regions.h"
#include "meshless_surgery/geometry/lattice/fibre_directions.h"
#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {

namespace {

// Of the weight that presses on the bottom of a column as long as a body: so stiff are the cells under an appearance
// material. A column of twice that stiffness is three quarters as high under its weight.
constexpr double kCarriedWeight = 2.0;
constexpr double kStandardGravity = 9.81;  // [m/s^2]
constexpr double kCarryingPoisson = 0.45;  // of these cells

// Of its length that a body may sink which stands on one of its particles, drawn to its only goal, where it needs no
// cells to stand on.
constexpr double kSinks = 0.05;

constexpr double kNothing = 1e-9;         // of the spacing that a particle would move in a substep: not worth a ramp
constexpr double kLeastStiffened = 1e-5;  // of its stiffness that a body has, whatever it was before
constexpr double kAtOnce = 0.99;          // so much of it may come at once

// [m/s^2] of every particle by what the body does to itself.
Points ownAccelerations(const BodyModel& model, BodyState state, const Material& material, double h) {
  StepScratch scratch;
  MatchCounters uncounted;
  state.cavities.clear();  // what fills them goes on
  Points accelerations = state.velocities;
  matchAndMove(model, material, Vec3::Zero(), h, state, scratch, uncounted);
  for (std::size_t i = 0; i < accelerations.size(); ++i)
    accelerations[i] = (state.velocities[i] - accelerations[i]) / h;
  return accelerations;
}

// Few particles, all drawn to one stiff goal, move as one: a cube of a heap. What of a contact does not move all of
// them is (1 - alpha)^2 of it (World::Impl::stepSurfaces).
bool standsOnItsGoal(const BodyModel& model, const Material& material) {
  if (material.elastic() || model.clusters.size() != 1 || model.isHeld() || !material.volume.points.empty())
    return false;
  const double yields = 1.0 - material.alpha, particles = static_cast<double>(model.rest.size());
  return yields * yields * kStandardGravity * particles < kSinks * model.length * goalStiffness(material);
}

}  // namespace

ElasticParameters elasticityOf(const Material& material, double length) {
  if (material.elastic()) return elasticParameters(material.youngs_modulus, material.poissons_ratio, material.density);
  return elasticParameters(kCarriedWeight * kStandardGravity * length * material.density, kCarryingPoisson,
                           material.density);
}

ElasticParameters ownElasticity(const BodyModel& model, const Material& material, double factor) {
  ElasticParameters own =
      elasticParameters(factor * model.specific_stiffness * material.density, model.poissons_ratio, material.density);
  if (material.elastic()) own.stiffening = material.stiffening, own.asymmetry = material.asymmetry;
  own.fibres = factor * model.specific_fibres * material.density;
  own.fibre_stiffening = material.fibres.stiffening;
  return own;
}

ElasticParameters specificElasticity(const BodyModel& model) {
  ElasticParameters own = elasticParameters(model.specific_stiffness, model.poissons_ratio, 1.0);
  own.fibres = model.specific_fibres;
  return own;
}

void makeElastic(BodyModel& model) {
  if (model.lattice) {
    model.cells = std::make_shared<ElasticCells>(elasticCellsOf(model));
    model.elastic_batch = std::make_shared<ElasticBatch>(*model.cells);
  } else {
    model.elastic = makeElasticRest(model.shape);
    model.elastic_batch = std::make_shared<ElasticBatch>(matchInput(model), model.elastic);
  }
}

bool BodyModel::isHeldBy(std::uint32_t entry) const {
  if (std::any_of(clamp_points.begin(), clamp_points.end(),
                  [entry](const ClampPoint& point) { return point.region == entry; }))
    return true;
  for (Index i = 0; i < fixed.size(); ++i)
    if (fixed[i] && holderOf(i) == entry) return true;
  return false;
}

void makeClamp(BodyModel& model) {
  model.clamp.reset();
  if (model.clamp_points.empty()) return;
  const double density = model.cell_mass / std::pow(model.lattice->spacing, 3.0);
  model.clamp = std::make_shared<Clamp>(*model.lattice, model.clamp_points, model.masses, density);
  model.any_fixed = true;
}

void makeTissue(BodyModel& model, const Material& material) {
  constexpr double kHeld = 50.0;  // enough that a cluster follows its held part, little enough to stay well conditioned
  makeClamp(model);
  model.elastic.clear();
  model.elastic_batch.reset();
  model.cells.reset();
  model.highest_frequency = 0.0;
  model.match_masses = model.masses;
  if (material.elastic() && model.lattice) {
    model.clusters = ClusterSet();
    model.shape = RestShape();
  } else {
    if (!material.elastic())  // stress already carries what is held
      for (std::size_t i = 0; i < model.masses.size(); ++i)
        if (model.fixed[i]) model.match_masses[i] *= kHeld;
    if (model.clusters.size() == 0) model.clusters = makeClusters(model.rest, model.graph, model.grouping);
    model.shape = makeRestShape(model.rest, model.match_masses, model.clusters);
    if (!material.elastic() && material.mode == MatchMode::kQuadratic)
      addQuadraticRest(model.rest, model.match_masses, model.clusters, model.shape);
  }
  model.specific_fibres = material.hasFibres() && model.lattice ? material.fibres.stiffness / material.density : 0.0;
  if (model.specific_fibres > 0.0 && model.fibres.empty())
    model.fibres = fibreDirections(*model.lattice, model.fibre_direction);
  const ElasticParameters own = elasticityOf(material, model.length);
  model.specific_stiffness = own.youngs / own.density;
  model.poissons_ratio = material.elastic() ? material.poissons_ratio : kCarryingPoisson;
  if (!material.elastic() && (!model.lattice || standsOnItsGoal(model, material))) return;
  makeElastic(model);
  model.highest_frequency =
      model.cells ? highestFrequency(*model.cells, specificElasticity(model))
                  : highestFrequency(matchInput(model), model.elastic, own);
}

BodyModelPtr withMaterial(const BodyModelPtr& model, const Material& before, const Material& after) {
  const bool new_masses = before.density != after.density;
  const bool new_elasticity = before.youngs_modulus != after.youngs_modulus ||
                              (after.elastic() && before.poissons_ratio != after.poissons_ratio) ||
                              before.hasFibres() != after.hasFibres() ||
                              (after.hasFibres() && before.fibres.stiffness != after.fibres.stiffness);
  const bool needs_quadratic =
      !after.elastic() && after.mode == MatchMode::kQuadratic && model->shape.quadratic.empty();
  const bool other_support = standsOnItsGoal(*model, before) != standsOnItsGoal(*model, after);
  if (!new_masses && !new_elasticity && !needs_quadratic && !other_support) return model;
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
  makeTissue(*changed, after);
  return changed;
}

BodyState restState(const BodyModel& model, const Pose& placed) {
  BodyState state;
  state.placed = placed;
  for (const Vec3& p : model.rest) state.positions.push_back(placed * p);
  state.velocities.assign(model.rest.size(), Vec3::Zero());
  ClusterPose pose;
  pose.rotation = placed.rotation;
  state.poses.assign(model.clusters.size(), pose);
  state.cells.assign(model.lattice ? model.lattice->cells.size() : 0, pose);
  if (model.isPrestretched()) {
    state.plastic_cells.assign(state.cells.size(), model.unstressed);
    state.stretch = model.unstressed.stiffening;
  }
  updateSurface(model, state);
  return state;
}

void fitPoses(const BodyModel& model, BodyState& state) {
  if (state.poses.size() == model.clusters.size()) return;
  state.plastic.clear();
  ClusterPose pose;
  pose.rotation = state.placed.rotation;
  state.poses.assign(model.clusters.size(), pose);
  fitClusters(matchInput(model), state.positions, state.poses);
}

double stiffenedBy(const BodyModel& before, const Material& old, const BodyModel& model, const Material& material,
                   double h, const BodyState& state) {
  BodyState still = state;
  for (Vec3& v : still.velocities) v.setZero();
  const auto pulls = [&](const BodyModel& of, const Material& made_of) {  // where nothing is slowed
    BodyState then = still;
    fitPoses(of, then);
    return ownAccelerations(of, then, made_of, std::min(h, longestSubstep(of, then)));
  };
  const Points then = pulls(before, old);
  still.stiffened = 1.0;
  const Points now = pulls(model, material);
  double common = 0.0, squared = 0.0, most = 0.0;
  for (std::size_t i = 0; i < now.size(); ++i) {
    if (model.fixed[i]) continue;
    common += model.masses[i] * now[i].dot(then[i]);
    squared += model.masses[i] * now[i].squaredNorm();
    most = std::max(most, now[i].norm());
  }
  if (!(h * h * most > kNothing * model.spacing) || common > kAtOnce * squared) return 1.0;
  return std::max(kLeastStiffened, common / squared);
}

RegionTissue regionTissue(const Material& own, const Material& body) {
  const ElasticParameters parameters = elasticParameters(own.youngs_modulus, own.poissons_ratio, own.density);
  return {own,
          own.density / body.density,
          parameters.mu / body.youngs_modulus,
          parameters.lambda / body.youngs_modulus,
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
  carriedPlaces(model.binding, state.positions, state.surface);
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
