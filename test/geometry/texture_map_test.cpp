#include "meshless_surgery/geometry/mesh/texture_map.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/random.h"
#include "support/textured.h"

namespace meshless {
namespace texture_map_test {

/// z = 0 from 0 to 1 along x and y, in n x n squares; u = x, v = y, but for u = x + 3 from x = 0.5 on.
TextureMapPtr sheet(int n) {
  TriangleMesh mesh;
  for (int y = 0; y <= n; ++y)
    for (int x = 0; x <= n; ++x)
      mesh.vertices.emplace_back(static_cast<double>(x) / n, static_cast<double>(y) / n, 0.0);
  std::vector<TexturePoint> points;
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x) {
      const auto corner = static_cast<Index>(y * (n + 1) + x), above = corner + static_cast<Index>(n) + 1;
      for (const Triangle& t : {Triangle{corner, corner + 1, above + 1}, Triangle{corner, above + 1, above}}) {
        mesh.triangles.push_back(t);
        for (const Index v : t)
          points.push_back({static_cast<float>(mesh.vertices[v].x() + (2 * x < n ? 0.0 : 3.0)),
                            static_cast<float>(mesh.vertices[v].y())});
      }
    }
  return *TextureMap::make(mesh, points);
}

// Each with coordinates that have nothing to do with its neighbours', as at seams.
TEST(TextureMap, PartsOfATriangleHaveWhatItHad) {
  test::Random random(5);
  const TriangleMesh mesh = sphereMesh(0.1, 0.02);
  std::vector<TexturePoint> points(3 * mesh.triangles.size());
  for (TexturePoint& p : points)
    p = {static_cast<float>(random.uniform(-2, 2)), static_cast<float>(random.uniform(-2, 2))};
  const TextureMapPtr map = *TextureMap::make(mesh, points);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    std::array<Vec3, 3> part;
    std::array<TexturePoint, 3> wanted;
    for (int k = 0; k < 3; ++k) {
      Vec3 w(random.uniform(0, 1), random.uniform(0, 1), random.uniform(0, 1));
      if (t % 2 == 0) w = Vec3::Unit(k);  // whole
      w /= w.sum();
      part[k] = Vec3::Zero();
      wanted[k] = {0.0f, 0.0f};
      for (std::size_t c = 0; c < 3; ++c) {
        part[k] += w[static_cast<int>(c)] * mesh.vertices[mesh.triangles[t][c]];
        for (std::size_t axis = 0; axis < 2; ++axis)
          wanted[k][axis] += static_cast<float>(w[static_cast<int>(c)]) * points[3 * t + c][axis];
      }
    }
    const auto found = map->of(part);
    for (int k = 0; k < 3; ++k) EXPECT_LT(test::apart(wanted[k], found[k]), 1e-5f) << t;
  }
}

TEST(TextureMap, ALargerTriangleHasThePlacesBelowItsCornersOnOneSideOfASeam) {
  test::Random random(6);
  for (const int n : {8, 30}) {
    const TextureMapPtr map = sheet(n);
    int straddling = 0;
    for (int trial = 0; trial < 500; ++trial) {
      std::array<Vec3, 3> corners;
      for (Vec3& p : corners) p = Vec3(random.uniform(0, 1), random.uniform(0, 1), random.uniform(-0.02, 0.02));
      const double middle = (corners[0] + corners[1] + corners[2]).x() / 3.0;
      if (std::abs(middle - 0.5) < 1e-9) continue;
      const auto found = map->of(corners);
      for (int k = 0; k < 3; ++k) {
        const double x = middle < 0.5 ? std::min(corners[k].x(), 0.5) : std::max(corners[k].x(), 0.5) + 3.0;
        straddling += (corners[k].x() < 0.5) != (middle < 0.5);
        EXPECT_NEAR(x, found[k][0], 1e-6) << middle;
        EXPECT_NEAR(corners[k].y(), found[k][1], 1e-6);
      }
    }
    EXPECT_GT(straddling, 100);
  }
}

// As exporters write it that double the vertices of each face.
TEST(TextureMap, VerticesAtOnePlaceAreNoSeam) {
  const TextureMapPtr whole = sheet(10);
  TriangleMesh apart;
  for (const Triangle& t : whole->surface().triangles) {
    const auto first = static_cast<Index>(apart.vertices.size());
    for (const Index v : t) apart.vertices.push_back(whole->surface().vertices[v]);
    apart.triangles.push_back({first, first + 1, first + 2});
  }
  const TextureMapPtr map = *TextureMap::make(apart, whole->points());
  const std::array<Vec3, 3> corners{Vec3(0.02, 0.1, 0), Vec3(0.45, 0.2, 0), Vec3(0.3, 0.9, 0)};
  for (int k = 0; k < 3; ++k) EXPECT_LT(test::apart(whole->of(corners)[k], map->of(corners)[k]), 1e-6f);
}

// The end of a cylinder, say: the way from one side to the other leads round its middle.
TEST(TextureMap, GoesRoundAVertexOfManyTriangles) {
  const Index n = 2000;
  TriangleMesh fan;
  std::vector<TexturePoint> points;
  fan.vertices.push_back(Vec3::Zero());
  for (Index k = 0; k < n; ++k) {
    const double angle = 2.0 * M_PI * k / n;
    fan.vertices.emplace_back(std::cos(angle), std::sin(angle), -0.1);
    fan.triangles.push_back({0, 1 + k, 1 + (k + 1) % n});
  }
  for (const Triangle& t : fan.triangles)
    for (const Index v : t)
      points.push_back({static_cast<float>(fan.vertices[v].x()), static_cast<float>(fan.vertices[v].y())});
  const TextureMapPtr map = *TextureMap::make(fan, points);
  for (Index k = 0; k < n; ++k) {
    const std::array<Vec3, 3> corners{Vec3(0.0, 0.0, 1e-9), fan.vertices[1 + k], fan.vertices[1 + (k + n / 2) % n]};
    const auto found = map->of(corners);
    for (int c = 0; c < 3; ++c) {
      const TexturePoint wanted{static_cast<float>(corners[c].x()), static_cast<float>(corners[c].y())};
      EXPECT_LT(test::apart(wanted, found[c]), 1e-5f) << k;
    }
  }
}

TEST(TextureMap, RefusesWhatIsNone) {
  const test::TexturedCube cube(0.1);
  const auto refused = [](const TriangleMesh& mesh, const std::vector<TexturePoint>& points, const std::string& word) {
    const auto made = TextureMap::make(mesh, points);
    ASSERT_FALSE(made.ok()) << word;
    EXPECT_NE(std::string::npos, made.error().detail.find(word)) << made.error().detail;
  };
  EXPECT_TRUE(TextureMap::make(cube.mesh, cube.points).ok());
  refused(TriangleMesh(), {}, "no surface");
  TriangleMesh mesh = cube.mesh;
  for (Vec3& v : mesh.vertices) v = Vec3(1, 2, 3);
  refused(mesh, cube.points, "no surface");
  mesh = cube.mesh;
  mesh.vertices[5].y() = std::numeric_limits<double>::quiet_NaN();
  refused(mesh, cube.points, "vertex is not finite");
  mesh = cube.mesh;
  mesh.triangles[7][1] = static_cast<Index>(mesh.vertices.size());
  refused(mesh, cube.points, "not there");
  std::vector<TexturePoint> points = cube.points;
  points[8][1] = std::numeric_limits<float>::infinity();
  refused(cube.mesh, points, "one is not finite");
  points = cube.points;
  points.pop_back();
  refused(cube.mesh, points, "three each");
}

}  // namespace texture_map_test
}  // namespace meshless
