// What the forms of a report share.
#pragma once

#include "meshless_surgery/training/report.h"

namespace meshless {

std::string outcomeOf(const Training& training);
/// With 17 digits; empty where it is not finite.
std::string numberOf(double value);
/// Null where that metric does not count.
std::vector<std::string> allowedIn(const TaskDef& task);
const WeightedMetric* weightedOf(const Training& training, const std::string& name);

}  // namespace meshless
