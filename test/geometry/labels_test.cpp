// Segmentations as they come: several labels with walls between them, and organs whose hollow touches their outside.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mend.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/query/union_find.h"
#include "support/mesh_laws.h"
#include "support/random.h"
#include "support/shapes.h"

namespace meshless {
namespace labels_test {

using Voxel = std::array<int, 3>;

int trials(int usual) {
  const char* more = std::getenv("MESHLESS_SURGERY_LABEL_TRIALS");
  return more ? std::atoi(more) : usual;
}

unsigned firstSeed() {
  const char* seed = std::getenv("MESHLESS_SURGERY_LABEL_SEED");
  return seed ? static_cast<unsigned>(std::atoi(seed)) : 1u;
}

std::string saidOf(const RepairedMesh& mesh) {
  std::string all;
  for (const std::string& note : mesh.notes) all += note + "; ";
  for (const std::string& warning : mesh.warnings) all += "warning: " + warning + "; ";
  return all;
}

bool says(const RepairedMesh& mesh, const std::string& words) { return saidOf(mesh).find(words) != std::string::npos; }

/// A number for each voxel; 0 is outside of all.
class Grid {
 public:
  explicit Grid(int size) : size_(size), labels_(static_cast<std::size_t>(size * size * size), 0) {}
  int size() const { return size_; }
  int at(const Voxel& v) const {
    for (const int x : v)
      if (x < 0 || x >= size_) return 0;
    return labels_[index(v)];
  }
  void set(const Voxel& v, int label) { labels_[index(v)] = label; }
  void forEach(const std::function<void(const Voxel&)>& visit) const {
    for (int x = 0; x < size_; ++x)
      for (int y = 0; y < size_; ++y)
        for (int z = 0; z < size_; ++z) visit({x, y, z});
  }
  std::size_t index(const Voxel& v) const { return static_cast<std::size_t>((v[0] * size_ + v[1]) * size_ + v[2]); }

 private:
  int size_;
  std::vector<int> labels_;
};

/// Squares of voxels as pairs of triangles, vertices at one place are one.
class Squares {
 public:
  /// The side of a voxel in a direction, its normal pointing out of it.
  void add(const Voxel& voxel, int axis, bool up, bool turned = false) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    Index corner[4];
    for (int k = 0; k < 4; ++k) {
      Voxel at = voxel;
      at[axis] += up;
      at[u] += k == 1 || k == 2;
      at[v] += k >= 2;
      corner[k] = vertex(at);
    }
    if (up == turned) std::swap(corner[1], corner[3]);
    mesh.triangles.push_back({corner[0], corner[1], corner[2]});
    mesh.triangles.push_back({corner[0], corner[2], corner[3]});
  }
  TriangleMesh mesh;

 private:
  Index vertex(const Voxel& at) {
    const auto [found, is_new] = number_.emplace(at, static_cast<Index>(mesh.vertices.size()));
    if (is_new) mesh.vertices.emplace_back(at[0], at[1], at[2]);
    return found->second;
  }
  std::map<Voxel, Index> number_;
};

Voxel next(Voxel v, int axis, bool up) {
  v[axis] += up ? 1 : -1;
  return v;
}

/// The outside of all voxels that are `inside`.
TriangleMesh surfaceOf(const Grid& grid, const std::function<bool(const Voxel&)>& inside) {
  Squares squares;
  grid.forEach([&](const Voxel& v) {
    if (!inside(v)) return;
    for (int axis = 0; axis < 3; ++axis)
      for (const bool up : {false, true})
        if (!inside(next(v, axis, up))) squares.add(v, axis, up);
  });
  return squares.mesh;
}

/// Every triangle with vertices of its own, as STL has them.
TriangleMesh soupOf(const TriangleMesh& mesh) {
  TriangleMesh soup;
  for (const Triangle& t : mesh.triangles) {
    const Index n = static_cast<Index>(soup.vertices.size());
    for (const Index v : t) soup.vertices.push_back(mesh.vertices[v]);
    soup.triangles.push_back({n, n + 1, n + 2});
  }
  return soup;
}

/// Where voxels lie: bent, so that no wall is flat, then turned and scaled.
struct Place {
  Pose pose;
  double scale = 1.0;
  double bend = 0.0;

