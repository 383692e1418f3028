// A solid keeps its volume.
#pragma once

#include "drive/finding.h"
#include "drive/seen.h"

namespace meshless {

/// Of a piece, at one time.
struct PieceVolume {
  double time = 0.0;  // [s]
  std::string name;
  bool elastic = false;
  double ratio = 1.0;    // present over rest volume
  double pressed = 0.0;  // share of it that a column as high as the body's diagonal presses out by its weight
};

/// Of the pieces that no hand is on: what is stretched may grow by what its Poisson's ratio says. A surface is needed.
std::vector<PieceVolume> volumesOf(const Seen& seen);

/// Of present over rest volume.
struct VolumeBand {
  double low = 0.9, high = 1.1;
};
/// By the root's name, for appearance materials: the volumes of the same body in the same scene without cuts.
using VolumeBands = std::map<std::string, VolumeBand>;

/// Each piece whose material is elastic, between 0.9, less what weight may press out, and 1.1 of its rest volume; the
/// others in their root's band, and in the same where it has none.
Finding volumeLaw(const std::vector<PieceVolume>& pieces, const VolumeBands& bands);

/// Widens each body's band by what it did, and kBandMargin.
void widenBands(const std::vector<PieceVolume>& pieces, VolumeBands& bands);
constexpr double kBandMargin = 0.02;

}  // namespace meshless
