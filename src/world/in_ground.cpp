#include "meshless_surgery/world/in_ground.h"

#include <algorithm>

#include "meshless_surgery/base/number_text.h"
#include "meshless_surgery/geometry/mesh/measures.h"

namespace meshless {
namespace {

constexpr double kLeastDepth = 1e-3;  // [m] that is put up with, as a cell's width is: a surface may be of that grain

}  // namespace

Result<std::string> checkGround(const PreparedBody& body, const std::optional<double>& ground) {
  if (!ground || body.state.surface.empty()) return std::string();
  const double depth = *ground - boundsOf(body.state.surface).min.z();
  const double most = std::max(kLeastDepth, body.model->spacing);
  if (!(depth > most)) return std::string();
  const std::string begins = numberText(depth, 3) + " m below the ground, which is at z = " + numberText(*ground, 3);
  if (body.model->any_fixed)
    return "it begins " + begins +
           " m and presses it up against what holds it; if that is not meant, put it higher or "
           "take a scene with `ground: none`";
  return Error{ErrorCode::kInvalidArgument,
               "body '" + body.def.name + "' would begin " + begins + " m; accepted: up to " + numberText(most, 3) +
                   " m below it. Put it higher by " + numberText(depth, 3) + " m, or take a scene with `ground: none`"};
}

}  // namespace meshless
