#include "meshless_surgery/geometry/mesh/outer_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/tetrahedralize.h"
#include "support/mesh_laws.h"
#include "support/random.h"

namespace meshless {
namespace outer_surface_test {

struct Cells {
  Points points;
  VolumeCells cells;

  void add(CellShape shape, const std::vector<Index>& corners) {
    cells.shapes.push_back(shape);
    cells.corners.insert(cells.corners.end(), corners.begin(), corners.end());
  }
};

/// Points of a grid, moved about by a fifth of its spacing, some of them of no cell; cells by `fill`, which gets the
/// eight corners of each box and its number.
template <class Fill>
Cells grid(test::Random& random, const Fill& fill) {
  Cells made;
  const int n[3] = {random.integer(1, 4), random.integer(1, 4), random.integer(1, 4)};
  const Pose pose{random.rotation(), random.vector(3.0)};
  std::vector<Index> number;
  for (int k = 0; k <= n[2]; ++k)
    for (int j = 0; j <= n[1]; ++j)
      for (int i = 0; i <= n[0]; ++i) number.push_back(static_cast<Index>(number.size()));
  for (std::size_t k = number.size(); k > 1; --k)
    std::swap(number[k - 1], number[static_cast<std::size_t>(random.integer(0, static_cast<int>(k) - 1))]);
  made.points.resize(number.size() + 3, Vec3(50.0, 0.0, 0.0));
  const auto at = [&](int i, int j, int k) {
    return number[static_cast<std::size_t>((k * (n[1] + 1) + j) * (n[0] + 1) + i)];
  };
  for (int k = 0; k <= n[2]; ++k)
    for (int j = 0; j <= n[1]; ++j)
      for (int i = 0; i <= n[0]; ++i) made.points[at(i, j, k)] = pose * (Vec3(i, j, k) + random.vector(0.1));
  int box = 0;
  for (int k = 0; k < n[2]; ++k)
    for (int j = 0; j < n[1]; ++j)
      for (int i = 0; i < n[0]; ++i)
        fill(made,
             std::vector<Index>{at(i, j, k), at(i + 1, j, k), at(i + 1, j + 1, k), at(i, j + 1, k), at(i, j, k + 1),
                                at(i + 1, j, k + 1), at(i + 1, j + 1, k + 1), at(i, j + 1, k + 1)},
             box++);
  return made;
}

void addHexahedron(Cells& to, const std::vector<Index>& c, int) { to.add(CellShape::kHexahedron, c); }

/// Six pyramids from the box's middle.
void addPyramids(Cells& to, const std::vector<Index>& c, int) {
  Vec3 middle = Vec3::Zero();
  for (const Index k : c) middle += to.points[k] / 8.0;
  const auto apex = static_cast<Index>(to.points.size());
  to.points.push_back(middle);
  for (const auto& f :
       {std::array<int, 4>{0, 1, 2, 3}, {4, 7, 6, 5}, {0, 4, 5, 1}, {1, 5, 6, 2}, {2, 6, 7, 3}, {3, 7, 4, 0}})
    to.add(CellShape::kPyramid, {c[f[0]], c[f[1]], c[f[2]], c[f[3]], apex});
}

void addWedges(Cells& to, const std::vector<Index>& c, int) {
  to.add(CellShape::kWedge, {c[0], c[1], c[2], c[4], c[5], c[6]});
  to.add(CellShape::kWedge, {c[0], c[2], c[3], c[4], c[6], c[7]});
}

/// Six tetrahedra around one diagonal: neighbours agree.
void addTetrahedra(Cells& to, const std::vector<Index>& c, int) {
  for (const auto& t :
       {std::array<int, 4>{0, 1, 2, 6}, {0, 2, 3, 6}, {0, 3, 7, 6}, {0, 7, 4, 6}, {0, 4, 5, 6}, {0, 5, 1, 6}})
    to.add(CellShape::kTetrahedron, {c[t[0]], c[t[1]], c[t[2]], c[t[3]]});
}

/// Hexahedra and pyramids; a pyramid's base is a whole quad, so that they fit.
void addMixed(Cells& to, const std::vector<Index>& c, int box) {
  if (box % 2 == 0)
    addHexahedron(to, c, box);
  else
    addPyramids(to, c, box);
}

/// Tetrahedra beside hexahedra without pyramids between.
void addHexahedraAndTetrahedra(Cells& to, const std::vector<Index>& c, int box) {
  if (box % 3 == 0)
    addTetrahedra(to, c, box);
  else
    addHexahedron(to, c, box);
}

Cells tetrahedraOfARandomBox(test::Random& random) {
  Cells made;
  for (int k = 0; k < 8; ++k) made.points.emplace_back(k & 1, k >> 1 & 1, k >> 2 & 1);
  for (int k = random.integer(0, 60); k > 0; --k)
    made.points.emplace_back(random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1));
  for (const Tetrahedron& t : tetrahedralizeHull(made.points))
    made.add(CellShape::kTetrahedron, {t[0], t[1], t[2], t[3]});
  return made;
}

/// Cells as somebody else would have written them: in another order, some of them inside out.
Cells shuffled(const Cells& cells, test::Random& random, bool inside_out) {
  Cells made;
  made.points = cells.points;
  std::vector<std::vector<Index>> all;
  const Index* corner = cells.cells.corners.data();
  for (const CellShape shape : cells.cells.shapes) {
    all.emplace_back(corner, corner + cornersOf(shape));
    corner += cornersOf(shape);
  }
  std::vector<std::size_t> order(all.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  for (std::size_t k = order.size(); k > 1; --k)
    std::swap(order[k - 1], order[static_cast<std::size_t>(random.integer(0, static_cast<int>(k) - 1))]);
  for (const std::size_t k : order) {
    std::vector<Index> c = all[k];
    const CellShape shape = cells.cells.shapes[k];
    if (inside_out && random.integer(0, 1) == 1) {
      if (shape == CellShape::kTetrahedron) std::swap(c[0], c[1]);
      if (shape == CellShape::kHexahedron) std::swap_ranges(c.begin(), c.begin() + 4, c.begin() + 4);
      if (shape == CellShape::kWedge) std::swap_ranges(c.begin(), c.begin() + 3, c.begin() + 3);
      if (shape == CellShape::kPyramid) std::swap(c[1], c[3]);
    }
    made.add(shape, c);
  }
  return made;
}

void expectLaws(const Cells& cells, const std::string& what) {
  const Result<TriangleMesh> surface = outerSurface(cells.points, cells.cells);
  ASSERT_TRUE(surface.ok()) << what << ": " << surface.error().detail;
  EXPECT_TRUE(laws::isClosedOriented(*surface)) << what;
  EXPECT_TRUE(laws::hasNoDuplicateTriangles(*surface)) << what;
  EXPECT_TRUE(laws::usesEveryVertex(*surface)) << what;
  double sum = 0.0;
  for (const double volume : cellVolumes(cells.points, cells.cells)) sum += std::abs(volume);
  EXPECT_NEAR(signedVolume(*surface), sum, 1e-12 * sum) << what;
}

TEST(OuterSurface, EnclosesTheSumOfTheCells) {
  test::Random random(7);
  for (int trial = 0; trial < 40; ++trial) {
    const std::pair<const char*, Cells> all[] = {
        {"tetrahedra", grid(random, addTetrahedra)},
        {"hexahedra", grid(random, addHexahedron)},
        {"wedges", grid(random, addWedges)},
        {"pyramids", grid(random, addPyramids)},
        {"hexahedra and pyramids", grid(random, addMixed)},
        {"hexahedra and tetrahedra", grid(random, addHexahedraAndTetrahedra)},
        {"tetrahedra of a box", tetrahedraOfARandomBox(random)},
    };
    for (const auto& [what, cells] : all) {
      expectLaws(cells, what);
      expectLaws(shuffled(cells, random, true), std::string(what) + ", some inside out");
    }
  }
}

TEST(OuterSurface, TetrahedraOfABoxEncloseTheBox) {
  test::Random random(8);
  for (int trial = 0; trial < 40; ++trial) {
    const Cells cells = tetrahedraOfARandomBox(random);
    const Result<TriangleMesh> surface = outerSurface(cells.points, cells.cells);
    ASSERT_TRUE(surface.ok());
    EXPECT_NEAR(signedVolume(*surface), 1.0, 1e-8);  // flat cells are left out
    EXPECT_NEAR(surfaceArea(*surface), 6.0, 1e-6);
  }
}

TEST(OuterSurface, DoesNotDependOnTheOrderOfTheCells) {
  test::Random random(9);
  for (int trial = 0; trial < 40; ++trial) {
    const Cells cells = grid(random, addHexahedraAndTetrahedra);
    const Result<TriangleMesh> one = outerSurface(cells.points, cells.cells);
    const Cells other = shuffled(cells, random, true);
    const Result<TriangleMesh> again = outerSurface(other.points, other.cells);
    ASSERT_TRUE(one.ok() && again.ok());
    EXPECT_EQ(one->vertices, again->vertices);
    EXPECT_EQ(one->triangles, again->triangles);
  }
}

TEST(OuterSurface, KeepsTheOrderOfThePointsAndDropsThoseInside) {
  test::Random random(10);
  const Cells cells = grid(random, addPyramids);
  const Result<TriangleMesh> surface = outerSurface(cells.points, cells.cells);
  ASSERT_TRUE(surface.ok());
  auto at = cells.points.begin();
  for (const Vec3& p : surface->vertices) {
    at = std::find(at, cells.points.end(), p);
    ASSERT_NE(at, cells.points.end());
    EXPECT_LT(p.x(), 40.0);
    ++at;
  }
}

// As programs write wedges that know hexahedra alone.
TEST(OuterSurface, AHexahedronWithEqualCornersIsAWedge) {
  Cells wedge, collapsed;
  wedge.points =
      collapsed.points = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1), Vec3(1, 0, 1), Vec3(0, 1, 1)};
  wedge.add(CellShape::kWedge, {0, 1, 2, 3, 4, 5});
  collapsed.add(CellShape::kHexahedron, {0, 1, 2, 2, 3, 4, 5, 5});
  const Result<TriangleMesh> a = outerSurface(wedge.points, wedge.cells),
                             b = outerSurface(collapsed.points, collapsed.cells);
  ASSERT_TRUE(a.ok() && b.ok());
  EXPECT_EQ(a->triangles, b->triangles);
  EXPECT_NEAR(signedVolume(*b), 0.5, 1e-15);
}

