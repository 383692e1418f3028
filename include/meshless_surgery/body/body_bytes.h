// How much memory bodies hold.
#pragma once

#include "meshless_surgery/base/bytes.h"
#include "meshless_surgery/body/deform.h"

namespace meshless {

std::size_t bytesOf(const BodyModel& model);
std::size_t bytesOf(const BodyState& state);
std::size_t bytesOf(const StepScratch& scratch);

}  // namespace meshless
