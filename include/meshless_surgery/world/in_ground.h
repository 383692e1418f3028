// Who begins below the ground: contact brings it up by no more than half a mean edge a second.
#pragma once

#include <optional>
#include <string>

#include "meshless_surgery/base/result.h"
#include "meshless_surgery/body/body.h"

namespace meshless {

/// Empty where it begins at most a spacing, or 1 mm where that is more, below a `ground` at that height [m]. Else
/// refused (kInvalidArgument); of a body that is held a warning, as that may be meant.
Result<std::string> checkGround(const PreparedBody& body, const std::optional<double>& ground);

}  // namespace meshless
