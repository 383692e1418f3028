#include "meshless_surgery/body/body_load.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "meshless_surgery/body/deform.h"

namespace meshless {
namespace {

std::vector<Wrench> clampLoads(const BodyModel& model, const BodyState& state) {
  std::vector<Wrench> loads;
  const double density = model.cell_mass / std::pow(model.lattice->spacing, 3.0), rate = clampRate(model);
  // What the springs of a slowed body hold at rest is its softer stress (docs/method.md, 11 and 12); this is the true
  // one.
  double stiffness = rate * rate;
  if (const double h = state.substep; h > 0.0)
    stiffness = std::min(1.0 / (h * h), stiffness) / stiffnessFactor(model, state, h);
  for (const ClampPoint& point : model.clamp_points) {
    const LatticeCell& cell = model.lattice->cells[point.cell];
    Vec3 now = Vec3::Zero();
    for (int k = 0; k < 8; ++k) now += trilinearWeight(k, point.at) * state.positions[cell.corners[k]];
    Vec3 held = state.placed * model.lattice->restPlace(cell, point.at);
    if (point.region < state.held.size()) held = state.held[point.region](held);
    const Vec3 force = stiffness * springMass(*model.lattice, point, density) * (held - now);
    if (loads.size() <= point.region) loads.resize(point.region + 1);
    loads[point.region].force += force;
    loads[point.region].torque += now.cross(force);
  }
  return loads;
}

Mat3 cauchyStress(const Mat3& stress, const Mat3& gradient) {
  const double j = gradient.determinant();
  if (!(j > 0.0)) return Mat3::Constant(std::numeric_limits<double>::quiet_NaN());
  const Mat3 cauchy = stress * gradient.transpose() / j;
  return 0.5 * (cauchy + cauchy.transpose());
}

}  // namespace

BodyLoad loadOf(const BodyModel& model, const Material& material, const BodyState& state) {
  BodyLoad load;
  load.clamps = clampLoads(model, state);
  ElasticParameters parameters = ownElasticity(model, material, state.stiffened);
  const std::vector<RelaxedStrain>* relaxed = nullptr;
  if (material.relaxes() && !state.relaxed.empty()) {
    parameters.relaxation = relaxationStep(material.relaxation, 0.0);
    relaxed = &state.relaxed;
  }
  std::vector<ClusterPose> poses = state.cells;
  const std::vector<PlasticShape>* const plastic = &state.plastic_cells;
  load.elastic_energy =
      elasticEnergy(*model.cells, parameters, state.positions, poses, state.swelling, plastic, relaxed);
  const std::vector<Mat3> stresses =
      cellStresses(*model.cells, parameters, state.positions, poses, state.swelling, plastic, relaxed);
  const Mat3 back = state.placed.rotation.toRotationMatrix().transpose();
  for (std::size_t c = 0; c < stresses.size(); ++c)
    load.cells.push_back(
        {poses[c].centre, poses[c].deformation * back, cauchyStress(stresses[c], poses[c].deformation)});
  return load;
}

}  // namespace meshless
