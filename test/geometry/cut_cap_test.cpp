// Points inside the cap: how good its triangles are, and that nothing else of a cut changes with them.
#include <algorithm>
#include <map>
#include <random>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "support/cut_cases.h"
#include "support/mesh_laws.h"
#include "support/plane_cut.h"

namespace meshless {
namespace cut_cap_test {

constexpr std::uint32_t kCap = 7;

CutOptions filled(std::size_t points = kUsualCapPoints) {
  CutOptions options;
  options.cap_points = points;
  options.cap_patch = kCap;
  return options;
}

/// The corpus: convex, concave, with holes and islands, thin rings; shapes of a few triangles too.
std::vector<shapes::Shape> corpus() {
  std::vector<shapes::Shape> all = shapes::allShapes();
  for (const shapes::Shape& shape : shapes::hardShapes()) all.push_back(shape);
  all.push_back({"thin ring", torusMesh(0.1, 0.008, 0.006)});
  TriangleMesh shell = sphereMesh(0.1, 0.006);
  shapes::append(shell, shapes::turnedInsideOut(sphereMesh(0.09, 0.006)));
  shapes::append(shell, sphereMesh(0.04, 0.006), Vec3(0.02, 0.0, 0.0));
  all.push_back({"shell around a ball", shell});
  all.push_back({"fine sphere", sphereMesh(0.1, 0.004)});
  all.push_back({"fine torus", torusMesh(0.1, 0.04, 0.005)});
  return all;
}

/// [deg]
std::vector<double> smallestAngles(const TriangleMesh& mesh, std::uint32_t patch) {
  std::vector<double> angles;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (mesh.patchOf(t) != patch) continue;
    double smallest = 180.0;
    for (int k = 0; k < 3; ++k) {
      const Vec3& p = mesh.vertices[mesh.triangles[t][k]];
      const Vec3 a = mesh.vertices[mesh.triangles[t][(k + 1) % 3]] - p;
      const Vec3 b = mesh.vertices[mesh.triangles[t][(k + 2) % 3]] - p;
      smallest = std::min(smallest, std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / M_PI);
    }
    angles.push_back(smallest);
  }
  return angles;
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

/// Mean edge length of the triangles that the plane crosses [m].
double crossedEdge(const TriangleMesh& mesh, const Plane& plane) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const Triangle& t : mesh.triangles) {
    int above = 0;
    for (const Index v : t) above += plane.height(mesh.vertices[v]) > 0.0;
    if (above == 0 || above == 3) continue;
    for (int k = 0; k < 3; ++k) sum += (mesh.vertices[t[(k + 1) % 3]] - mesh.vertices[t[k]]).norm();
    count += 3;
  }
  return count ? sum / static_cast<double>(count) : 0.0;
}

/// Lengths of the cap's edges over h, of those whose ends are both farther than h from its rim.
std::vector<double> innerEdges(const CutPiece& piece, double h) {
  std::vector<bool> inner(piece.mesh.vertices.size(), false), on_cap = inner;
  for (const Index v : piece.cap_interior) inner[v] = true;
  std::vector<std::pair<Vec3, Vec3>> rim;
  std::map<std::pair<Index, Index>, int> counts;
  for (std::size_t t = 0; t < piece.mesh.triangles.size(); ++t) {
    if (piece.mesh.patchOf(t) != kCap) continue;
    for (int k = 0; k < 3; ++k) {
      const Index a = piece.mesh.triangles[t][k], b = piece.mesh.triangles[t][(k + 1) % 3];
      ++counts[{std::min(a, b), std::max(a, b)}];
    }
  }
  for (const auto& [edge, count] : counts)
    if (count == 1) rim.emplace_back(piece.mesh.vertices[edge.first], piece.mesh.vertices[edge.second]);
  std::map<Index, bool> far_of;
  const auto far = [&](Index v) {
    const auto known = far_of.find(v);
    if (known != far_of.end()) return known->second;
    bool far_from_all = true;
    const Vec3& p = piece.mesh.vertices[v];
    for (const auto& [a, b] : rim) {
      const double s = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
      far_from_all &= (p - a - s * (b - a)).norm() > h;
    }
    return far_of[v] = far_from_all;
  };
  std::vector<double> lengths;
  for (const auto& [edge, count] : counts)
    if (count == 2 && inner[edge.first] && inner[edge.second] && far(edge.first) && far(edge.second))
      lengths.push_back((piece.mesh.vertices[edge.first] - piece.mesh.vertices[edge.second]).norm() / h);
  return lengths;
}

