#include "meshless_surgery/geometry/lattice/cell_samples.h"

#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/query/union_find.h"
#include "support/random.h"

namespace meshless {
namespace cell_samples_test {

SampleSet bitsOf(test::Random& random) {
  SampleSet bits = 0;
  for (int k = 0; k < 64; ++k) bits |= SampleSet(random.integer(0, 1)) << k;
  return bits;
}

TEST(CellSamples, MomentsOfAWholeCellAreThoseOfACube) {
  const FilledMoments m = momentsOf(kAllSamples);
  EXPECT_EQ(m.fraction, 1.0);
  EXPECT_LT(m.centroid.norm(), 1e-15);
  EXPECT_LT((m.variance - Vec3::Constant(1.0 / 3.0)).norm(), 1e-15);
  for (const double share : m.corner_shares) EXPECT_NEAR(share, 0.125, 1e-15);
}

TEST(CellSamples, MomentsOfASlabAreThoseOfABox) {
  for (int axis = 0; axis < 3; ++axis) {
    const FilledMoments m = momentsOf(sampleLayer(axis, 0) | sampleLayer(axis, 1));
    EXPECT_EQ(m.fraction, 0.5);
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(m.centroid[k], k == axis ? -0.5 : 0.0, 1e-15);
      EXPECT_NEAR(m.variance[k], k == axis ? 1.0 / 12.0 : 1.0 / 3.0, 1e-15);
    }
  }
}

TEST(CellSamples, WhatPartsWeighAtEachCornerAddsUpToTheWhole) {
  test::Random random(1);
  for (int n = 0; n < 200; ++n) {
    const SampleSet all = bitsOf(random) & bitsOf(random), some = all & bitsOf(random), others = all & ~some;
    if (!some || !others) continue;
    const FilledMoments whole = momentsOf(all), a = momentsOf(some), b = momentsOf(others);
    for (int k = 0; k < 8; ++k)
      EXPECT_NEAR(whole.fraction * whole.corner_shares[k],
                  a.fraction * a.corner_shares[k] + b.fraction * b.corner_shares[k], 1e-15);
  }
}

TEST(CellSamples, LayersThatAreCutComeApart) {
  LinkSet parted{};
  EXPECT_EQ(connectedPart(kAllSamples, parted), kAllSamples);
  parted[1] = sampleLayer(1, 1);
  EXPECT_EQ(connectedPart(kAllSamples, parted), sampleLayer(1, 0) | sampleLayer(1, 1));
  parted[1] &= ~(SampleSet{1} << sampleBit(3, 1, 3));  // one link is left
  EXPECT_EQ(connectedPart(kAllSamples, parted), kAllSamples);
  // The last sample of a row has no neighbour in the first of the next.
  EXPECT_EQ(connectedPart(SampleSet{1} << sampleBit(3, 0, 0) | SampleSet{1} << sampleBit(0, 1, 0), {}),
            SampleSet{1} << sampleBit(3, 0, 0));
}

TEST(CellSamples, PartsThatOnlyTouchAtAnEdgeOrACornerAreNotConnected) {
  const SampleSet first = SampleSet{1} << sampleBit(1, 1, 1);
  for (const int other : {sampleBit(2, 2, 1), sampleBit(1, 2, 2), sampleBit(2, 1, 2), sampleBit(2, 2, 2)})
    EXPECT_EQ(connectedPart(first | SampleSet{1} << other, {}), first) << other;
  EXPECT_EQ(connectedPart(first | SampleSet{1} << sampleBit(2, 1, 1) | SampleSet{1} << sampleBit(2, 2, 1), {}),
            first | SampleSet{1} << sampleBit(2, 1, 1) | SampleSet{1} << sampleBit(2, 2, 1));
}

// One link after the other.
SampleSet connectedPartBySteps(SampleSet within, const LinkSet& parted) {
  UnionFind samples(64);
  for (int bit = 0; bit < 64; ++bit)
    for (int axis = 0; axis < 3; ++axis) {
      if (kUpperLayer[axis] >> bit & 1 || parted[axis] >> bit & 1) continue;
      const int next = bit + kSampleStride[axis];
      if (within >> bit & within >> next & 1) samples.join(bit, next);
    }
  SampleSet part = kNoSample;
  for (int bit = 0; bit < 64; ++bit)
    if (within >> bit & 1 && samples.find(bit) == samples.find(lowestSample(within))) part |= SampleSet{1} << bit;
  return part;
}

TEST(CellSamples, AConnectedPartIsWhatLinksReachOneByOne) {
  test::Random random(2);
  for (int n = 0; n < 500; ++n) {
    const SampleSet within = bitsOf(random) | (n % 2 ? bitsOf(random) : kNoSample);
    LinkSet parted{};
    if (n % 3)
      for (SampleSet& links : parted) links = bitsOf(random);
    EXPECT_EQ(connectedPart(within, parted), connectedPartBySteps(within, parted));
  }
}

}  // namespace cell_samples_test
}  // namespace meshless
