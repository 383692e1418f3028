// Highest frequency of a linear body. Private to dynamics.
#pragma once

#include <functional>
#include <vector>

#include "meshless_surgery/base/types.h"

namespace meshless {

/// `accelerate` writes -M^-1 K displacements, with K symmetric and not negative. The root of the largest eigenvalue of
/// M^-1 K, from below. Lanczos' method (Golub and Van Loan 2013, sec. 10.1) without reorthogonalisation: what is lost
/// by that repeats eigenvalues and does not move the largest.
double highestFrequency(const std::vector<double>& masses,
                        const std::function<void(const Points& displacements, Points& accelerations)>& accelerate);

}  // namespace meshless