TEST(CutCap, LawsHoldWithPointsInside) {
  for (const shapes::Shape& shape : corpus()) {
    SCOPED_TRACE(shape.name);
    std::mt19937 random(17);
    for (int i = 0; i < 25; ++i) {
      const Plane plane = shapes::hardPlane(shape.mesh, random);
      const Result<CutSurface> with = cutByPlane(shape.mesh, plane, filled());
      EXPECT_TRUE(laws::cutObeysLaws(shape.mesh, plane, filled(), with)) << "plane " << i;
      const Result<CutSurface> without = cutByPlane(shape.mesh, plane, filled(0));
      ASSERT_EQ(with.ok(), without.ok()) << "plane " << i;
      if (!with) continue;
      EXPECT_EQ(with->pieces.size(), without->pieces.size()) << "plane " << i;
      EXPECT_NEAR(with->cap_area, without->cap_area, 1e-12 * without->cap_area);
    }
  }
}

TEST(CutCap, TrianglesAreWellShaped) {
  std::vector<double> angles, lengths, share_of_shape;
  for (const shapes::Shape& shape : corpus()) {
    std::mt19937 random(23);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> unit(-0.3, 0.3);
    const Box box = boundsOf(shape.mesh.vertices);
    for (int i = 0; i < 12; ++i) {
      Plane plane;
      plane.normal = Vec3(normal(random), normal(random), normal(random)).normalized();
      plane.point =
          0.5 * (box.min + box.max) + (box.max - box.min).cwiseProduct(Vec3(unit(random), unit(random), unit(random)));
      const Result<CutSurface> cut = cutByPlane(shape.mesh, plane, filled());
      if (!cut) {
        EXPECT_EQ(cut.error().code, ErrorCode::kMissed) << shape.name;
        continue;
      }
      const double h = crossedEdge(shape.mesh, plane);
      for (const CutPiece& piece : cut->pieces) {
        if (piece.side < 0) continue;  // the same cap again
        const std::vector<double> some = smallestAngles(piece.mesh, kCap);
        angles.insert(angles.end(), some.begin(), some.end());
        const std::vector<double> edges = innerEdges(piece, h);
        lengths.insert(lengths.end(), edges.begin(), edges.end());
      }
    }
  }
  ASSERT_GT(angles.size(), 10000u);
  ASSERT_GT(lengths.size(), 10000u);
  std::array<std::size_t, 12> histogram{};
  for (const double angle : angles) ++histogram[static_cast<std::size_t>(std::min(angle, 59.9) / 5.0)];
  std::string text;
  for (const std::size_t count : histogram)
    text += std::to_string(100.0 * static_cast<double>(count) / static_cast<double>(angles.size())).substr(0, 5) + " ";
  RecordProperty("angles_percent_by_5_degrees", text);
  const double wanted =
      static_cast<double>(std::count_if(lengths.begin(), lengths.end(), [](double x) { return x >= 0.5 && x <= 2.0; }));
  std::printf(
      "%zu cap triangles, percent by 5 degrees of their smallest angle: %s\nmedian %.1f, 5th percentile %.1f; "
      "%.2f %% of %zu inner edges are 0.5..2 h long\n",
      angles.size(), text.c_str(), quantile(angles, 0.5), quantile(angles, 0.05),
      100.0 * wanted / static_cast<double>(lengths.size()), lengths.size());
  EXPECT_GE(quantile(angles, 0.5), 30.0);
  EXPECT_GE(quantile(angles, 0.05), 5.0);
  EXPECT_GE(wanted, 0.9 * static_cast<double>(lengths.size()));
}