  Vec3 operator()(const Vec3& p) const {
    const Vec3 bent = p + bend * Vec3(std::sin(p.y() + 0.5 * p.z()), std::sin(p.z() + 0.5 * p.x()), std::sin(p.x()));
    return pose * (scale * bent);
  }
  TriangleMesh operator()(TriangleMesh mesh) const {
    for (Vec3& p : mesh.vertices) p = (*this)(p);
    return mesh;
  }
};

Place anyPlace(test::Random& random) {
  Place place;
  if (random.integer(0, 3) > 0) place.pose = {random.rotation(), random.vector(1.0)};
  place.scale = std::pow(10.0, random.uniform(-3.0, 1.0));
  place.bend = random.integer(0, 1) ? random.uniform(0.02, 0.15) : 0.0;
  return place;
}

Vec3 middleOf(const Voxel& v) { return Vec3(v[0] + 0.5, v[1] + 0.5, v[2] + 0.5); }

/// Closed and manifold, of that volume, and around the middles of those voxels and no others.
void expectSolid(const Result<RepairedMesh>& repaired, const TriangleMesh& exact, const Grid& grid, const Place& place,
                 const std::function<bool(const Voxel&)>& inside, const std::string& what) {
  ASSERT_TRUE(repaired.ok()) << what << ": " << repaired.error().detail;
  ASSERT_TRUE(repaired->solid) << what << ": " << saidOf(*repaired);
  EXPECT_TRUE(laws::isClosedOriented(repaired->mesh)) << what << ": " << saidOf(*repaired);
  EXPECT_TRUE(laws::usesEveryVertex(repaired->mesh)) << what;
  const double volume = signedVolume(exact);
  EXPECT_NEAR(signedVolume(repaired->mesh), volume, 1e-6 * volume) << what << ": " << saidOf(*repaired);
  const SolidQuery query(repaired->mesh);
  int wrong = 0;
  grid.forEach([&](const Voxel& v) { wrong += query.contains(place(middleOf(v))) != inside(v); });
  EXPECT_EQ(wrong, 0) << what << ": " << saidOf(*repaired);
}

/// Which voxels hang together by faces and have one label.
std::vector<Index> regionsOf(const Grid& grid, std::set<Index>& enclosed) {
  const std::size_t outside = static_cast<std::size_t>(grid.size() * grid.size() * grid.size());
  UnionFind regions(outside + 1);
  const auto numberOf = [&](const Voxel& v) {
    for (const int x : v)
      if (x < 0 || x >= grid.size()) return static_cast<Index>(outside);
    return static_cast<Index>(grid.index(v));
  };
  grid.forEach([&](const Voxel& v) {
    for (int axis = 0; axis < 3; ++axis)
      for (const bool up : {false, true})
        if (grid.at(next(v, axis, up)) == grid.at(v)) regions.join(numberOf(v), numberOf(next(v, axis, up)));
  });
  std::set<Index> bare;
  grid.forEach([&](const Voxel& v) {
    enclosed.insert(regions.find(numberOf(v)));
    for (int axis = 0; axis < 3; ++axis)
      for (const bool up : {false, true})
        if (grid.at(v) != 0 && grid.at(next(v, axis, up)) == 0) bare.insert(regions.find(numberOf(v)));
  });
  for (const Index r : bare) enclosed.erase(r);
  std::vector<Index> all;
  for (Index v = 0; v <= outside; ++v) all.push_back(regions.find(v));
  return all;
}

/// Walls between labels once, turned to one side or the other; faces of a background that labels enclose look into it.
TriangleMesh wallsOf(const Grid& grid, test::Random& random) {
  std::set<Index> enclosed;
  const std::vector<Index> region = regionsOf(grid, enclosed);
  const auto regionAt = [&](const Voxel& v) {
    for (const int x : v)
      if (x < 0 || x >= grid.size()) return region.back();
    return region[grid.index(v)];
  };
  std::map<std::pair<Index, Index>, bool> turned;
  Squares squares;
  grid.forEach([&](const Voxel& v) {
    if (grid.at(v) == 0) return;
    for (int axis = 0; axis < 3; ++axis)
      for (const bool up : {false, true}) {
        const Voxel other = next(v, axis, up);
        if (grid.at(other) == 0) squares.add(v, axis, up);
        if (grid.at(other) == 0 || grid.at(other) == grid.at(v) || other < v) continue;
        // What other labels enclose would be a hole if all of its walls looked into it.
        const std::pair<Index, Index> pair(std::min(regionAt(v), regionAt(other)),
                                           std::max(regionAt(v), regionAt(other)));
        if (!turned.count(pair)) {
          const Index away = enclosed.count(pair.first) ? pair.first : pair.second;
          turned[pair] = enclosed.count(pair.first) || enclosed.count(pair.second) ? away == pair.second
                                                                                   : random.integer(0, 1) == 1;
        }
        squares.add(v, axis, up, (regionAt(v) == pair.first) == turned[pair]);
      }
  });
  return squares.mesh;
}

Grid randomLabels(test::Random& random) {
  Grid grid(random.integer(3, 5));
  const int labels = random.integer(2, 4), filled = random.integer(4, 9);
  grid.forEach([&](const Voxel& v) {
    if (random.integer(0, 9) < filled) grid.set(v, random.integer(1, labels));
  });
  return grid;
}

TEST(Labels, ThreeAroundAnEdgeAreOne) {
  for (const int count : {2, 3, 4}) {
    Grid grid(4);
    test::Random random(1);
    grid.forEach([&](const Voxel& v) {
      const int label = 1 + v[0] / 2 + 2 * (v[1] / 2);
      if (label <= count) grid.set(v, label);
    });
    const TriangleMesh walls = wallsOf(grid, random);
    const auto one = repairMesh(walls, MeshRepair::kMend);
    const auto inside = [&](const Voxel& v) { return grid.at(v) != 0; };
    expectSolid(one, surfaceOf(grid, inside), grid, {}, inside, std::to_string(count) + " labels");
    EXPECT_TRUE(says(*one, std::to_string(count) + " regions that share walls were united: volume")) << saidOf(*one);
    EXPECT_EQ(inspectMesh(one->mesh).self_intersections, 0u);
    EXPECT_EQ(one->components, 1u);
  }
}

TEST(Labels, RandomVoxelsHaveTheVolumeThatIsInOneOfThem) {
  for (int trial = 0; trial < trials(40); ++trial) {
    test::Random random(firstSeed() + static_cast<unsigned>(trial));
    const Grid grid = randomLabels(random);
    const Place place = anyPlace(random);
    const auto inside = [&](const Voxel& v) { return grid.at(v) != 0; };
    const TriangleMesh exact = place(surfaceOf(grid, inside));
    if (exact.triangles.empty()) continue;
    const std::string seed = "seed " + std::to_string(firstSeed() + static_cast<unsigned>(trial));
    const TriangleMesh walls = place(wallsOf(grid, random));
    expectSolid(repairMesh(walls, MeshRepair::kMend), exact, grid, place, inside, seed + ", walls once");
    expectSolid(repairMesh(soupOf(walls), MeshRepair::kMend), exact, grid, place, inside, seed + ", a soup of walls");
    // Each label closed by itself: walls twice, and nothing shared but places.
    TriangleMesh closed;
    for (int label = 1; label <= 4; ++label)
      shapes::append(closed, place(surfaceOf(grid, [&](const Voxel& v) { return grid.at(v) == label; })));
    expectSolid(repairMesh(closed, MeshRepair::kMend), exact, grid, place, inside, seed + ", closed labels");
    expectSolid(repairMesh(soupOf(closed), MeshRepair::kMend), exact, grid, place, inside, seed + ", a soup of labels");
  }
}

/// Any of them together: those that touch are one part in a soup, and a part is a hollow where most of it lies inside.
bool mostlyInside(const std::vector<Grid>& hollows, const Grid& organ) {
  for (unsigned chosen = 1; chosen < 1u << hollows.size(); ++chosen) {
    int within = 0, all = 0;
    organ.forEach([&](const Voxel& v) {
      bool any = false;
      for (std::size_t k = 0; k < hollows.size(); ++k) any = any || ((chosen >> k & 1u) && hollows[k].at(v));
      all += any;
      within += any && organ.at(v);
    });
    if (2 * within <= all) return false;
  }
  return true;
}

// Hollows are boxes of voxels that touch the outside in faces, edges and vertices, or reach through it.
TEST(Labels, HollowsOfVoxelsStayHoles) {
  for (int trial = 0; trial < trials(40); ++trial) {
    test::Random random(firstSeed() + 1000u + static_cast<unsigned>(trial));
    Grid organ(7);
    const bool gaps = random.integer(0, 1) == 1;
    organ.forEach([&](const Voxel& v) {
      bool within = true;
      for (const int x : v) within = within && x >= 1 && x <= 5;
      organ.set(v, within && !(gaps && random.integer(0, 19) == 0));
    });
    std::vector<Grid> hollows;
    for (int k = random.integer(2, 6); k > 0 && hollows.size() < 3; --k) {
      Voxel low, high;
      for (int d = 0; d < 3; ++d) {
        low[d] = random.integer(0, 4);
        high[d] = std::min(random.integer(low[d] + 1, low[d] + 3), 6);
      }
      Grid hollow(7);
      hollow.forEach([&](const Voxel& v) {
        bool within = true;
        for (int d = 0; d < 3; ++d) within = within && v[d] >= low[d] && v[d] <= high[d];
        hollow.set(v, within);
      });
      hollows.push_back(hollow);
      if (!mostlyInside(hollows, organ)) hollows.pop_back();
    }
    const auto inside = [&](const Voxel& v) {
      return organ.at(v) != 0 && std::none_of(hollows.begin(), hollows.end(), [&](const Grid& h) { return h.at(v); });
    };
    const Place place = anyPlace(random);
    const TriangleMesh exact = place(surfaceOf(organ, inside));
    if (exact.triangles.empty() || hollows.empty()) continue;
    TriangleMesh file = place(surfaceOf(organ, [&](const Voxel& v) { return organ.at(v) != 0; }));
    for (const Grid& hollow : hollows)
      shapes::append(
          file, shapes::turnedInsideOut(place(surfaceOf(hollow, [&](const Voxel& v) { return hollow.at(v) != 0; }))));
    const std::string seed = "seed " + std::to_string(firstSeed() + 1000u + static_cast<unsigned>(trial));
    expectSolid(repairMesh(file, MeshRepair::kMend), exact, organ, place, inside, seed);
    expectSolid(repairMesh(shapes::turnedInsideOut(file), MeshRepair::kMend), exact, organ, place, inside,
                seed + ", inside out");
    // Of a soup nobody knows which triangles are of which part: what two hollows have both, or one and a gap, could be
    // tissue inside out.
    bool apart = !gaps;
    organ.forEach([&](const Voxel& v) {
      apart = apart && std::count_if(hollows.begin(), hollows.end(), [&](const Grid& h) { return h.at(v) != 0; }) < 2;
    });
    if (apart) expectSolid(repairMesh(soupOf(file), MeshRepair::kMend), exact, organ, place, inside, seed + ", a soup");
  }
}

// A wall of no thickness is no wall.
TEST(Labels, AHollowThatTouchesTheOutsideIsOpenThere) {
  for (const int depth : {1, 0}) {
    Grid grid(4);
    grid.forEach([&](const Voxel& v) { grid.set(v, 1); });
    const auto hollow = [&](const Voxel& v) { return v == Voxel{depth, 1, 1} || v == Voxel{depth + 1, 1, 1}; };
    TriangleMesh file = surfaceOf(grid, [&](const Voxel& v) { return grid.at(v) == 1; });
    shapes::append(file, shapes::turnedInsideOut(surfaceOf(grid, hollow)));
    const auto inside = [&](const Voxel& v) { return grid.at(v) == 1 && !hollow(v); };
    const auto one = repairMesh(file, MeshRepair::kMend);
    expectSolid(one, surfaceOf(grid, inside), grid, {}, inside, "depth " + std::to_string(depth));
    EXPECT_EQ(one->components, depth == 0 ? 1u : 2u);
    EXPECT_EQ(says(*one, "turned inwards is a hole, and touches the surface: it is open there"), depth == 0)
        << saidOf(*one);
    EXPECT_EQ(one->warnings.size(), depth == 0 ? 1u : 0u) << saidOf(*one);
  }
}

// A sheet through an organ bounds nothing, inside of it or outside.
TEST(Labels, WhatBoundsNothingIsDroppedWithAWord) {
  TriangleMesh file = boxMesh(Vec3(0.1, 0.1, 0.1), 0.05);
  const double volume = signedVolume(file);
  const Index first = static_cast<Index>(file.vertices.size());
  for (const double y : {-0.02, 0.02})
    for (const double x : {-0.06, 0.06}) file.vertices.emplace_back(x, y, 0.013);
  file.triangles.push_back({first, first + 1, first + 2});
  file.triangles.push_back({first + 1, first + 3, first + 2});
  const auto one = repairMesh(file, MeshRepair::kMend);
  ASSERT_TRUE(one.ok()) << one.error().detail;
  EXPECT_TRUE(one->solid);
  EXPECT_NEAR(signedVolume(one->mesh), volume, 1e-12 * volume);
  // 0.12 x 0.04 of that and six sides of 0.1.
  EXPECT_TRUE(says(*one, "dropped 1 open piece with 7.41 % of the area")) << saidOf(*one);
}

TriangleMesh ball(double radius) { return sphereMesh(radius, 0.25 * radius); }

/// How many of some places the answer is wrong for.
int wrongPlaces(const TriangleMesh& mesh, const Box& box, test::Random& random,
                const std::function<int(const Vec3&)>& inside) {
  const SolidQuery query(mesh);
  int wrong = 0;
  for (int k = 0; k < 500; ++k) {
    const Vec3 p =
        box.min +
        Vec3(random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1)).cwiseProduct(box.max - box.min);
    const int answer = inside(p);
    wrong += answer >= 0 && query.contains(p) != (answer == 1);
  }
  return wrong;
}

