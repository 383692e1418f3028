// A body as contact in rest shapes sees it.
#pragma once

#include <vector>

#include "meshless_surgery/body/body.h"
#include "meshless_surgery/contact/contacts.h"
#include "world_impl.h"

namespace meshless {

/// How far embedded vertices may be beyond the bounds of the particles [m].
double embeddedReachOf(const BodyModel& model);

/// All of a collider but shape, surface, maps and motion.
ShapeCollider shapeColliderOf(const BodyModel& model, const Material& material, BodyState& state, std::uint64_t key);

ShapeCollider shapeColliderOf(WorldObstacle& obstacle, std::uint64_t key);

/// How it moves, and where it is.
void readMotion(const BodyModel& model, const Material& material, const BodyState& state, double embedded_reach,
                ShapeCollider& collider);

/// The maps of a frame: a body bends within a cluster where its mode is quadratic. Maps point into `quadratic`.
void fitMaps(const BodyModel& model, const Material& material, const BodyState& state, std::vector<ContactMap>& maps,
             std::vector<QuadraticMap>& quadratic);

}  // namespace meshless