// Through vertices of the mesh, where no triangle is crossed, or between them.
TEST(CutCap, IsAsFineThroughVerticesAsBesideThem) {
  const TriangleMesh box = boxMesh(Vec3(0.2, 0.1, 0.1), 0.02);
  CutOptions options;
  options.cap_points = 20000;
  const auto triangles = [&](double x) {
    const auto cut = cutByPlane(box, {Vec3::UnitX(), Vec3(x, 0, 0)}, options);
    EXPECT_TRUE(cut.ok());
    std::size_t in_cap = 0;
    for (const Triangle& t : cut->pieces[0].mesh.triangles)
      in_cap += std::all_of(t.begin(), t.end(),
                            [&](Index v) { return std::abs(cut->pieces[0].mesh.vertices[v].x() - x) < 1e-9; });
    return in_cap;
  };
  const auto beside = static_cast<double>(triangles(-0.011));
  EXPECT_GT(beside, 50.0);
  for (const double x : {-0.02, -0.0189}) EXPECT_NEAR(static_cast<double>(triangles(x)), beside, 0.5 * beside);
}

TEST(CutCap, TheBudgetHolds) {
  const TriangleMesh mesh = sphereMesh(0.1, 0.004);
  const Plane plane = {Vec3(0.2, 0.3, 0.9).normalized(), Vec3(0.001, 0.002, 0.003)};
  for (const std::size_t most : {1u, 10u, 100u, 500u}) {
    const Result<CutSurface> cut = cutByPlane(mesh, plane, filled(most));
    ASSERT_TRUE(laws::cutObeysLaws(mesh, plane, filled(most), cut));
    for (const CutPiece& piece : cut->pieces) {
      EXPECT_LE(piece.cap_interior.size(), most);
      if (most >= 100) {
        EXPECT_GE(piece.cap_interior.size(), most / 2);
      }
    }
  }
}

TEST(CutCap, BothSidesHaveTheSameCap) {
  for (const double roughness : {0.0, 0.004}) {
    const TriangleMesh mesh = kidneyMesh();
    const Plane plane = {Vec3(0.3, 0.2, 0.9).normalized(), solidCentroid(mesh)};
    CutOptions options = filled();
    options.roughness = roughness;
    const Result<CutSurface> cut = cutByPlane(mesh, plane, options);
    ASSERT_TRUE(cut.ok());
    // Triangles as their corners' coordinates, from the lowest corner on; those of one side turned round.
    using Corner = std::array<double, 3>;
    std::array<std::vector<std::array<Corner, 3>>, 2> caps;
    for (const CutPiece& piece : cut->pieces) {
      for (std::size_t t = 0; t < piece.mesh.triangles.size(); ++t) {
        if (piece.mesh.patches[t] != kCap) continue;
        std::array<Corner, 3> corners;
        for (int k = 0; k < 3; ++k) {
          const Vec3& p = piece.mesh.vertices[piece.mesh.triangles[t][k]];
          corners[k] = {p.x(), p.y(), p.z()};
        }
        if (piece.side > 0) std::swap(corners[1], corners[2]);
        std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
        caps[piece.side > 0].push_back(corners);
      }
    }
    for (auto& cap : caps) std::sort(cap.begin(), cap.end());
    EXPECT_GT(caps[0].size(), 200u);
    EXPECT_EQ(caps[0], caps[1]);
  }
}

