// A solid keeps its volume.
#pragma once

#include "meshless_surgery/drive/finding.h"
#include "meshless_surgery/drive/seen.h"

namespace meshless {

/// Of present over rest volume.
struct VolumeBand {
  double low = 0.9, high = 1.1;
};
/// By the root's name, of materials for looks: what the same body does in the same scene without cuts.
using VolumeBands = std::map<std::string, VolumeBand>;

/// Each piece whose material is elastic, between 0.9 and 1.1 of its rest volume; the others in their root's band, which
/// is no narrower than that; without a band they are not looked at. Bodies that a hand is on are not looked at: what is
/// stretched may grow by what its Poisson's ratio says.
Finding volumeLaw(const Seen& seen, const VolumeBands& bands);

/// Widens each body's band by what it does now, and kBandMargin.
void widenBands(const Seen& seen, VolumeBands& bands);
constexpr double kBandMargin = 0.02;

}  // namespace meshless
