#include "meshless_surgery/body/preserve.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace {

constexpr int kSweeps = 2;
constexpr double kSwellingRate = 0.3;  // of the relative error, a third for each axis, in one substep
constexpr double kLeastSwelling = 0.6, kMostSwelling = 1.6;
constexpr double kMostOfSpacing = 0.1;  // [spacing] that a particle moves in a sweep

Points areaGradient(const Points& x, const std::vector<Triangle>& triangles) {
  Points gradient(x.size(), Vec3::Zero());
  for (const Triangle& t : triangles) {
    const Vec3 normal = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]);
    const double length = normal.norm();
    if (!(length > 0.0)) continue;
    for (int k = 0; k < 3; ++k) gradient[t[k]] += 0.5 * normal.cross(x[t[(k + 2) % 3]] - x[t[(k + 1) % 3]]) / length;
  }
  return gradient;
}

Points onParticles(const BodyModel& model, const Points& of_vertices) {
  Points gradient(model.rest.size(), Vec3::Zero());
  addToParticles(model.binding, of_vertices, gradient);
  return gradient;
}

// Moves along the gradient until `missing` is made up for to first order.
void close(const BodyModel& model, Points gradient, double missing, BodyState& state, StepScratch& scratch) {
  for (const TouchedParticle& t : scratch.touched) {
    Vec3& g = gradient[t.particle];
    g -= t.normal.dot(g) * t.normal;
  }
  double mobility = 0.0;
  for (std::size_t i = 0; i < gradient.size(); ++i)
    if (!model.fixed[i]) mobility += gradient[i].squaredNorm() / model.masses[i];
  if (!(mobility > 0.0)) return;
  double step = missing / mobility, farthest = 0.0;
  for (std::size_t i = 0; i < gradient.size(); ++i)
    if (!model.fixed[i]) farthest = std::max(farthest, std::abs(step) * gradient[i].norm() / model.masses[i]);
  if (farthest > kMostOfSpacing * model.spacing) step *= kMostOfSpacing * model.spacing / farthest;
  for (std::size_t i = 0; i < gradient.size(); ++i) {
    if (model.fixed[i]) continue;
    const Vec3 shift = step / model.masses[i] * gradient[i];
    state.positions[i] += shift;
    scratch.previous[i] += shift;
  }
}

}  // namespace

void preserve(const BodyModel& model, const Material& material, BodyState& state, StepScratch& scratch,
              PreserveCounters& counters) {
  const bool volume = !material.volume.points.empty() && model.solid;
  const bool area = !material.area.points.empty();
  if (!volume) state.swelling = 1.0;
  if (!volume && !area) return;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    if (volume) {
      updateSurface(model, state);
      const double now = signedVolume(state.surface, model.surface.triangles);
      const double error = now / model.rest_volume - 1.0;
      const double share = material.volume.at(std::abs(error));
      if (sweep == 0)
        state.swelling =
            std::clamp(state.swelling * (1.0 + share * kSwellingRate * (1.0 / std::max(0.1, 1.0 + error) - 1.0) / 3.0),
                       kLeastSwelling, kMostSwelling);
      if (share > 0.0) {
        close(model, onParticles(model, volumeGradient(state.surface, model.surface.triangles)),
              share * (model.rest_volume - now), state, scratch);
        ++counters.gradients;
      }
    }
    if (area) {
      updateSurface(model, state);
      const double now = surfaceArea(state.surface, model.surface.triangles);
      const double share = material.area.at(std::abs(now / model.rest_area - 1.0));
      if (share > 0.0) {
        close(model, onParticles(model, areaGradient(state.surface, model.surface.triangles)),
              share * (model.rest_area - now), state, scratch);
        ++counters.gradients;
      }
    }
  }
}

}  // namespace meshless
