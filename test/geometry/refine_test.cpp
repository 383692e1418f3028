#include "meshless_surgery/geometry/mesh/refine.h"

#include <gtest/gtest.h>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "meshless_surgery/geometry/mesh/primitives.h"

namespace meshless {
namespace refine_test {

double longestEdge(const TriangleMesh& mesh) {
  double longest = 0.0;
  for (const Triangle& t : mesh.triangles)
    for (int k = 0; k < 3; ++k)
      longest = std::max(longest, (mesh.vertices[t[k]] - mesh.vertices[t[(k + 1) % 3]]).norm());
  return longest;
}

TEST(Refine, EdgesAreShortAndTheSurfaceIsTheSame) {
  for (TriangleMesh mesh : {boxMesh(Vec3(0.1, 0.02, 0.005), 1, 1, 1), sphereMesh(0.05, 0.06)}) {
    mesh.patches.resize(mesh.triangles.size());
    std::vector<double> areas(mesh.triangles.size(), 0.0), now(areas);
    for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
      mesh.patches[f] = static_cast<std::uint32_t>(f);
      areas[f] = surfaceArea(mesh.vertices, {mesh.triangles[f]});
    }
    for (const double longest : {0.004, 0.01, 0.033}) {
      const TriangleMesh fine = withShortEdges(mesh, longest);
      EXPECT_LE(longestEdge(fine), longest);
      EXPECT_NEAR(signedVolume(fine), signedVolume(mesh), 1e-12 * signedVolume(mesh));
      const MeshReport report = inspectMesh(fine);
      EXPECT_TRUE(report.closed()) << longest;
      EXPECT_EQ(report.self_intersections, 0u);
      ASSERT_GT(fine.vertices.size(), mesh.vertices.size());
      for (std::size_t v = 0; v < mesh.vertices.size(); ++v) EXPECT_EQ(fine.vertices[v], mesh.vertices[v]);
      ASSERT_EQ(fine.patches.size(), fine.triangles.size());
      now.assign(areas.size(), 0.0);
      for (std::size_t f = 0; f < fine.triangles.size(); ++f)
        now[fine.patches[f]] += surfaceArea(fine.vertices, {fine.triangles[f]});
      for (std::size_t f = 0; f < areas.size(); ++f) EXPECT_NEAR(now[f], areas[f], 1e-12 * areas[f]);
    }
  }
}

TEST(Refine, WhatIsFineStaysAsItIs) {
  const TriangleMesh mesh = sphereMesh(0.05, 0.01);
  const TriangleMesh same = withShortEdges(mesh, longestEdge(mesh));
  EXPECT_EQ(same.vertices, mesh.vertices);
  EXPECT_EQ(same.triangles, mesh.triangles);
}

}  // namespace refine_test
}  // namespace meshless