TEST(CutCap, RoughnessIsSeededBoundedAndZeroAtTheRim) {
  const TriangleMesh mesh = sphereMesh(0.1, 0.004);
  const Plane plane = {Vec3(0.2, 0.3, 0.9).normalized(), Vec3(0.001, 0.002, 0.003)};
  CutOptions options = filled();
  options.roughness = 0.003;
  const auto heightsOf = [&](std::uint32_t seed) {
    options.seed = seed;
    const Result<CutSurface> cut = cutByPlane(mesh, plane, options);
    EXPECT_TRUE(laws::cutObeysLaws(mesh, plane, options, cut));
    std::vector<double> heights;
    if (!cut) return heights;
    const CutPiece& piece = cut->pieces[0];
    for (const Index v : piece.cap_interior) heights.push_back(plane.height(piece.mesh.vertices[v]));
    const double radius = std::sqrt(0.01 - plane.height(Vec3::Zero()) * plane.height(Vec3::Zero()));
    for (const Index v : piece.cap_interior) {
      const Vec3 p = piece.mesh.vertices[v] - plane.height(piece.mesh.vertices[v]) * plane.normal;
      const Vec3 centre = -plane.height(Vec3::Zero()) * plane.normal;
      const double from_rim = radius - (p - centre).norm();
      EXPECT_LE(std::abs(plane.height(piece.mesh.vertices[v])), 0.5 * from_rim + 1e-12);
    }
    for (std::size_t v = 0; v < piece.origins.size();
         ++v) {  // what is on the plane besides is the rim, and stays there
      if (piece.origins[v].parents[1] == kNoIndex) continue;
      EXPECT_NEAR(plane.height(piece.mesh.vertices[v]), 0.0, 1e-15);
    }
    return heights;
  };
  const std::vector<double> one = heightsOf(1), same = heightsOf(1), other = heightsOf(2);
  ASSERT_GT(one.size(), 1000u);
  EXPECT_EQ(one, same);
  EXPECT_NE(one, other);
  double low = 0.0, high = 0.0, squares = 0.0;
  for (const double height : one) {
    low = std::min(low, height);
    high = std::max(high, height);
    squares += height * height;
  }
  EXPECT_GE(low, -0.003);
  EXPECT_LE(high, 0.003);
  EXPECT_GT(high - low, 0.002);
  EXPECT_GT(std::sqrt(squares / static_cast<double>(one.size())), 0.0004);
  options.roughness = -1.0;
  const Result<CutSurface> refused = cutByPlane(mesh, plane, options);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(refused.error().detail.find("-1"), std::string::npos);
}

// A little below what is outermost along an axis, so that the noise would leave the solid.
TEST(CutCap, RoughnessStaysWithinTheSolid) {
  CutOptions options = filled();
  for (const shapes::Shape& shape : shapes::allShapes()) {
    SCOPED_TRACE(shape.name);
    const double size = boundsOf(shape.mesh.vertices).diagonal();
    for (const Vec3& up : {Vec3(Vec3::UnitX()), Vec3(Vec3::UnitY()), Vec3(-Vec3::UnitZ())}) {
      double top = -1e300;
      for (const Vec3& p : shape.mesh.vertices) top = std::max(top, up.dot(p));
      for (const double below : {0.004, 0.04}) {
        options.roughness = 5.0 * below * size;
        const Plane plane = {up, (top - below * size) * up};
        const Result<CutSurface> cut = cutByPlane(shape.mesh, plane, options);
        ASSERT_TRUE(laws::cutObeysLaws(shape.mesh, plane, options, cut));
        if (!cut) continue;
        for (const CutPiece& piece : cut->pieces)
          EXPECT_EQ(inspectMesh(piece.mesh).self_intersections, 0u) << "along " << up.transpose() << ", " << below;
      }
    }
  }
}

TEST(CutCap, InnerVerticesLieInThePlaneWithoutParents) {
  const TriangleMesh mesh = liverMesh();
  const Plane plane = {Vec3(0.3, 0.9, -0.2).normalized(), solidCentroid(mesh)};
  const Result<CutSurface> cut = cutByPlane(mesh, plane, filled());
  ASSERT_TRUE(cut.ok());
  std::size_t inside = 0;
  for (const CutPiece& piece : cut->pieces) {
    for (const Index v : piece.cap_interior) {
      ++inside;
      EXPECT_NEAR(plane.height(piece.mesh.vertices[v]), 0.0, 1e-15);
      for (const Index parent : piece.origins[v].parents) EXPECT_EQ(parent, kNoIndex);
    }
  }
  EXPECT_GT(inside, 200u);
}

}  // namespace cut_cap_test
}  // namespace meshless
