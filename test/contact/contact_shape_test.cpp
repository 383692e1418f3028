#include "meshless_surgery/contact/contact_shape.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>

#include "meshless_surgery/geometry/inside.h"
#include "meshless_surgery/geometry/nearest_on_triangle.h"
#include "support/random.h"
#include "support/shapes.h"

namespace meshless {
namespace {

/// Every vertex a particle.
struct Rows {
  explicit Rows(const TriangleMesh& mesh) {
    for (Index v = 0; v < mesh.vertices.size(); ++v) particle.push_back(v);
  }
  SurfaceRows views() const { return {&particle, &none, &offsets, &none, &weights}; }
  std::vector<Index> particle, none, offsets{0};
  std::vector<double> weights;
};

struct Shaped {
  explicit Shaped(const TriangleMesh& mesh) : rows(mesh), shape(mesh, rows.views(), 0.0) {}
  Rows rows;
  ContactShape shape;
};

Box boundsOf(const TriangleMesh& mesh) {
  Box box;
  for (const Vec3& p : mesh.vertices) box.extend(p);
  return box;
}

double leastDistance(const TriangleMesh& mesh, const Vec3& p) {
  double least = std::numeric_limits<double>::infinity();
  for (const Triangle& t : mesh.triangles)
    least = std::min(least,
                     (nearestOnTriangle(p, mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]) - p).norm());
  return least;
}

Vec3 pointOf(const TriangleMesh& mesh, const ContactShape::Nearest& found) {
  Vec3 p = Vec3::Zero();
  for (int k = 0; k < 3; ++k) p += found.weights[k] * mesh.vertices[mesh.triangles[found.triangle][k]];
  return p;
}

// A plate with a ridge or a valley along y every centimetre.
TriangleMesh corrugated(const std::vector<double>& heights, double length) {
  TriangleMesh mesh;
  const Index n = static_cast<Index>(heights.size());
  for (Index k = 0; k < n; ++k)
    for (double z : {0.0, heights[k]})
      for (double y : {0.0, length}) mesh.vertices.push_back({0.01 * k, y, z});
  const auto quad = [&](Index a, Index b, Index c, Index d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  for (Index k = 0; k + 1 < n; ++k) {
    const Index a = 4 * k, b = a + 4;
    quad(a + 2, b + 2, b + 3, a + 3);
    quad(a, a + 1, b + 1, b);
    quad(a, b, b + 2, a + 2);
    quad(a + 1, a + 3, b + 3, b + 1);
  }
  const Index e = 4 * (n - 1);
  quad(0, 2, 3, 1);
  quad(e, e + 1, e + 3, e + 2);
  return mesh;
}

// Two shallow cones of n slivers each about one axis, as of a coin that is cut from its centre.
TriangleMesh slicedCoin(Index n) {
  TriangleMesh mesh;
  mesh.vertices = {{0.0, 0.0, -1e-2}, {0.0, 0.0, 1e-2}};
  for (Index k = 0; k < n; ++k) {
    const double angle = 2.0 * 3.14159265358979323846 * k / n;
    mesh.vertices.push_back({0.1 * std::cos(angle), 0.1 * std::sin(angle), 0.0});
    mesh.triangles.push_back({0, 2 + (k + 1) % n, 2 + k});
    mesh.triangles.push_back({1, 2 + k, 2 + (k + 1) % n});
  }
  return mesh;
}

std::vector<shapes::Shape> withSlivers(std::vector<shapes::Shape> shapes) {
  shapes.push_back({"sliced coin", slicedCoin(400)});
  shapes.push_back({"corrugated plate", corrugated({0.02, 0.05, 0.03, 0.06, 0.01, 0.04}, 0.2)});
  return shapes;
}

// Without corners sharper than a cube's, which have tests of their own.
std::vector<shapes::Shape> triedShapes() {
  std::vector<shapes::Shape> tried;
  for (const shapes::Shape& shape : shapes::allShapes())
    for (const char* name : {"cube of 12 triangles", "box", "thin slab", "sphere", "torus", "turned torus",
                             "hollow sphere", "arch", "liver"})
      if (shape.name == name) tried.push_back(shape);
  return tried;
}

/// Points in and around a mesh: anywhere, near the surface, at its vertices and on its edges.
Points pointsAround(const TriangleMesh& mesh, test::Random& random, int count) {
  const Box bounds = boundsOf(mesh);
  const Vec3 centre = 0.5 * (bounds.min + bounds.max), half = 0.5 * (bounds.max - bounds.min);
  Points points;
  for (int k = 0; k < count; ++k) {
    points.push_back(centre + 1.3 * random.vector(1.0).cwiseProduct(half));
    const Triangle& t =
        mesh.triangles[static_cast<std::size_t>(random.integer(0, static_cast<int>(mesh.triangles.size()) - 1))];
    const double u = random.uniform(0.0, 1.0), v = random.uniform(0.0, 1.0 - u);
    const Vec3 on = mesh.vertices[t[0]] + u * (mesh.vertices[t[1]] - mesh.vertices[t[0]]) +
                    v * (mesh.vertices[t[2]] - mesh.vertices[t[0]]);
    points.push_back(on + random.vector(0.01 * half.minCoeff()));
    points.push_back(mesh.vertices[t[0]] + random.vector(0.05 * half.minCoeff()));
    points.push_back(0.5 * (mesh.vertices[t[0]] + mesh.vertices[t[1]]));
  }
  return points;
}

TEST(ContactShape, NearestIsWhatASearchOfAllTrianglesFinds) {
  test::Random random(21);
  for (const shapes::Shape& tried : withSlivers(triedShapes())) {
    const Shaped shaped(tried.mesh);
    const double size = boundsOf(tried.mesh).diagonal();
    const SolidQuery solid(tried.mesh);
    const int count = tried.mesh.triangles.size() > 2000 ? 60 : 200;
    std::size_t in = 0, out = 0;
    for (const Vec3& p : pointsAround(tried.mesh, random, count)) {
      ContactShape::Nearest found;
      ASSERT_TRUE(shaped.shape.nearest(p, found)) << tried.name;
      const double expected = leastDistance(tried.mesh, p);
      ASSERT_NEAR(std::abs(found.distance), expected, 1e-9 * size) << tried.name << " at " << p.transpose();
      ASSERT_NEAR((pointOf(tried.mesh, found) - p).norm(), expected, 1e-8 * size) << tried.name;
      double sum = 0.0;
      for (const double w : found.weights) {
        ASSERT_GE(w, -1e-9) << tried.name;
        sum += w;
      }
      ASSERT_NEAR(sum, 1.0, 1e-9) << tried.name;
      if (expected < 1e-6 * size) continue;  // on the surface: neither in nor out
      ASSERT_EQ(found.distance < 0.0, solid.contains(p)) << tried.name << " at " << p.transpose();
      ++(found.distance < 0.0 ? in : out);
    }
    EXPECT_GT(in, 10u) << tried.name;
    EXPECT_GT(out, 10u) << tried.name;
  }
}

TEST(ContactShape, FilledCellsAnswerAsTheFirstSearchesDo) {
  test::Random random(22);
  for (const shapes::Shape& tried : triedShapes()) {
    const Shaped shaped(tried.mesh);
    EXPECT_EQ(shaped.shape.cellsFilled(), 0u) << tried.name;
    const std::size_t bytes = shaped.shape.bytes();
    const double size = boundsOf(tried.mesh).diagonal();
    for (const Vec3& p : pointsAround(tried.mesh, random, 25)) {
      if (leastDistance(tried.mesh, p) < 1e-9 * size) continue;  // see below
      ContactShape::Nearest first;
      ASSERT_TRUE(shaped.shape.nearest(p, first));
      for (int again = 0; again < 6; ++again) {
        ContactShape::Nearest found;
        ASSERT_TRUE(shaped.shape.nearest(p, found));
        ASSERT_EQ(found.triangle, first.triangle) << tried.name << " at " << p.transpose() << ", time " << again;
        ASSERT_EQ(found.above, first.above) << tried.name;
        ASSERT_NEAR(found.distance, first.distance, 1e-14 * size) << tried.name;
        for (int k = 0; k < 3; ++k) ASSERT_NEAR(found.weights[k], first.weights[k], 1e-12) << tried.name;
      }
    }
    EXPECT_GT(shaped.shape.cellsFilled(), 0u) << tried.name;
    EXPECT_GT(shaped.shape.bytes(), bytes) << tried.name;
  }
}

// Exactly on an edge both of its triangles are at no distance but rounding's: the answer must not change with the order
// in which they are queried, or two threads would not give what one gives.
TEST(ContactShape, FilledCellsAnswerAsTheFirstSearchesDoOnTheSurfaceToo) {
  for (const shapes::Shape& tried : triedShapes()) {
    const Shaped shaped(tried.mesh);
    std::size_t changed = 0, checked = 0;
    for (Index t = 0; t < tried.mesh.triangles.size() && checked < 300; ++t) {
      const Triangle& c = tried.mesh.triangles[t];
      const Vec3 p = 0.5 * (tried.mesh.vertices[c[0]] + tried.mesh.vertices[c[1]]);
      ContactShape::Nearest first, found;
      ASSERT_TRUE(shaped.shape.nearest(p, first));
      for (int again = 0; again < 6; ++again) ASSERT_TRUE(shaped.shape.nearest(p, found));
      changed += found.triangle != first.triangle || found.distance != first.distance;
      ++checked;
    }
    EXPECT_EQ(changed, 0u) << tried.name << " of " << checked;
  }
}

TEST(ContactShape, ACellIsFilledOnlyWhereItIsAskedForOften) {
  const Shaped shaped(shapes::moved(sphereMesh(0.1, 0.02), Pose{}));
  ContactShape::Nearest found;
  for (int k = 0; k < 3; ++k) ASSERT_TRUE(shaped.shape.nearest(Vec3(0.08, 0.01, 0.02), found));
  EXPECT_EQ(shaped.shape.cellsFilled(), 0u);
  for (int k = 0; k < 20; ++k) ASSERT_TRUE(shaped.shape.nearest(Vec3(0.08, 0.01, 0.02), found));
  EXPECT_EQ(shaped.shape.cellsFilled(), 1u);
}

// On an edge or a corner several triangles are equally near: the sign has to be that of the solid. In front of a sharp
// edge the nearest triangle alone can be seen from behind.
TEST(ContactShape, OnTiesTheSignIsThatOfTheSolid) {
  for (const shapes::Shape& tried : triedShapes()) {
    const Shaped shaped(tried.mesh);
    const SolidQuery solid(tried.mesh);
    const double size = boundsOf(tried.mesh).diagonal();
    test::Random random(23);
    std::size_t checked = 0;
    for (int k = 0; k < 200; ++k) {
      const Index v = static_cast<Index>(random.integer(0, static_cast<int>(tried.mesh.vertices.size()) - 1));
      // Off a vertex in a direction in which it stays the nearest feature, where there is one.
      const Vec3 p = tried.mesh.vertices[v] + 0.004 * size * random.unit();
      ContactShape::Nearest found;
      ASSERT_TRUE(shaped.shape.nearest(p, found));
      if (leastDistance(tried.mesh, p) < 1e-6 * size) continue;
      ASSERT_EQ(found.distance < 0.0, solid.contains(p)) << tried.name << " at " << p.transpose();
      ++checked;
    }
    EXPECT_GT(checked, 100u) << tried.name;
  }
}

// Where three triangles meet in a sharp corner, the plane that is farthest can have the point on its inner side.
TEST(ContactShape, AtSharpCornersTheSignIsThatOfTheSolid) {
  test::Random random(25);
  const TriangleMesh mesh = shapes::tetrahedron();
  const Shaped shaped(mesh);
  const SolidQuery solid(mesh);
  const Points points = pointsAround(mesh, random, 500);
  std::size_t wrong = 0;
  for (const Vec3& p : points) {
    ContactShape::Nearest found;
    ASSERT_TRUE(shaped.shape.nearest(p, found));
    wrong += leastDistance(mesh, p) > 1e-7 && (found.distance < 0.0) != solid.contains(p);
  }
  EXPECT_EQ(wrong, 0u) << "of " << points.size();
}

// Well outside it is one of the nearest: of a grid that ends near the bounds the last cell answers.
TEST(ContactShape, FarPointsAreOutsideAndNearerToNoCornerOfTheBounds) {
  test::Random random(24);
  for (const shapes::Shape& tried : triedShapes()) {
    const Shaped shaped(tried.mesh);
    const Box bounds = boundsOf(tried.mesh);
    const double size = bounds.diagonal();
    for (const double far : {1.0, 10.0, 1e4})
      for (int k = 0; k < 20; ++k) {
        const Vec3 p = 0.5 * (bounds.min + bounds.max) + far * size * random.unit();
        for (int again = 0; again < 6; ++again) {
          ContactShape::Nearest found;
          ASSERT_TRUE(shaped.shape.nearest(p, found));
          ASSERT_GT(found.distance, 0.0) << tried.name << " at " << p.transpose();
          const double expected = leastDistance(tried.mesh, p);
          ASSERT_GE(found.distance, expected * (1.0 - 1e-9)) << tried.name;
          ASSERT_LE(found.distance, expected + size) << tried.name;
        }
      }
  }
}

TEST(ContactShape, WhatCannotBeQueriedIsSaid) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  ContactShape::Nearest found;
  const Shaped cube(boxMesh(Vec3::Ones(), 2, 2, 2));
  EXPECT_FALSE(cube.shape.nearest(Vec3(nan, 0, 0), found));
  EXPECT_FALSE(cube.shape.nearest(Vec3(0, std::numeric_limits<double>::infinity(), 0), found));
  EXPECT_EQ(found.triangle, kNoIndex);
  const Shaped nothing{TriangleMesh()};
  EXPECT_FALSE(nothing.shape.nearest(Vec3::Zero(), found));
  EXPECT_TRUE(nothing.shape.samples().empty());
  TriangleMesh cloud;
  cloud.vertices = {Vec3(0, 0, 0), Vec3(1, 0, 0), Vec3(0, 1, 1)};
  const Shaped points(cloud);
  EXPECT_FALSE(points.shape.nearest(Vec3::Zero(), found));
}

TEST(ContactShape, AcrossAnEdgeIsTheOtherTriangleThatHasIt) {
  for (const shapes::Shape& tried : triedShapes()) {
    const Shaped shaped(tried.mesh);
    for (Index t = 0; t < tried.mesh.triangles.size(); ++t)
      for (int corner = 0; corner < 3; ++corner) {
        const Index other = shaped.shape.across(t, corner);
        ASSERT_NE(other, kNoIndex) << tried.name;
        ASSERT_NE(other, t) << tried.name;
        // The edge runs the other way in it.
        const Index a = tried.mesh.triangles[t][(corner + 1) % 3], b = tried.mesh.triangles[t][(corner + 2) % 3];
        int back = -1;
        for (int k = 0; k < 3; ++k)
          if (tried.mesh.triangles[other][(k + 1) % 3] == b && tried.mesh.triangles[other][(k + 2) % 3] == a) back = k;
        ASSERT_GE(back, 0) << tried.name << " triangle " << t << " corner " << corner;
        ASSERT_EQ(shaped.shape.across(other, back), t) << tried.name;
      }
  }
  TriangleMesh open = boxMesh(Vec3::Ones(), 1, 1, 1);
  open.triangles.pop_back();
  const Shaped shaped(open);
  std::size_t borders = 0;
  for (Index t = 0; t < open.triangles.size(); ++t)
    for (int corner = 0; corner < 3; ++corner) borders += shaped.shape.across(t, corner) == kNoIndex;
  EXPECT_EQ(borders, 3u);
}

TEST(ContactShape, SamplesAreTheVerticesAndPointsOnLongSharpEdges) {
  const auto onEdges = [](const ContactShape& shape) {
    std::size_t count = 0;
    for (const ContactSample& s : shape.samples()) count += s.share > 0.0;
    return count;
  };
  {  // Half the thickness below an edge, to the other side: 0.1 sqrt(2) / 2. Of 1 m, fifteen parts.
    const TriangleMesh bar = boxMesh(Vec3(1.0, 0.1, 0.1), 1, 1, 1);
    const Shaped shaped(bar);
    EXPECT_EQ(shaped.shape.samples().size() - onEdges(shaped.shape), 8u);
    std::vector<double> along;
    for (const ContactSample& s : shaped.shape.samples()) {
      if (s.share == 0.0) continue;
      const Vec3 &a = bar.vertices[s.vertices[0]], &b = bar.vertices[s.vertices[1]];
      const Vec3 edge = b - a;
      EXPECT_GT(s.share, 0.0);
      EXPECT_LT(s.share, 1.0);
      EXPECT_EQ((edge.cwiseAbs().array() > 1e-9).count(), 1) << "a diagonal of a flat side has no samples";
      if (std::abs(edge.x()) > 0.5) along.push_back((a + s.share * edge).x());
    }
    std::sort(along.begin(), along.end());
    ASSERT_GE(along.size(), 4u * 9u);
    double gap = std::max(along.front() + 0.5, 0.5 - along.back());
    for (std::size_t k = 4; k < along.size(); k += 4) gap = std::max(gap, along[k] - along[k - 4]);
    EXPECT_LE(gap, 0.5 * 0.1 * std::sqrt(2.0) + 1e-9);
  }
  {  // short edges are held by their ends
    const Shaped ball(sphereMesh(0.1, 0.005));
    EXPECT_EQ(onEdges(ball.shape), 0u);
    EXPECT_EQ(ball.shape.samples().size(), ball.shape.surface().vertices.size());
  }
}

double depthBelow(const TriangleMesh& mesh, const Vec3& from, const Vec3& direction) {
  double depth = std::numeric_limits<double>::infinity();
  for (const Triangle& t : mesh.triangles) {
    Mat3 m;
    m.col(0) = mesh.vertices[t[1]] - mesh.vertices[t[0]];
    m.col(1) = mesh.vertices[t[2]] - mesh.vertices[t[0]];
    m.col(2) = -direction;
    if (std::abs(m.determinant()) < 1e-15) continue;
    const Vec3 x = m.inverse() * (from - mesh.vertices[t[0]]);
    if (x[0] >= -1e-9 && x[1] >= -1e-9 && x[0] + x[1] <= 1.0 + 1e-9 && x[2] > 1e-6) depth = std::min(depth, x[2]);
  }
  return depth;
}

TEST(ContactShape, ManyLongEdgesAreSampledByTheDepthBelowThem) {
  test::Random random(7);
  std::vector<double> heights;
  for (int k = 0; k < 150; ++k) heights.push_back(k % 2 ? random.uniform(0.02, 0.03) : random.uniform(0.04, 0.05));
  const double length = 0.06;
  const TriangleMesh plate = corrugated(heights, length);
  const Shaped shaped(plate);
  std::map<std::array<Index, 2>, int> parts;
  for (const ContactSample& s : shaped.shape.samples())
    if (s.share > 0.0) parts[s.vertices] = 1 + parts[s.vertices] + (parts[s.vertices] == 0);
  for (Index k = 1; k + 1 < heights.size(); ++k) {
    const Index v = 4 * k + 2;
    const auto normal = [&](Index a, Index b) -> Vec3 {
      return Vec3::UnitY().cross(plate.vertices[a] - plate.vertices[b]).normalized();
    };
    const Vec3 inwards = -(normal(v - 4, v) + normal(v, v + 4)).normalized();
    ASSERT_LT(inwards.z(), 0.0);
    const double half = 0.5 * depthBelow(plate, 0.5 * (plate.vertices[v] + plate.vertices[v + 1]), inwards);
    const int expected = static_cast<int>(std::ceil(0.999 * length / half));
    EXPECT_GT(expected, 1);
    EXPECT_EQ((parts[{v, v + 1}]), expected) << k << " " << half;
  }
}

// Between many cuts lie slivers by the thousand: their samples would be most of all there are.
TEST(ContactShape, SliversHaveNoMoreSamplesThanAFewTimesTheirVertices) {
  std::vector<double> heights;
  for (int k = 0; k < 400; ++k) heights.push_back(k % 2 ? 1e-3 : 6e-3);
  const TriangleMesh plate = corrugated(heights, 0.2);
  const Shaped shaped(plate);
  std::map<std::array<Index, 2>, int> of_edge;
  std::size_t on_edges = 0;
  for (const ContactSample& s : shaped.shape.samples()) {
    if (!(s.share > 0.0)) continue;
    ++on_edges;
    ++of_edge[s.vertices];
  }
  EXPECT_LE(on_edges, 4 * plate.vertices.size());
  EXPECT_GE(on_edges, 2 * plate.vertices.size());
  for (Index k = 1; k + 1 < heights.size(); ++k) EXPECT_GE((of_edge[{4 * k + 2, 4 * k + 3}]), 2) << k;
}

TEST(ContactShape, CrowdedAreMeshesOfSlivers) {
  for (const shapes::Shape& shape : triedShapes()) EXPECT_LT(Shaped(shape.mesh).shape.crowding(), 2.0) << shape.name;
  EXPECT_GT(Shaped(slicedCoin(1000)).shape.crowding(), 10.0);
}

// Whichever thread comes first: a cell that is filled says what the search said before it was.
TEST(ContactShape, WhoHasAskedBeforeDoesNotMatter) {
  std::vector<shapes::Shape> tried = withSlivers(shapes::allShapes());
  TriangleMesh flat = boxMesh(Vec3(0.1, 0.1, 0.1), 0.05);  // corners with sines of 1e-3 down to 1e-5
  for (Vec3& p : flat.vertices) p.y() *= p.x() > 0.0 ? 1e-3 : 1e-5;
  tried.push_back({"flattened box", flat});
  for (const shapes::Shape& shape : tried) {
    SCOPED_TRACE(shape.name);
    const Box bounds = boundsOf(shape.mesh);
    const double size = bounds.diagonal();
    const Shaped asked(shape.mesh);
    test::Random random(5);
    for (int n = 0; n < 100; ++n) {
      const Triangle& t = shape.mesh.triangles[static_cast<std::size_t>(
          random.integer(0, static_cast<int>(shape.mesh.triangles.size()) - 1))];
      const double u = random.uniform(0, 1), v = random.uniform(0, 1 - u);
      Vec3 p = (1 - u - v) * shape.mesh.vertices[t[0]] + u * shape.mesh.vertices[t[1]] + v * shape.mesh.vertices[t[2]];
      // On the surface but for rounding, near it, and beyond the cells.
      const double off[] = {0.0, 1e-15, 1e-12, 0.01, 1.0};
      p += off[n % 5] * size * random.unit();
      ContactShape::Nearest first, later;
      const Shaped fresh(shape.mesh);
      ASSERT_TRUE(fresh.shape.nearest(p, first));
      for (int k = 0; k < 20; ++k) ASSERT_TRUE(asked.shape.nearest(p, later));
      ASSERT_EQ(first.triangle, later.triangle) << n;
      ASSERT_EQ(first.distance, later.distance) << n;
      ASSERT_EQ(std::signbit(first.distance), std::signbit(later.distance)) << n;
      ASSERT_EQ(first.weights, later.weights) << n;
      ASSERT_EQ(first.above, later.above) << n;
    }
  }
}

// A hint tells where to begin, be it right or wrong; what lies outside or clear of the surface is so.
TEST(ContactShape, HintsAndShortCutsAgreeWithTheSearch) {
  int clear = 0, outside = 0;
  for (const shapes::Shape& shape : shapes::allShapes()) {
    SCOPED_TRACE(shape.name);
    const Box bounds = boundsOf(shape.mesh);
    const double size = bounds.diagonal();
    const Shaped plain(shape.mesh), hinted(shape.mesh);
    test::Random random(6);
    for (int n = 0; n < 300; ++n) {
      const int last = static_cast<int>(shape.mesh.triangles.size()) - 1;
      const Vec3 somewhere =
          bounds.min + Vec3(random.uniform(-0.3, 1.3), random.uniform(-0.3, 1.3), random.uniform(-0.3, 1.3))
                           .cwiseProduct(bounds.max - bounds.min);
      const Vec3 corner =
          shape.mesh.vertices[shape.mesh.triangles[static_cast<std::size_t>(random.integer(0, last))][0]];
      const Vec3 p = n % 3 == 0 ? corner : n % 3 == 1 ? Vec3(corner + 1e-3 * size * random.unit()) : somewhere;
      const Index hint = static_cast<Index>(random.integer(0, last));
      ContactShape::Nearest first, later;
      ASSERT_TRUE(plain.shape.nearest(p, first));
      ASSERT_TRUE(hinted.shape.nearest(p, later, hint));
      ASSERT_EQ(first.triangle, later.triangle) << n;
      ASSERT_EQ(first.distance, later.distance) << n;
      ASSERT_EQ(first.weights, later.weights) << n;
      EXPECT_GE(hinted.shape.distanceTo(hint, p), std::abs(first.distance) * (1.0 - 1e-12)) << n;
      const double by = random.uniform(0, 0.2 * size);
      for (int asked = 0; asked < 6; ++asked)
        for (const ContactShape* shape : {&plain.shape, &hinted.shape}) {
          if (!shape->isClear(p, by)) continue;
          ++clear;
          EXPECT_GT(first.distance, by) << n;
        }
      if (hinted.shape.isOutside(p)) {
        ++outside;
        EXPECT_GT(first.distance, 0.0) << n;
      }
    }
  }
  EXPECT_GT(clear, 1200);
  EXPECT_GT(outside, 100);
}

TEST(ContactShape, ThicknessIsThatOfThinParts) {
  EXPECT_NEAR(Shaped(boxMesh(Vec3(0.2, 0.2, 0.002), 0.02)).shape.thickness(), 0.002, 1e-9);
  EXPECT_NEAR(Shaped(boxMesh(Vec3::Ones(), 2, 2, 2)).shape.thickness(), 1.0, 1e-9);
  const double tube = Shaped(torusMesh(0.1, 0.03, 0.01)).shape.thickness();
  EXPECT_GT(tube, 0.04);
  EXPECT_LT(tube, 0.0601);
  const Shaped arch(shapes::arch());
  EXPECT_LT(arch.shape.thickness(), 0.0601);
  EXPECT_EQ(arch.shape.size(), 0.06);
}

}  // namespace
}  // namespace meshless
