#include "meshless_surgery/world/in_ground.h"

#include <algorithm>

#include "meshless_surgery/base/number_text.h"
#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace {

constexpr double kLeastDepth = 1e-3;  // [m] that is put up with, as a cell's width is: a surface may be of that grain

}  // namespace

std::string warnOfGround(const PreparedBody& body, const std::optional<double>& ground) {
  if (!ground || body.state.surface.empty()) return {};
  const double depth = *ground - boundsOf(body.state.surface).min.z();
  if (!(depth > std::max(kLeastDepth, body.model->spacing))) return {};
  const std::string deep = numberText(depth, 3);
  return "it begins " + deep + " m below the ground, which is at z = " + numberText(*ground, 3) + " m, and " +
         (body.model->any_fixed ? "is pressed up against what holds it" : "comes up by some mm a second") +
         "; put it higher by " + deep + " m, or take a scene with `ground: none`";
}

}  // namespace meshless
