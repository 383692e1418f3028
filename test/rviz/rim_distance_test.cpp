#include "rim_distance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace meshless {
namespace rim_distance_test {

/// A plate of n x n squares of `side` [m], cut faces where x > at; and where the cut meets the rest: x = at.
struct Plate {
  std::vector<float> vertices;
  std::vector<std::uint32_t> triangles;
  std::vector<std::uint8_t> cut;
};
Plate plate(std::uint32_t n, float side, float at, float turned = 0.0f) {
  Plate plate;
  for (std::uint32_t j = 0; j <= n; ++j)
    for (std::uint32_t i = 0; i <= n; ++i) {
      const float x = side * static_cast<float>(i), y = side * static_cast<float>(j);
      for (const float v :
           {x * std::cos(turned) - y * std::sin(turned), x * std::sin(turned) + y * std::cos(turned), 0.3f})
        plate.vertices.push_back(v);
    }
  for (std::uint32_t j = 0; j < n; ++j)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
      for (const std::uint32_t v : {a, b, d, a, d, c}) plate.triangles.push_back(v);
      plate.cut.insert(plate.cut.end(), 2, side * (static_cast<float>(i) + 0.5f) > at);
    }
  return plate;
}

TEST(RimDistance, IsThatOfTheStraightEdgeOnBothSidesAndOnEachMesh) {
  for (const std::uint32_t n : {6u, 12u, 48u})
    for (const float turned : {0.0f, 0.7f}) {
      const float side = 0.12f / static_cast<float>(n), at = 0.06f;
      const Plate p = plate(n, side, at, turned);
      const auto distances = rimDistances(p.vertices, p.triangles, p.cut, 1.0f);
      for (std::uint32_t v = 0; v < distances.size(); ++v)
        ASSERT_NEAR(std::abs(side * static_cast<float>(v % (n + 1)) - at), distances[v], 1e-5f) << n << " " << v;
    }
}

TEST(RimDistance, EndsWhereItIsNotAskedForAnyMore) {
  const Plate p = plate(24, 0.005f, 0.06f);
  for (const float d : rimDistances(p.vertices, p.triangles, p.cut, 0.02f)) EXPECT_LE(d, 0.02f);
}

TEST(RimDistance, WithoutACutOrWithNothingElseThereIsNone) {
  Plate p = plate(6, 0.02f, 0.06f);
  for (const std::uint8_t all : {0, 1}) {
    std::fill(p.cut.begin(), p.cut.end(), all);
    for (const float d : rimDistances(p.vertices, p.triangles, p.cut, 0.5f)) EXPECT_EQ(0.5f, d);
  }
  EXPECT_TRUE(rimDistances({}, {}, {}, 1.0f).empty());
}

// What lies near in space, but far along the surface, is another fold of it.
TEST(RimDistance, GoesAlongTheSurface) {
  Plate p = plate(12, 0.01f, 0.1f);
  for (std::size_t v = 0; v < p.vertices.size(); v += 3) {  // rolled up: the first column comes to lie at the last
    const float angle = p.vertices[v] / 0.0195f;
    p.vertices[v] = 0.0195f * std::sin(angle);
    p.vertices[v + 2] = 0.0195f * std::cos(angle);
  }
  const auto distances = rimDistances(p.vertices, p.triangles, p.cut, 0.03f);
  for (std::size_t v = 0; v < distances.size(); ++v) {
    if (v % 13 < 5) {
      EXPECT_EQ(0.03f, distances[v]) << v;
    } else if (v % 13 > 8) {
      EXPECT_LT(distances[v], 0.03f) << v;
    }
  }
}

}  // namespace rim_distance_test
}  // namespace meshless
