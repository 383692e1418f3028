// A body as contact sees it.
#pragma once

#include <vector>

#include "meshless_surgery/body/body.h"
#include "meshless_surgery/contact/contacts.h"
#include "world_impl.h"

namespace meshless {

/// How far a surface may be from the particles that it rides on [m].
double riderReachOf(const BodyModel& model);

/// What a party is; shape, surface and maps are still to come.
ContactParty partyOf(const BodyModel& model, const Material& material, BodyState& state, std::uint64_t key);

ContactParty partyOf(WorldObstacle& obstacle, std::uint64_t key);

/// How it moves, and where it is.
void readMotion(const BodyModel& model, const Material& material, const BodyState& state, double rider_reach,
                ContactParty& party);

/// The maps of a frame: a body bends within a cluster where its mode is quadratic. Maps point into `quadratic`.
void fitMaps(const BodyModel& model, const Material& material, const BodyState& state, std::vector<ContactMap>& maps,
             std::vector<QuadraticMap>& quadratic);

}  // namespace meshless