// One lumen or several, deep inside, touching the wall, or through it at one place or more; each other, too.
TEST(Labels, LumensThatGrazeOrReachThroughStayHoles) {
  for (int trial = 0; trial < trials(12); ++trial) {
    test::Random random(firstSeed() + 2000u + static_cast<unsigned>(trial));
    const std::string what = "seed " + std::to_string(firstSeed() + 2000u + static_cast<unsigned>(trial));
    const Pose pose{random.rotation(), random.vector(0.1)};
    const double scale = std::pow(10.0, random.uniform(-2.0, 1.0));
    const TriangleMesh outer = shapes::moved(ball(1.0), pose, scale);
    TriangleMesh file = outer;
    std::vector<TriangleMesh> lumens;
    for (int k = random.integer(1, 3); k > 0; --k) {
      const double radius = random.uniform(0.2, 0.6);
      const double reach = random.integer(0, 2) == 0 ? 0.0 : random.uniform(-0.1, 0.3) * radius;
      TriangleMesh lumen = ball(radius);
      if (random.integer(0, 1))  // long, and through the wall at both ends
        for (Vec3& p : lumen.vertices) p.z() *= 1.02 / radius;
      else
        for (Vec3& p : lumen.vertices) p += (1.0 - radius + reach) * Vec3::UnitX();
      lumens.push_back(shapes::moved(shapes::moved(lumen, {random.rotation(), Vec3::Zero()}), pose, scale));
      shapes::append(file, shapes::turnedInsideOut(lumens.back()));
    }
    const SolidQuery organ(outer);
    std::vector<SolidQuery> hollow;
    for (const TriangleMesh& lumen : lumens) hollow.emplace_back(lumen);
    const auto inside = [&](const Vec3& p) {
      bool within = organ.contains(p);
      double nearest = organ.distance(p);
      for (const SolidQuery& lumen : hollow) {
        within = within && !lumen.contains(p);
        nearest = std::min(nearest, lumen.distance(p));
      }
      return nearest < 1e-6 * scale ? -1 : static_cast<int>(within);
    };
    for (const bool soup : {false, true}) {
      const auto one = repairMesh(soup ? soupOf(file) : file, MeshRepair::kMend);
      ASSERT_TRUE(one.ok()) << what << ": " << one.error().detail;
      ASSERT_TRUE(one->solid) << what;
      EXPECT_TRUE(laws::isClosedOriented(one->mesh)) << what << ": " << saidOf(*one);
      EXPECT_EQ(wrongPlaces(one->mesh, boundsOf(file.vertices), random, inside), 0) << what << ": " << saidOf(*one);
      EXPECT_FALSE(one->self_intersecting) << what << ": " << saidOf(*one);
    }
  }
}

}  // namespace labels_test
}  // namespace meshless
