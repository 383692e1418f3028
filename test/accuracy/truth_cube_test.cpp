// The Truth Cube as docs/accuracy.md has it.
#include "truth_cube.h"

#include <gtest/gtest.h>

namespace meshless::bench {
namespace {

std::vector<Bead> beads() {
  auto read = readTruthCube(MEASURED_FOLDER "/truth_cube.csv");
  EXPECT_TRUE(read.ok()) << (read.ok() ? "" : read.error().detail);
  return read.ok() ? *read : std::vector<Bead>();
}

double shareOf(const Result<CubeRow>& row) { return row.ok() ? row->rms / row->largest : 1.0; }

TEST(TruthCube, BeadsGoWhereTheyWereSeen) {
  const std::vector<Bead> cube = beads();
  ASSERT_EQ(cube.size(), 343u);
  const auto row = pressCube(cube, 2, 0.49);
  ASSERT_TRUE(row.ok()) << row.error().detail;
  EXPECT_LT(row->led, 0.3e-3);
  EXPECT_LT(shareOf(row), 0.032);
  EXPECT_LT(shareOf(row), 0.4 * row->uniform / row->largest) << "better than going along evenly";
  for (int layer = 0; layer < kBeadsASide; ++layer) EXPECT_NEAR(row->ours[layer], row->measured[layer], 0.012);
}

// Gel hardly changes its volume, and the beads show it: the bench tells one Poisson's ratio from another.
TEST(TruthCube, TheyShowThatGelKeepsItsVolume) {
  const std::vector<Bead> cube = beads();
  const double soft = shareOf(pressCube(cube, 2, 0.3)), shipped = shareOf(pressCube(cube, 2, 0.45));
  EXPECT_GT(soft, 0.1);
  EXPECT_LT(shipped, 0.06);
  EXPECT_GT(shipped, 0.04);
}

TEST(TruthCube, FinerCellsHaveThemInTheSamePlaces) {
  const std::vector<Bead> cube = beads();
  EXPECT_NEAR(shareOf(pressCube(cube, 1, 0.49, 0.005)), shareOf(pressCube(cube, 1, 0.49)), 0.002);
}

}  // namespace
}  // namespace meshless::bench
