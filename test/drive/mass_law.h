// What is cut stays as much as it was.
#pragma once

#include "drive/finding.h"
#include "drive/seen.h"

namespace meshless {

/// Sums over the pieces of each body of the scene.
struct MassBooks {
  std::map<std::string, double> mass;         // [kg] by the root's name
  std::map<std::string, double> rest_volume;  // [m^3]
};
MassBooks booksOf(const Seen& seen);

/// The pieces of each body together have its mass (to 1e-9 of it) and its rest volume (to 1e-3).
Finding massLaw(const MassBooks& start, const Seen& seen);

}  // namespace meshless
