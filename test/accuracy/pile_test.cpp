// Stacks and piles of cubes, beside what true cubes would do.
#include <gtest/gtest.h>

#include "contact_pile.h"

namespace meshless {
namespace {

TEST(Pile, TowersOfTenStand) {
  for (const double size : {1.0, 0.5, 0.1}) {
    bench::PileOptions options;
    options.bodies = 10;
    options.straight = true;
    options.alpha = 1.0;
    options.size = size;
    options.substeps = 1;
    World world = bench::makePile(options);
    for (int step = 0; step < 3600; ++step) world.step();
    const bench::PileMeasures m = bench::measurePile(options, world);
    EXPECT_TRUE(m.finite);
    EXPECT_GT(m.height, 0.99) << size;
    EXPECT_LT(m.deepest, 0.02) << size;
  }
}

TEST(Pile, TowersOfFourSoftCubesStand) {
  bench::PileOptions options;
  options.bodies = 4;
  options.straight = true;
  options.alpha = 0.9;
  options.substeps = 1;
  World world = bench::makePile(options);
  for (int step = 0; step < 3600; ++step) world.step();
  EXPECT_GT(bench::measurePile(options, world).height, 0.98);
}

TEST(Pile, APileSettlesToThePenetrationAndHeightOfTrueCubes) {
  bench::PileOptions options;
  options.bodies = 100;
  World world = bench::makePile(options);
  for (int step = 0; step < 300; ++step) world.step();
  const bench::PileMeasures m = bench::measurePile(options, world);
  EXPECT_TRUE(m.finite);
  EXPECT_LT(m.p99, 0.005);
  EXPECT_LT(m.deepest, 0.02);
  EXPECT_NEAR(m.height, 1.0, 0.01);
}

TEST(Pile, TwoThreadsGiveWhatOneGivesToTheBit) {
  std::uint64_t hashes[2];
  for (const int threads : {1, 2}) {
    bench::PileOptions options;
    options.bodies = 300;
    options.threads = threads;
    World world = bench::makePile(options);
    for (int step = 0; step < 150; ++step) world.step();
    hashes[threads - 1] = world.stateHash();
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

}  // namespace
}  // namespace meshless
