// What of a lattice resists, finer than its samples see.
#include <cmath>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/lattice/cell_lattice.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"

namespace meshless {
namespace cell_resistance_test {

struct Moments {
  double volume = 0.0;
  Vec3 first = Vec3::Zero(), second = Vec3::Zero();
};

Moments momentsOf(const CellLattice& lattice) {
  Moments sum;
  const double cell = std::pow(lattice.spacing, 3.0), half = 0.5 * lattice.spacing;
  for (const LatticeCell& c : lattice.cells) {
    const Vec3 at = lattice.restPlace(c, 0.5 * (c.resists.centroid + Vec3::Ones()));
    const double volume = cell * c.resists.fraction;
    sum.volume += volume;
    sum.first += volume * at;
    sum.second += volume * (at.cwiseAbs2() + half * half * c.resists.variance);
  }
  return sum;
}

// A lattice whose samples see a box 0.175 spacings too large or too small on each side.
TEST(CellResistance, BoxesAnywhereInTheLatticeHaveTheirMoments) {
  for (const Vec3& size : {Vec3(0.062, 0.043, 0.041), Vec3(0.0675, 0.0334, 0.0288), Vec3(0.04, 0.03, 0.05)}) {
    const TriangleMesh mesh = boxMesh(size, 4, 4, 4);
    const SolidQuery solid(mesh);
    CellLattice lattice = divideIntoCells(mesh, solid, 0.01).value();
    findResistance(solid, nullptr, lattice);
    const Moments sum = momentsOf(lattice);
    const double volume = size.prod();
    EXPECT_NEAR(sum.volume, volume, 0.003 * volume) << size.transpose();
    EXPECT_LT(sum.first.norm(), 1e-6 * volume * 0.01);
    for (int k = 0; k < 3; ++k) {
      const double second = volume * size[k] * size[k] / 12.0;
      EXPECT_NEAR(sum.second[k], second, 0.01 * second) << size.transpose();
    }
  }
}

// What is held does not resist: of a bar that is held up to a plane, what is left is the shorter bar.
TEST(CellResistance, WhatIsHeldResistsWithNothing) {
  const Vec3 size(0.08, 0.03, 0.03);
  const TriangleMesh mesh = boxMesh(size, 4, 4, 4);
  const SolidQuery solid(mesh);
  for (const double to : {-0.0211, -0.0189, -0.0165, -0.02}) {
    CellLattice lattice = divideIntoCells(mesh, solid, 0.01).value();
    findResistance(
        solid, [to](const Vec3& p) { return p.x() - to; }, lattice);
    const Moments sum = momentsOf(lattice);
    const double length = 0.04 - to, volume = length * size.y() * size.z();
    EXPECT_NEAR(sum.volume, volume, 1e-4 * volume) << to;
    EXPECT_NEAR(sum.first.x() / volume, to + 0.5 * length, 1e-4 * length) << to;
  }
}

TEST(CellResistance, OfABallIsItsVolume) {
  const TriangleMesh mesh = sphereMesh(0.03, 0.004);
  const SolidQuery solid(mesh);
  for (const double spacing : {0.011, 0.007, 0.0047}) {
    CellLattice lattice = divideIntoCells(mesh, solid, spacing).value();
    findResistance(solid, nullptr, lattice);
    EXPECT_NEAR(momentsOf(lattice).volume, signedVolume(mesh), 0.01 * signedVolume(mesh)) << spacing;
  }
}

}  // namespace cell_resistance_test
}  // namespace meshless
