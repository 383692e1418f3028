// The plugin's programs for the graphics card, from media/.
#pragma once

#include <string>

namespace meshless {

/// Names of Ogre's programs; where the driver does not take them, why.
struct TissueProgram {
  std::string vertex, fragment;
  std::string refused;

  bool usable() const { return refused.empty(); }
};

/// Loaded at the first call, which needs a window.
const TissueProgram& tissueProgram();

}  // namespace meshless
