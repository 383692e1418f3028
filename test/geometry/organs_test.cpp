#include "shapes/organs.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "support/shapes.h"

namespace meshless {
namespace organs_test {

std::vector<shapes::Shape> organs(unsigned seed) {
  return {{"liver", liverMesh(seed)}, {"kidney", kidneyMesh(seed)}, {"fish", fishMesh(seed)}};
}

Vec3 sizeOf(const TriangleMesh& mesh) {
  const Box box = boundsOf(mesh.vertices);
  return box.max - box.min;
}

/// [degrees], of all triangles, ascending.
std::vector<double> smallestAngles(const TriangleMesh& mesh) {
  std::vector<double> angles;
  for (const Triangle& t : mesh.triangles) {
    double smallest = 180.0;
    for (int k = 0; k < 3; ++k) {
      const Vec3 a = mesh.vertices[t[(k + 1) % 3]] - mesh.vertices[t[k]];
      const Vec3 b = mesh.vertices[t[(k + 2) % 3]] - mesh.vertices[t[k]];
      smallest = std::min(smallest, std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / 3.14159265358979323846);
    }
    angles.push_back(smallest);
  }
  std::sort(angles.begin(), angles.end());
  return angles;
}

TEST(Organs, AreClosedEmbeddedAndOutwardsForEverySeed) {
  for (const unsigned seed : {1u, 9u, 4000000000u})
    for (const auto& [name, mesh] : organs(seed)) {
      const MeshReport report = inspectMesh(mesh);
      EXPECT_TRUE(report.closed()) << name << " " << seed;
      EXPECT_EQ(report.self_intersections, 0u) << name << " " << seed;
      EXPECT_EQ(report.degenerate_triangles, 0u) << name << " " << seed;
      EXPECT_EQ(report.components, 1u) << name << " " << seed;
      EXPECT_GT(report.signed_volume, 0.0) << name << " " << seed;
      // A ball's topology: no handles.
      EXPECT_EQ(mesh.vertices.size(), mesh.triangles.size() / 2 + 2) << name << " " << seed;
    }
}

TEST(Organs, TrianglesAreWellShaped) {
  for (const auto& [name, mesh] : organs(1)) {
    const std::vector<double> angles = smallestAngles(mesh);
    EXPECT_GT(angles.front(), 15.0) << name;
    EXPECT_GT(angles[angles.size() / 100], 30.0) << name;
    EXPECT_GT(angles[angles.size() / 2], 45.0) << name;
  }
}

TEST(Organs, HaveTheirSizeAndCount) {
  const TriangleMesh liver = liverMesh(), kidney = kidneyMesh(), fish = fishMesh();
  EXPECT_GE(liver.triangles.size(), 4000u);
  EXPECT_LE(liver.triangles.size(), 6000u);
  EXPECT_NEAR(sizeOf(liver).x(), 0.22, 0.01);
  EXPECT_NEAR(signedVolume(liver), 1.2e-3, 0.4e-3);  // [m^3] of an adult's
  EXPECT_NEAR(sizeOf(kidney).x(), 0.11, 0.005);
  EXPECT_NEAR(signedVolume(kidney), 1.5e-4, 0.5e-4);
  EXPECT_NEAR(static_cast<double>(fish.triangles.size()), 2300.0, 500.0);
  EXPECT_NEAR(sizeOf(fish).x(), 0.3, 0.03);
  EXPECT_GT(sizeOf(fish).y(), 2.0 * sizeOf(fish).z());  // flat
  for (const auto& [name, mesh] : organs(1)) {
    const Box box = boundsOf(mesh.vertices);
    EXPECT_LT((box.min + box.max).norm(), 1e-9) << name;
  }
}

TEST(Organs, LiverHasALargeRightLobeASmallLeftOneAndANotch) {
  const TriangleMesh liver = liverMesh();
  const SolidQuery query(liver);
  // Extent along y and area of the section at x, on a grid of 2 mm.
  const auto section = [&](double x) {
    double area = 0.0, lowest = 1.0;
    for (double y = -0.1; y <= 0.1; y += 0.002)
      for (double z = -0.06; z <= 0.06; z += 0.002)
        if (query.contains(Vec3(x, y, z))) {
          area += 4e-6;
          lowest = std::min(lowest, y);
        }
    return std::make_pair(area, lowest);
  };
  double right = 0.0, left = 0.0;
  for (double x = -0.1; x < 0.0; x += 0.01) right += section(x).first;
  for (double x = 0.02; x < 0.12; x += 0.01) left += section(x).first;
  EXPECT_GT(right, 2.0 * left);
  EXPECT_GT(left, 0.1 * right);
  // Between the lobes the lower margin goes up and comes down again.
  double highest = -1.0, at = 0.0;
  for (double x = 0.0; x <= 0.04; x += 0.002) {
    const double low = section(x).second;
    if (low > highest) {
      highest = low;
      at = x;
    }
  }
  EXPECT_GT(highest, section(at - 0.016).second + 0.015);
  EXPECT_GT(highest, section(at + 0.016).second + 0.008);
}

TEST(Organs, KidneyIsHollowAtTheHilum) {
  const TriangleMesh kidney = kidneyMesh();
  const SolidQuery query(kidney);
  const Box box = boundsOf(kidney.vertices);
  // From below, the middle is reached later than both poles' sides.
  const auto depth = [&](double x) {
    double y = box.min.y();
    while (y < box.max.y() && !query.contains(Vec3(x, y, 0.0))) y += 0.0005;
    return y - box.min.y();
  };
  EXPECT_GT(depth(0.0), depth(0.025) + 0.004);
  EXPECT_GT(depth(0.0), depth(-0.025) + 0.004);
}

TEST(Organs, FishHasAForkedTailAndADorsalFin) {
  const TriangleMesh fish = fishMesh();
  const SolidQuery query(fish);
  const Box box = boundsOf(fish.vertices);
  // Pieces of the line along y at x, in the middle of the thickness.
  const auto pieces = [&](double x) {
    std::vector<double> lengths;
    bool inside = false;
    for (double y = box.min.y() - 0.001; y < box.max.y() + 0.001; y += 0.0005) {
      const bool now = query.contains(Vec3(x, y, 0.0));
      if (now && !inside) lengths.push_back(0.0);
      if (now) lengths.back() += 0.0005;
      inside = now;
    }
    return lengths;
  };
  EXPECT_EQ(pieces(box.min.x() + 0.015).size(), 2u);  // the fork
  EXPECT_EQ(pieces(box.max.x() - 0.05).size(), 1u);   // the head
  ASSERT_EQ(pieces(box.min.x() + 0.07).size(), 1u);   // the stalk
  EXPECT_LT(pieces(box.min.x() + 0.07)[0], 0.4 * sizeOf(fish).y());
  // The highest point is the fin, thinner than the trunk below it.
  Vec3 top = fish.vertices[0];
  for (const Vec3& p : fish.vertices)
    if (p.y() > top.y() && std::abs(p.x()) < 0.1) top = p;
  const auto thickness = [&](double y) {
    double sum = 0.0;
    for (double z = box.min.z(); z < box.max.z(); z += 0.0005)
      if (query.contains(Vec3(top.x(), y, z))) sum += 0.0005;
    return sum;
  };
  EXPECT_LT(thickness(top.y() - 0.01), 0.6 * thickness(0.0));
}

TEST(Organs, SlabAndBlock) {
  const TriangleMesh slab = skinSlabMesh(), block = block32Mesh();
  EXPECT_TRUE(sizeOf(slab).isApprox(Vec3(0.2, 0.2, 0.01)));
  EXPECT_TRUE(inspectMesh(slab).closed());
  EXPECT_EQ(block.triangles.size(), 32u);
  EXPECT_EQ(block.vertices.size(), 18u);
  EXPECT_TRUE(sizeOf(block).isApprox(Vec3(0.1, 0.1, 0.05)));
}

TEST(Organs, ThePegTriangleIsARing) {
  const TriangleMesh ring = pegTriangleMesh();
  const MeshReport report = inspectMesh(ring);
  EXPECT_TRUE(report.closed());
  EXPECT_EQ(report.components, 1u);
  EXPECT_EQ(report.self_intersections, 0u);
  EXPECT_EQ(ring.vertices.size() * 2, ring.triangles.size()) << "as many handles as a torus";
  const SolidQuery query(ring);
  for (const double turn : {-0.25, 1.0 / 12.0, 5.0 / 12.0}) {  // the middles of the three walls
    const Vec3 out(std::cos(2.0 * M_PI * turn), std::sin(2.0 * M_PI * turn), 0.0);
    EXPECT_FALSE(query.contains(0.0047 * out));
    EXPECT_TRUE(query.contains(0.006 * out));
    EXPECT_FALSE(query.contains(0.0073 * out));
  }
  EXPECT_NEAR(report.signed_volume, 1.24e-6, 0.02e-6);
}

TEST(Organs, TheCupIsOpenAtItsTopAlone) {
  const TriangleMesh cup = cupMesh();
  const MeshReport report = inspectMesh(cup);
  EXPECT_TRUE(report.closed());
  EXPECT_EQ(report.components, 1u);
  EXPECT_EQ(report.self_intersections, 0u);
  EXPECT_NEAR(report.signed_volume, M_PI * (1e-4 * 0.046 - 0.64e-4 * 0.043), 0.01 * M_PI * 1e-4 * 0.046);
  const SolidQuery query(cup);
  for (const double z : {0.004, 0.02, 0.045}) {
    EXPECT_FALSE(query.contains(Vec3(0.0005, 0.0001, z)));
    EXPECT_TRUE(query.contains(Vec3(0.009, 0.0001, z)));
  }
  EXPECT_TRUE(query.contains(Vec3(0.0005, 0.0001, 0.0015)));
}

TEST(Organs, TheBladderIsHollow) {
  const MeshReport report = inspectMesh(bladderMesh());
  EXPECT_TRUE(report.closed());
  EXPECT_EQ(report.components, 2u);
  EXPECT_EQ(report.self_intersections, 0u);
  const double all = M_PI / 6.0 * 0.06 * 0.05 * 0.044, within = M_PI / 6.0 * 0.054 * 0.044 * 0.038;
  EXPECT_NEAR(report.signed_volume, all - within, 0.02 * (all - within));
}

TEST(Organs, TheSameSeedGivesTheSameMeshAnotherSeedAnother) {
  for (const unsigned seed : {1u}) {
    const auto first = organs(seed), second = organs(seed), other = organs(seed + 1);
    for (std::size_t k = 0; k < first.size(); ++k) {
      EXPECT_EQ(first[k].mesh.vertices, second[k].mesh.vertices) << first[k].name;
      EXPECT_EQ(first[k].mesh.triangles, second[k].mesh.triangles) << first[k].name;
      EXPECT_NE(first[k].mesh.vertices, other[k].mesh.vertices) << first[k].name;
    }
  }
}

/// The shipped files hold what the generator makes. Their digits may come from another processor's sine.
TEST(Organs, ShippedMeshesAreTheGenerators) {
  std::vector<shapes::Shape> all = organs(1);
  all.push_back({"bladder", bladderMesh()});
  all.push_back({"skin", skinSlabMesh()});
  all.push_back({"block", block32Mesh()});
  all.push_back({"peg_triangle", pegTriangleMesh()});
  all.push_back({"cup", cupMesh()});
  for (const auto& [name, expected] : all) {
    std::ifstream in(std::string(SOURCE_DIR) + "/config/meshes/" + name + ".obj");
    ASSERT_TRUE(in.good()) << name;
    std::string line;
    std::getline(in, line);
    EXPECT_EQ(line.rfind("# made by make_meshes", 0), 0u) << name << ": " << line;
    TriangleMesh mesh;
    while (std::getline(in, line)) {
      std::istringstream words(line);
      std::string kind;
      words >> kind;
      Vec3 p;
      Triangle t;
      if (kind == "v" && words >> p.x() >> p.y() >> p.z()) mesh.vertices.push_back(p);
      if (kind == "f" && words >> t[0] >> t[1] >> t[2]) mesh.triangles.push_back({t[0] - 1, t[1] - 1, t[2] - 1});
    }
    const MeshReport report = inspectMesh(mesh);
    EXPECT_TRUE(report.closed()) << name;
    EXPECT_EQ(report.self_intersections, 0u) << name;
    EXPECT_NEAR(report.signed_volume / signedVolume(expected), 1.0, 0.001) << name;
    EXPECT_TRUE(sizeOf(mesh).isApprox(sizeOf(expected), 0.01)) << name;
    EXPECT_NEAR(static_cast<double>(mesh.triangles.size()), static_cast<double>(expected.triangles.size()),
                0.02 * static_cast<double>(expected.triangles.size()))
        << name;
  }
}

}  // namespace organs_test
}  // namespace meshless
