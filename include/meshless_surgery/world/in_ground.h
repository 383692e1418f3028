// Who begins below the ground: contact brings it up by no more than half a mean edge a second.
#pragma once

#include <optional>
#include <string>

#include "meshless_surgery/body/body.h"

namespace meshless {

/// Empty where it begins at most a spacing, or 1 mm where that is more, below a `ground` at that height [m]. It is no
/// fault: scenes may mean it.
std::string warnOfGround(const PreparedBody& body, const std::optional<double>& ground);

}  // namespace meshless
