#include "meshless_surgery/drive/volume_law.h"

#include <algorithm>

#include "meshless_surgery/geometry/measures.h"
#include "words.h"

namespace meshless {
namespace {

bool isMeasured(const SeenBody& body) { return !body.handled && body.rest_volume > 0.0 && !body.surface.empty(); }

}  // namespace

Finding volumeLaw(const Seen& seen, const VolumeBands& bands) {
  Finding worst;
  for (const SeenBody& body : seen.bodies) {
    if (!isMeasured(body)) continue;
    VolumeBand band;
    const auto found = bands.find(rootOf(body.name));
    if (!body.elastic) {
      if (found == bands.end()) continue;
      band = found->second;
    }
    const double ratio = signedVolume(body.surface) / body.rest_volume;
    worst.take(ratio < 1.0 ? (1.0 - ratio) / (1.0 - band.low) : (ratio - 1.0) / (band.high - 1.0),
               words(body.name, " has ", ratio, " of its volume (", band.low, " to ", band.high, ")"));
  }
  return worst;
}

void widenBands(const Seen& seen, VolumeBands& bands) {
  for (const SeenBody& body : seen.bodies) {
    if (!isMeasured(body)) continue;
    VolumeBand& band = bands[rootOf(body.name)];
    const double ratio = signedVolume(body.surface) / body.rest_volume;
    if (!(ratio > -10.0 && ratio < 10.0)) continue;  // a fault of its own
    band.low = std::min(band.low, ratio - kBandMargin);
    band.high = std::max(band.high, ratio + kBandMargin);
  }
}

}  // namespace meshless
