// A body's volume and the area of its surface, held as hard as the force response curves of its material say.
#pragma once

#include "meshless_surgery/body/deform.h"

namespace meshless {

/// What one substep did; zero where a material preserves nothing.
struct PreserveCounters {
  std::size_t gradients = 0;

  PreserveCounters& operator+=(const PreserveCounters& other) {
    gradients += other.gradients;
    return *this;
  }
};

/// Moves the particles along the gradients of volume and area over their masses, so that the share of the error that
/// the curve gives is closed; twice, for the gradients change on the way. Fixed particles stay, and what is touched
/// keeps out of its obstacle. The motion is not fed into velocities: scratch.previous moves along. Reads and writes
/// positions, scratch.previous and state.swelling (so that the layers inside follow). Volume is of solids
/// alone.
void preserve(const BodyModel& model, const Material& material, BodyState& state, StepScratch& scratch,
              PreserveCounters& counters);

}  // namespace meshless
