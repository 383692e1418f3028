// The samples of a lattice cell: which part of it is filled, and which of its samples are still linked.
#pragma once

#include <array>
#include <cstdint>

#include "meshless_surgery/base/types.h"

namespace meshless {

/// Samples of a cell along each axis.
constexpr int kCellSamples = 4;

/// 4 x 4 x 4 samples as bits: bit x + 4 (y + 4 z) stands for the one at ((x, y, z) + 1/2) / 4 of the cell.
using SampleSet = std::uint64_t;
constexpr SampleSet kNoSample = 0, kAllSamples = ~SampleSet{0};

/// Links of each sample to the next one along +x, +y, +z, in the cell or across its upper face.
using LinkSet = std::array<SampleSet, 3>;

constexpr int sampleBit(int x, int y, int z) { return x + kCellSamples * (y + kCellSamples * z); }
constexpr int kSampleStride[3] = {1, kCellSamples, kCellSamples* kCellSamples};

/// Samples whose number along an axis is `n`.
constexpr SampleSet sampleLayer(int axis, int n) {
  SampleSet layer = 0;
  for (int bit = 0; bit < 64; ++bit)
    if (bit / kSampleStride[axis] % kCellSamples == n) layer |= SampleSet{1} << bit;
  return layer;
}
constexpr std::array<SampleSet, 3> kUpperLayer = {sampleLayer(0, 3), sampleLayer(1, 3), sampleLayer(2, 3)};
constexpr std::array<SampleSet, 3> kLowerLayer = {sampleLayer(0, 0), sampleLayer(1, 0), sampleLayer(2, 0)};

inline int countSamples(SampleSet samples) { return __builtin_popcountll(samples); }
/// Of a set that is not empty.
inline int lowestSample(SampleSet samples) { return __builtin_ctzll(samples); }

/// Place of a sample in its cell, each coordinate 0..1.
inline Vec3 samplePlace(int bit) {
  static_assert(kCellSamples == 4);
  return Vec3((bit & 3) + 0.5, (bit >> 2 & 3) + 0.5, (bit >> 4) + 0.5) / kCellSamples;
}
/// The lowest of those nearest to a place in the cell, of a set that is not empty.
int nearestSample(SampleSet samples, const Vec3& at);

/// The samples of `within` that hang together with its lowest one by links that are not in `parted`.
SampleSet connectedPart(SampleSet within, const LinkSet& parted);

/// What a filled part weighs and where, for a cell of edge 2 about the origin.
struct FilledMoments {
  double fraction = 0.0;         // of the cell's volume, 0..1
  Vec3 centroid = Vec3::Zero();  // half edges from the middle
  Vec3 variance = Vec3::Zero();  // about the centroid, half edges squared
  std::array<double, 8>
      corner_shares{};  // of the mass, adding up to 1: half of it by the trilinear weights of the
                        // samples, half in equal parts, so that no corner is too light for its stiffness
};
/// Of a set that is not empty. fraction * corner_shares of parts add up to those of the whole.
FilledMoments momentsOf(SampleSet samples);

/// Trilinear weight of a corner (bits 0, 1, 2: upper end along x, y, z) at a place in the cell, 0..1 inside of it.
inline double trilinearWeight(int corner, const Vec3& at) {
  return (corner & 1 ? at.x() : 1.0 - at.x()) * (corner & 2 ? at.y() : 1.0 - at.y()) *
         (corner & 4 ? at.z() : 1.0 - at.z());
}

/// The links across the face between two places of which `upper` is next to `lower` along the axis, in bits of `lower`.
constexpr SampleSet faceLinks(SampleSet lower, SampleSet upper, int axis) {
  return lower & kUpperLayer[axis] & ((upper & kLowerLayer[axis]) << (kCellSamples - 1) * kSampleStride[axis]);
}

}  // namespace meshless