TEST(OuterSurface, RefusesWhatIsNoVolumeMesh) {
  const auto refused = [](const Cells& cells, const std::string& words) {
    const Result<TriangleMesh> surface = outerSurface(cells.points, cells.cells);
    ASSERT_FALSE(surface.ok()) << words;
    EXPECT_EQ(surface.error().code, ErrorCode::kUnsuitableShape);
    EXPECT_NE(surface.error().detail.find(words), std::string::npos) << surface.error().detail;
  };
  Cells cells;
  cells.points = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1), Vec3(0, 0, 2), Vec3(0, 0, -1)};
  cells.add(CellShape::kTetrahedron, {0, 1, 2, 3});
  Cells bad = cells;
  bad.add(CellShape::kTetrahedron, {0, 1, 2, 6});
  refused(bad, "cell 1 has the corner 6; accepted: 0 to 6 exclusive");
  bad = cells;
  bad.points[2].y() = std::numeric_limits<double>::quiet_NaN();
  refused(bad, "cell 0 has the corner 2, which is not finite");
  bad = cells;
  bad.add(CellShape::kTetrahedron, {0, 1, 2, 4});
  bad.add(CellShape::kTetrahedron, {0, 2, 1, 5});
  refused(bad, "the face of the points 0, 1 and 2 belongs to 3 cells; accepted: one or two");
  bad = cells;
  bad.add(CellShape::kTetrahedron, {3, 2, 1, 0});
  refused(bad, "no outer surface");
  refused(Cells{}, "its 0 cells have no outer surface");
}

}  // namespace outer_surface_test
}  // namespace meshless
