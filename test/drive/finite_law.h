// Everything is finite and near.
#pragma once

#include "drive/finding.h"
#include "drive/seen.h"

namespace meshless {

constexpr double kReach = 10.0;  // [m] from the origin: a scene is a table

/// Surfaces, particles, momenta and energies are finite, nothing is farther than kReach, and no body had to be mended.
Finding finiteLaw(const Seen& seen);

}  // namespace meshless
