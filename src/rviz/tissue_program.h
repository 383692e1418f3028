// The plugin's programs for the graphics card, from media/.
#pragma once

#include <array>
#include <string>

namespace meshless {

/// Names of Ogre's programs; where the driver does not take them, why.
struct TissueProgram {
  std::string vertex;
  std::array<std::string, 7> patterned;  // by Look.noise
  std::string even;                      // without a pattern or bumps
  std::string by_uv;                     // an image by texture coordinates, which are in place of rest positions
  std::string refused;

  bool usable() const { return refused.empty(); }
};

/// Loaded at the first call, which needs a window.
const TissueProgram& tissueProgram();

}  // namespace meshless
