// How much work an island needs.
#include <algorithm>
#include <cmath>
#include <limits>

#include "contacts_impl.h"

namespace meshless {
namespace {

// What a sweep leaves spreads through a stack as heat does, and grows with the fall in a substep: so much work do
// stacks need to stand (found with towers of cubes).
constexpr double kStackWork = 4.75;
constexpr double kLayerShare =
    0.7;                         // of the height of a body that is long in one direction alone: a splinter is no layer
constexpr double kCalm = 0.02;   // of the size, how far particles go apart in a frame
constexpr int kFewSubsteps = 4;  // below it an island of several bodies is swept so often:
constexpr int kFewSweeps = 8;    // what sweeps leave would make a stack rock
constexpr int kCaughtPasses = 24;  // of an island in which something was caught: it has to stop at once
// Contacts that such an island sweeps in a substep, or so: more are a heap, which no sweeps would sort out.
constexpr Index kMostSwept = 20000;
constexpr int kLeastCaughtPasses = 4;

// Even: there and back.
int caughtPasses(Index contacts) {
  return std::clamp(static_cast<int>(kMostSwept / std::max<Index>(1, contacts)) / 2 * 2, kLeastCaughtPasses,
                    kCaughtPasses);
}

}  // namespace

/// Sweeps in a frame of h [s] for an island.
double stackWork(const ContactScene& scene, const std::vector<ShapeCollider>& colliders, const IslandPlan& plan,
                 Index island, double h) {
  const double gravity = scene.gravity.norm();
  if (!(gravity > 0.0)) return 0.0;
  const Vec3 up = -scene.gravity / gravity;
  double low = std::numeric_limits<double>::infinity(), high = -low, size = 0.0;
  for (Index k = plan.collider_offsets[island]; k < plan.collider_offsets[island + 1]; ++k) {
    const ShapeCollider& collider = colliders[plan.colliders[k]];
    const Vec3 centre = 0.5 * (collider.bounds.min + collider.bounds.max);
    const double reach = 0.5 * up.cwiseAbs().dot(collider.bounds.max - collider.bounds.min);
    low = std::min(low, up.dot(centre) - reach);
    high = std::max(high, up.dot(centre) + reach);
    size += std::max(collider.shape->size(), kLayerShare * 2.0 * reach);
  }
  const Index count = plan.collider_offsets[island + 1] - plan.collider_offsets[island];
  if (count < 2 || !(size > 0.0)) return 0.0;
  size /= count;
  const double layers = std::max(1.0, (high - low) / size);
  return kStackWork * h * std::sqrt(gravity / size) * std::min(layers * layers, 1e4);
}

void Contacts::Impl::choosePasses(const std::vector<ShapeCollider>& colliders, double substep) {
  plan.passes.resize(plan.size());
  plan.calm.resize(plan.size());
  const double substeps = std::max(1.0, std::round(frame / substep));
  const bool few = substeps < kFewSubsteps;
  for (Index island = 0; island < plan.size(); ++island) {
    const double work = stackWork(scene, colliders, plan, island, frame) / substeps;
    const bool alone = plan.collider_offsets[island + 1] - plan.collider_offsets[island] < 2;
    const int least = few ? (alone ? 2 : kFewSweeps) : 1;  // even: there and back
    plan.passes[island] = std::max(least, static_cast<int>(std::ceil(std::min(work, kMostPasses))));
    plan.calm[island] = 1;
    for (Index k = plan.collider_offsets[island]; k < plan.collider_offsets[island + 1]; ++k) {
      const ShapeCollider& collider = colliders[plan.colliders[k]];
      if (!(collider.spread * frame < kCalm * collider.shape->size())) plan.calm[island] = 0;
    }
    if (caught.empty()) continue;
    const Index count = plan.contact_offsets[island + 1] - plan.contact_offsets[island];
    if (anyCaught(island)) plan.passes[island] = std::max(plan.passes[island], caughtPasses(count));
  }
}

bool Contacts::Impl::anyCaught(Index island) const {
  for (Index k = plan.contact_offsets[island]; k < plan.contact_offsets[island + 1]; ++k)
    if (contacts[plan.contacts[k]].caught) return true;
  return false;
}

}  // namespace meshless
