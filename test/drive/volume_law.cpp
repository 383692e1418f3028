#include "drive/volume_law.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "drive/words.h"

namespace meshless {

std::vector<PieceVolume> volumesOf(const Seen& seen) {
  std::vector<PieceVolume> pieces;
  for (const SeenBody& body : seen.bodies)
    if (!body.handled && body.rest_volume > 0.0 && !body.surface.empty())
      pieces.push_back({seen.time, body.name, body.elastic, signedVolume(body.surface) / body.rest_volume,
                        body.mass / body.rest_volume * seen.gravity.norm() * body.diagonal * body.compressibility});
  return pieces;
}

Finding volumeLaw(const std::vector<PieceVolume>& pieces, const VolumeBands& bands) {
  Finding worst;
  for (const PieceVolume& piece : pieces) {
    VolumeBand band;
    const auto found = bands.find(rootOf(piece.name));
    if (!piece.elastic && found != bands.end()) band = found->second;
    band.low -= piece.pressed;
    worst.take(piece.ratio < 1.0 ? (1.0 - piece.ratio) / (1.0 - band.low) : (piece.ratio - 1.0) / (band.high - 1.0),
               words(piece.time, " s: ", piece.name, " has ", piece.ratio, " of its volume (", band.low, " to ",
                     band.high, ")"));
  }
  return worst;
}

void widenBands(const std::vector<PieceVolume>& pieces, VolumeBands& bands) {
  for (const PieceVolume& piece : pieces) {
    VolumeBand& band = bands[rootOf(piece.name)];
    if (!(std::abs(piece.ratio) < 10.0)) continue;  // a fault of its own
    band.low = std::min(band.low, piece.ratio - kBandMargin);
    band.high = std::max(band.high, piece.ratio + kBandMargin);
  }
}

}  // namespace meshless
