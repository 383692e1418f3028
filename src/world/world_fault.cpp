// The last line: a body whose coordinates are no numbers any more, or out of all bounds, starts anew from rest where it
// was. Nothing is known to bring it about but what overflows, and a trainee's scene must outlive that too.
#include <cmath>

#include "meshless_surgery/dynamics/extent.h"
#include "world_impl.h"

namespace meshless {
namespace {

constexpr double kFarthestPlace = 1e12;  // [m]

void restAnew(WorldBody& body) {
  const BodyModel& model = *body.model;
  BodyState& state = body.state;
  Box at_rest;
  const Pose placed = state.placed;
  for (const Vec3& p : model.rest) at_rest.extend(placed * p);
  Vec3 shift = Vec3::Zero();
  // Fixed particles are where they are at rest. Others stay about where they last were.
  if (!model.any_fixed && body.bounds.min.cwiseAbs().maxCoeff() < kFarthestPlace &&
      body.bounds.max.cwiseAbs().maxCoeff() < kFarthestPlace && !body.bounds.empty())
    shift = 0.5 * (body.bounds.min + body.bounds.max) - 0.5 * (at_rest.min + at_rest.max);
  BodyState anew = restState(model, {placed.rotation, placed.translation + shift});
  anew.placed = placed;
  anew.substep = state.substep;
  anew.cavities = std::move(state.cavities);
  anew.held = std::move(state.held);
  for (Index i = 0; i < model.fixed.size(); ++i)
    if (model.fixed[i] && model.holderOf(i) < anew.held.size())
      anew.positions[i] = anew.held[model.holderOf(i)](anew.positions[i]);
  state = std::move(anew);
  for (FilledCavity& cavity : state.cavities) {
    cavity.filled_for = cavity.acting = 0.0;
    if (!std::isfinite(cavity.pressure)) cavity.pressure = 0.0;
    if (!std::isfinite(cavity.content)) cavity.content = 0.0;
  }
}

}  // namespace

void World::Impl::mendFaults() {
  faulty.assign(awake.size(), false);
  forNumbers(awake.size(), [this](std::size_t b) {
    faulty[b] = !allWithin(awake[b]->state.positions, kFarthestPlace);  // velocities are made of them
  });
  bool any = false;
  for (std::size_t b = 0; b < awake.size(); ++b) {
    if (!faulty[b]) continue;
    WorldBody* const body = awake[b];
    restAnew(*body);
    body->surface_current = false;
    body->still_for = 0.0;
    any = true;
    ++report.mended;
    say(EventType::kFault, body->name, 0,
        "the coordinates of " + body->name + " were not finite any more; it starts anew from rest");
  }
  if (!any) return;
  for (Attachment& attachment : attachments)
    for (Fibre& fibre : attachment.fibres) {
      fibre.force.setZero();
      fibre.tension = 0.0;
    }
  surface_contacts.clear();
  contacts_current = false;
  batches_current = false;
}

}  // namespace meshless
