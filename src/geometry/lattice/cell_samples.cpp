#include "meshless_surgery/geometry/lattice/cell_samples.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace meshless {
namespace {

constexpr SampleSet kLayers[3][kCellSamples] = {
    {sampleLayer(0, 0), sampleLayer(0, 1), sampleLayer(0, 2), sampleLayer(0, 3)},
    {sampleLayer(1, 0), sampleLayer(1, 1), sampleLayer(1, 2), sampleLayer(1, 3)},
    {sampleLayer(2, 0), sampleLayer(2, 1), sampleLayer(2, 2), sampleLayer(2, 3)}};
constexpr double kEqualShare = 0.5;  // of a part's mass that its corners get in equal parts

FilledMoments computedMoments(SampleSet samples);

}  // namespace

int nearestSample(SampleSet samples, const Vec3& at) {
  int on[3];
  for (int k = 0; k < 3; ++k)
    on[k] = std::clamp(static_cast<int>(std::ceil(kCellSamples * at[k])) - 1, 0, kCellSamples - 1);
  if (const int bit = sampleBit(on[0], on[1], on[2]); samples >> bit & 1) return bit;
  int best = lowestSample(samples);
  double least = (samplePlace(best) - at).squaredNorm();
  for (SampleSet left = samples & (samples - 1); left; left &= left - 1) {
    const double squared = (samplePlace(lowestSample(left)) - at).squaredNorm();
    if (!(squared < least)) continue;
    least = squared;
    best = lowestSample(left);
  }
  return best;
}

SampleSet connectedPart(SampleSet within, const LinkSet& parted) {
  SampleSet part = within & (~within + 1);
  for (;;) {
    SampleSet grown = part;
    for (int axis = 0; axis < 3; ++axis) {
      const int stride = kSampleStride[axis];
      const SampleSet linked = ~parted[axis] & ~kUpperLayer[axis];  // to the next one in the cell
      grown |= (((grown & linked) << stride) | ((grown >> stride) & linked)) & within;
    }
    if (grown == part) return part;
    part = grown;
  }
}

FilledMoments momentsOf(SampleSet samples) {
  static const FilledMoments kWhole = computedMoments(kAllSamples);  // most are
  return samples == kAllSamples ? kWhole : computedMoments(samples);
}

namespace {

FilledMoments computedMoments(SampleSet samples) {
  FilledMoments m;
  const double count = countSamples(samples);
  m.fraction = count / 64.0;
  for (int axis = 0; axis < 3; ++axis) {
    double sum = 0.0, squared = 0.0;
    for (int n = 0; n < kCellSamples; ++n) {
      const double here = countSamples(samples & kLayers[axis][n]), at = (2.0 * n + 1.0) / kCellSamples - 1.0;
      sum += here * at;
      squared += here * at * at;
    }
    m.centroid[axis] = sum / count;
    // A sample is a little box itself.
    m.variance[axis] =
        squared / count - m.centroid[axis] * m.centroid[axis] + 1.0 / (3.0 * kCellSamples * kCellSamples);
  }
  static const std::vector<std::array<double, 8>> kWeights = [] {
    std::vector<std::array<double, 8>> weights(64);
    for (int bit = 0; bit < 64; ++bit)
      for (int k = 0; k < 8; ++k) weights[bit][k] = trilinearWeight(k, samplePlace(bit));
    return weights;
  }();
  for (SampleSet left = samples; left; left &= left - 1)
    for (int k = 0; k < 8; ++k) m.corner_shares[k] += kWeights[lowestSample(left)][k];
  for (double& share : m.corner_shares) share = (1.0 - kEqualShare) * share / count + kEqualShare / 8.0;
  return m;
}

}  // namespace

}  // namespace meshless
