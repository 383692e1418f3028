#include "meshless_surgery/geometry/lattice/cut_lattice.h"

#include <gtest/gtest.h>

#include <map>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/union_find.h"
#include "support/random.h"
#include "support/shapes.h"

namespace meshless {
namespace cut_lattice_test {

using test::Random;

CellLattice latticeOf(const TriangleMesh& mesh, double cells) {
  Result<CellLattice> lattice = divideIntoCells(mesh, SolidQuery(mesh), std::cbrt(signedVolume(mesh) / cells));
  EXPECT_TRUE(lattice.ok());
  return lattice ? *lattice : CellLattice();
}

std::vector<double> massesOf(const CellLattice& lattice) {
  std::vector<double> masses(lattice.corners, 0.0);
  for (const LatticeCell& cell : lattice.cells) {
    const FilledMoments m = momentsOf(cell.filled);
    for (int k = 0; k < 8; ++k) masses[cell.corners[k]] += cell.mass_share * m.fraction * m.corner_shares[k];
  }
  return masses;
}

std::size_t componentsOf(const CellLattice& lattice) {
  UnionFind sets(lattice.corners);
  for (const LatticeCell& cell : lattice.cells)
    for (const Index corner : cell.corners) sets.join(cell.corners[0], corner);
  std::size_t count = 0;
  for (Index i = 0; i < lattice.corners; ++i) count += sets.find(i) == i;
  return count;
}

std::size_t bridgesOf(const CellLattice& lattice) {
  std::size_t count = 0;
  for (Index c = 0; c < lattice.cells.size(); ++c) count += lattice.cells[c].isBridge(c);
  return count;
}

// What holds after every cut.
void expectSound(const CellLattice& before, const CutLattice& cut) {
  ASSERT_EQ(cut.parent_corner.size(), cut.lattice.corners);
  ASSERT_EQ(cut.parent_cell.size(), cut.lattice.cells.size());
  // Corner by corner the mass is what it was.
  const std::vector<double> was = massesOf(before), is = massesOf(cut.lattice);
  std::vector<double> sum(before.corners, 0.0);
  for (Index i = 0; i < cut.lattice.corners; ++i) {
    EXPECT_GT(is[i], 0.0);
    sum[cut.parent_corner[i]] += is[i];
  }
  for (Index i = 0; i < before.corners; ++i) ASSERT_NEAR(sum[i], was[i], 1e-13);
  // Every sample is in one part, and a bridge has those of its parts.
  std::map<std::array<std::int32_t, 3>, std::pair<SampleSet, int>> all_before, all;
  const auto gather = [](const CellLattice& lattice, auto& into) {
    for (Index c = 0; c < lattice.cells.size(); ++c)
      if (!lattice.cells[c].isBridge(c)) {
        into[lattice.cells[c].place].first |= lattice.cells[c].samples;
        into[lattice.cells[c].place].second += countSamples(lattice.cells[c].samples);
      }
  };
  gather(before, all_before);
  gather(cut.lattice, all);
  EXPECT_EQ(all, all_before);
  for (Index c = 0; c < cut.lattice.cells.size(); ++c) {
    const LatticeCell& cell = cut.lattice.cells[c];
    if (cell.bridge == kNoIndex) continue;
    ASSERT_TRUE(cut.lattice.cells[cell.bridge].isBridge(cell.bridge));
    EXPECT_EQ(cell.samples & ~cut.lattice.cells[cell.bridge].samples, kNoSample);
    EXPECT_EQ(cell.place, cut.lattice.cells[cell.bridge].place);
  }
  const Points places = cornerPlaces(cut.lattice), places_before = cornerPlaces(before);
  for (Index i = 0; i < cut.lattice.corners; ++i)
    EXPECT_LT((places[i] - places_before[cut.parent_corner[i]]).norm(), 1e-12);
}

// The present shape after the cut: corners where their parents were.
Points follow(const CutLattice& cut, const Points& corners) {
  Points now;
  for (const Index parent : cut.parent_corner) now.push_back(corners[parent]);
  return now;
}

TEST(CutLattice, APlaneThroughCellsPartsABarAltogether) {
  const CellLattice bar = latticeOf(boxMesh(Vec3(0.2, 0.05, 0.05), 0.0125), 500.0);
  for (const double x : {0.0123, 0.0, 0.00625, -0.031}) {
    const Points corners = cornerPlaces(bar);
    const CutLattice cut = cutLattice(bar, corners, Blade::through({Vec3::UnitX(), Vec3(x, 0, 0)}));
    expectSound(bar, cut);
    EXPECT_EQ(componentsOf(cut.lattice), 2u) << x;
    EXPECT_EQ(bridgesOf(cut.lattice), 0u);
    for (Index c = 0; c < cut.lattice.cells.size(); ++c) {
      const SampleSet samples = cut.lattice.cells[c].samples;
      EXPECT_TRUE(!(samples & cut.above[c]) || !(samples & ~cut.above[c]));
    }
  }
}

// Where a film of tissue passes a corner, no samples link the cells that it goes through.
TEST(CutLattice, ABladeBetweenCellsThatShareOneCornerAlonePartsThem) {
  CellLattice lattice;
  lattice.spacing = 0.01;
  lattice.corners = 15;
  for (int n = 0; n < 2; ++n) {
    LatticeCell cell;
    cell.place = {n, n, n};
    cell.samples = cell.filled = kAllSamples;
    for (Index k = 0; k < 8; ++k) cell.corners[k] = 7 * n + k;
    lattice.cells.push_back(cell);
  }
  const Points corners = cornerPlaces(lattice);
  const Vec3 across = Vec3::Ones().normalized(), shared = corners[7];
  Blade blade;
  blade.x_axis = across.unitOrthogonal();
  blade.y_axis = across.cross(blade.x_axis);
  blade.length = blade.depth = 0.02;
  blade.origin = shared - 0.01 * blade.x_axis + 0.01 * blade.y_axis;
  Blade beside = blade;
  beside.origin += 0.03 * blade.x_axis;
  for (const auto& [gate, parts] : {std::pair(Blade::through({across, shared}), 2u), {blade, 2u}, {beside, 1u}}) {
    const CutLattice cut = cutLattice(lattice, corners, gate);
    expectSound(lattice, cut);
    EXPECT_EQ(componentsOf(cut.lattice), parts);
  }
}

TEST(CutLattice, RandomCutsOfEveryShapeKeepEverySampleAndTheMassOfEveryCorner) {
  Random random(3);
  for (const shapes::Shape& shape : shapes::simpleShapes()) {
    SCOPED_TRACE(shape.name);
    const Result<CellLattice> divided =
        divideIntoCells(shape.mesh, SolidQuery(shape.mesh), std::cbrt(signedVolume(shape.mesh) / 300.0));
    if (!divided) continue;
    CellLattice lattice = *divided;
    Points corners = cornerPlaces(lattice);
    Box bounds;
    for (const Vec3& p : corners) bounds.extend(p);
    std::size_t components = componentsOf(lattice);
    for (int n = 0; n < 8; ++n) {
      const Vec3 at = 0.5 * (bounds.min + bounds.max) + 0.2 * bounds.diagonal() * random.unit();
      const Mat3 turn = random.rotation().toRotationMatrix();
      const Blade blade{at, turn.col(0), turn.col(1), 0.3 * bounds.diagonal(), 0.2 * bounds.diagonal()};
      const CutLattice cut =
          n % 2 ? cutLattice(lattice, corners, Blade::through({turn.col(2), at})) : cutLattice(lattice, corners, blade);
      expectSound(lattice, cut);
      EXPECT_GE(componentsOf(cut.lattice), components);
      components = componentsOf(cut.lattice);
      corners = follow(cut, corners);
      for (Vec3& p : corners) p += 1e-3 * lattice.spacing * random.unit();
      lattice = cut.lattice;
    }
  }
}

TEST(CutLattice, ATipInACellIsBridgedByWhatIsNotCut) {
  const CellLattice bar = latticeOf(boxMesh(Vec3(0.2, 0.05, 0.05), 0.0125), 500.0);
  const Points corners = cornerPlaces(bar);
  for (const double share : {0.25, 0.5, 0.75}) {  // of the third layer of cells from above
    const double depth = (2.0 + share) * bar.spacing;
    const Blade blade{Vec3(0.013, -0.1, 0.025), Vec3::UnitY(), Vec3::UnitZ(), 0.2, depth};
    const CutLattice cut = cutLattice(bar, corners, blade);
    expectSound(bar, cut);
    EXPECT_EQ(componentsOf(cut.lattice), 1u);
    EXPECT_GT(bridgesOf(cut.lattice), 0u);
    for (Index c = 0; c < cut.lattice.cells.size(); ++c) {
      const LatticeCell& cell = cut.lattice.cells[c];
      if (cell.bridge == kNoIndex) continue;
      const double held = (1.0 - share) * (1.0 - share);
      EXPECT_NEAR(cell.stiffness_share, cell.isBridge(c) ? held : 1.0 - held, 1e-12);
    }
    // Deeper, and the bridges are further on; through, and there are none.
    Blade deeper = blade;
    deeper.depth += 1.0 * bar.spacing;
    const CutLattice second = cutLattice(cut.lattice, follow(cut, corners), deeper);
    expectSound(cut.lattice, second);
    EXPECT_EQ(bridgesOf(second.lattice), bridgesOf(cut.lattice));
    deeper.depth = 1.0;
    const CutLattice through = cutLattice(second.lattice, follow(second, follow(cut, corners)), deeper);
    expectSound(second.lattice, through);
    EXPECT_EQ(componentsOf(through.lattice), 2u);
    EXPECT_EQ(bridgesOf(through.lattice), 0u);
    for (const LatticeCell& cell : through.lattice.cells) EXPECT_NEAR(cell.stiffness_share, 1.0, 1e-12);
  }
}

TEST(CutLattice, AFaceThatABladeCoversInPartIsBridgedByWhatIsNotCovered) {
  const CellLattice bar = latticeOf(boxMesh(Vec3(0.2, 0.05, 0.05), 0.0125), 500.0);
  const Points corners = cornerPlaces(bar);
  for (const double share : {0.25, 0.5, 0.75}) {  // of the third layer of cells from above
    const double depth = (2.0 + share) * bar.spacing;
    const Blade blade{Vec3(0.01, -0.1, 0.025), Vec3::UnitY(), Vec3::UnitZ(), 0.2, depth};  // in a plane of the lattice
    const CutLattice cut = cutLattice(bar, corners, blade);
    expectSound(bar, cut);
    EXPECT_EQ(componentsOf(cut.lattice), 1u);
    EXPECT_EQ(bridgesOf(cut.lattice), 5u);  // one for each cell across the bar
    const CornerUses uses = cornerUses(cut.lattice);
    for (Index c = 0; c < cut.lattice.cells.size(); ++c) {
      const LatticeCell& cell = cut.lattice.cells[c];
      if (cell.bridge == kNoIndex) continue;
      const double held = (1.0 - share) * (1.0 - share);
      EXPECT_NEAR(cell.stiffness_share, cell.isBridge(c) ? held : 1.0 - held, 1e-12);
      // The bridge has all of its corners with cells that are none, on both sides of the blade.
      int with_own = 0, across = 0;
      for (const Index corner : cell.corners)
        for (Index u = uses.offsets[corner]; u < uses.offsets[corner + 1]; ++u) {
          const LatticeCell& other = cut.lattice.cells[uses.cells[u]];
          if (other.isBridge(uses.cells[u])) continue;
          with_own += other.place == cell.place;
          across += other.place[0] == cell.place[0] + 1;
        }
      EXPECT_GT(with_own, 0);
      if (cell.isBridge(c)) EXPECT_GT(across, 3);
    }
    // Deeper, and the bridges are further on, whatever else is cut meanwhile; through, and there are none.
    const Blade elsewhere{Vec3(0.053, -0.1, 0.025), Vec3::UnitY(), Vec3::UnitZ(), 0.2, 0.007};
    const CutLattice other = cutLattice(cut.lattice, follow(cut, corners), elsewhere);
    expectSound(cut.lattice, other);
    const std::size_t more = bridgesOf(other.lattice) - 5u;
    const Points now = follow(other, follow(cut, corners));
    Blade deeper = blade;
    deeper.depth += bar.spacing;
    const CutLattice second = cutLattice(other.lattice, now, deeper);
    expectSound(other.lattice, second);
    EXPECT_EQ(bridgesOf(second.lattice), 5u + more);
    deeper.depth = 1.0;
    const CutLattice through = cutLattice(second.lattice, follow(second, now), deeper);
    expectSound(second.lattice, through);
    EXPECT_EQ(componentsOf(through.lattice), 2u);
    EXPECT_EQ(bridgesOf(through.lattice), more);
  }
}

TEST(CutLattice, ABladeBesideTheSolidChangesNothing) {
  const CellLattice bar = latticeOf(boxMesh(Vec3(0.2, 0.05, 0.05), 0.0125), 500.0);
  const CutLattice cut =
      cutLattice(bar, cornerPlaces(bar), Blade{Vec3(0.01, -0.1, 0.08), Vec3::UnitY(), Vec3::UnitZ(), 0.2, 0.02});
  EXPECT_EQ(cut.lattice.corners, bar.corners);
  for (const bool changed : cut.changed) EXPECT_FALSE(changed);
}

}  // namespace cut_lattice_test
}  // namespace meshless
