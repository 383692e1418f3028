#include "meshless_surgery/geometry/lattice/cell_lattice.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/shapes.h"

namespace meshless {
namespace cell_lattice_test {

Result<CellLattice> divided(const TriangleMesh& mesh, double spacing) {
  return divideIntoCells(mesh, SolidQuery(mesh), spacing);
}

double filled(const CellLattice& lattice) {
  double volume = 0.0;
  for (const LatticeCell& cell : lattice.cells) volume += momentsOf(cell.filled).fraction * std::pow(lattice.spacing, 3.0);
  return volume;
}

// Cells reachable from the first over shared corners.
std::size_t reachable(const CellLattice& lattice) {
  std::set<Index> corners(lattice.cells[0].corners.begin(), lattice.cells[0].corners.end());
  std::set<std::size_t> found;
  for (bool grown = true; grown;) {
    grown = false;
    for (std::size_t c = 0; c < lattice.cells.size(); ++c) {
      if (found.count(c)) continue;
      for (Index i : lattice.cells[c].corners)
        if (corners.count(i)) {
          found.insert(c);
          corners.insert(lattice.cells[c].corners.begin(), lattice.cells[c].corners.end());
          grown = true;
          break;
        }
    }
  }
  return found.size();
}

// Samples see sharp tips and thin edges in places.
TEST(DivideIntoCells, TissueWithSharpTipsIsOnePart) {
  std::mt19937 random(1);
  std::normal_distribution<double> any;
  for (int n = 0; n < 30; ++n) {
    const Quat turn = Quat(any(random), any(random), any(random), any(random)).normalized();
    TriangleMesh mesh = sphereMesh(1.0, 10.0);
    for (Vec3& p : mesh.vertices) p = turn * p.cwiseProduct(Vec3(0.1, 0.03, 0.01));
    for (const double cells : {100.0, 1000.0}) {
      SCOPED_TRACE("turned at random for the " + std::to_string(n) + "th time, " + std::to_string(cells) + " cells");
      const Result<CellLattice> lattice = divided(mesh, std::cbrt(signedVolume(mesh) / cells));
      ASSERT_TRUE(lattice.ok());
      EXPECT_EQ(reachable(*lattice), lattice->cells.size());
    }
  }
}

TEST(DivideIntoCells, ABoxOfWholeCellsIsFilledExactly) {
  const Result<CellLattice> lattice = divided(boxMesh(Vec3(0.2, 0.1, 0.05), 0.05), 0.0125);
  ASSERT_TRUE(lattice.ok());
  EXPECT_EQ(lattice->cells.size(), 16u * 8u * 4u);
  EXPECT_EQ(lattice->corners, 17u * 9u * 5u);
  for (const LatticeCell& cell : lattice->cells) {
    EXPECT_EQ(momentsOf(cell.filled).fraction, 1.0);
    for (Index k = 0; k < 8; ++k) {
      const Vec3 edge = cornerPlaces(*lattice)[cell.corners[k]] - cornerPlaces(*lattice)[cell.corners[0]];
      EXPECT_LT((edge - 0.0125 * Vec3(k & 1, k >> 1 & 1, k >> 2 & 1)).norm(), 1e-12);
    }
  }
}

TEST(DivideIntoCells, EveryShapeIsHeldWithItsVolume) {
  for (const shapes::Shape& shape : shapes::simpleShapes()) {
    SCOPED_TRACE(shape.name);
    const double volume = signedVolume(shape.mesh);
    const double spacing = std::cbrt(volume / 400.0);
    const Result<CellLattice> lattice = divided(shape.mesh, spacing);
    if (!lattice.ok()) {  // a sheet thinner than a quarter of a cell
      EXPECT_EQ(lattice.error().code, ErrorCode::kUnsuitableShape);
      continue;
    }
    EXPECT_NEAR(filled(*lattice), volume, (shape.name == "thin slab" || shape.name == "disc" ? 0.6 : 0.06) * volume);
    const SolidQuery solid(shape.mesh);
    for (const LatticeCell& cell : lattice->cells) {
      EXPECT_GT(momentsOf(cell.filled).fraction, 0.0);
      EXPECT_LE(momentsOf(cell.filled).fraction, 1.0);
      EXPECT_EQ(std::set<Index>(cell.corners.begin(), cell.corners.end()).size(), 8u);
    }
    for (const Vec3& corner : cornerPlaces(*lattice))
      EXPECT_TRUE(solid.contains(corner) || solid.distance(corner) < std::sqrt(3.0) * spacing);
  }
}

TEST(DivideIntoCells, PartsThatAreNearInSpaceOnlyShareNoCorner) {
  // Two slabs with a gap of half a cell, which a cell reaches across.
  const double spacing = 0.01;
  TriangleMesh pair = boxMesh(Vec3(0.08, 0.08, 0.0225), 0.02);
  shapes::append(pair, boxMesh(Vec3(0.08, 0.08, 0.0225), 0.02), Vec3(0, 0, 0.0275));
  const Result<CellLattice> lattice = divided(pair, spacing);
  ASSERT_TRUE(lattice.ok());
  EXPECT_EQ(reachable(*lattice), lattice->cells.size() / 2);
  const Result<CellLattice> whole = divided(boxMesh(Vec3(0.08, 0.08, 0.05), 0.02), spacing);
  ASSERT_TRUE(whole.ok());
  EXPECT_EQ(reachable(*whole), whole->cells.size());
}

TEST(DivideIntoCells, RefusesWhatItCannotDivide) {
  const TriangleMesh box = boxMesh(Vec3(0.1, 0.1, 0.1), 0.05);
  for (double spacing : {0.0, -1.0, 1e-5, std::nan("")}) {
    const Result<CellLattice> lattice = divided(box, spacing);
    ASSERT_FALSE(lattice.ok()) << spacing;
    EXPECT_EQ(lattice.error().code, ErrorCode::kInvalidArgument);
    EXPECT_NE(lattice.error().detail.find("spacing"), std::string::npos);
  }
}

}  // namespace cell_lattice_test
}  // namespace meshless
