// The samples of a truth in a body: where a body lies, what holds it, and how far its samples have moved.
#pragma once

#include <vector>

#include "meshless_surgery/body/body.h"
#include "meshless_surgery/body/body_def.h"
#include "truth_case.h"

namespace meshless::bench {

std::vector<HeldRegion> heldBy(const TruthCase& truth);
Pose placingOf(const TruthCase& truth);

/// Where the rest shape lies, from the body's own frame: by vertices that are first among those of the rest.
Pose restFrame(const Points& own, const Points& rest);

/// Displacement of each sample [m], in the body's own frame. `own` are vertices of the body as it was given.
Points movedSamples(const TruthCase& truth, const BodyModel& model, const Points& own, const Pose& placed,
                    const Points& particles);

/// Largest displacement of the truth, and the sample where it is.
double largestOf(const TruthCase& truth, std::size_t& sample);

/// RMS distance to `scale` times the truth over its largest displacement; `areas` may be empty: all equal.
double distanceTo(const TruthCase& truth, const Points& moved, const std::vector<double>& areas, double scale = 1.0);

}  // namespace meshless::bench
