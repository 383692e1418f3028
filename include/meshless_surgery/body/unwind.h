// A body of several clusters can come to rest wound up in itself, each cluster nearly in its own shape: a cross section
// turned inside out stays so as a ring of rubber does. Nothing of it knows then that the whole is wrong.
#pragma once

#include "meshless_surgery/body/deform.h"

namespace meshless {

/// Whether clusters that share particles are turned against each other by more than 120 degrees while nothing moves
/// but the body as a whole. Of bodies that are let go, those that were seen to rest so were wound up (by 144 degrees
/// and more), whatever the mode. False for what has one cluster, fixed particles, flows, or is being eased. Reads the
/// poses of the last substep, and costs a quaternion product a cluster where nothing is wound up.
bool isWoundUp(const BodyModel& model, const Material& material, const BodyState& state);

/// In place of matchAndMove() while state.unwinding: the body moves as a whole, with its momentum, and its particles go
/// to the rest shape that fits all of them best. That way is not fed into velocities. Sets state.unwinding to false
/// once it is nearly there, and the clusters do the rest.
void unwind(const BodyModel& model, const Vec3& gravity, double h, BodyState& state, StepScratch& scratch);

}  // namespace meshless
