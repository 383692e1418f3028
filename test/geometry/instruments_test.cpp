// Parts of the instruments that are drawn.
#include "shapes/instruments.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"

namespace meshless {
namespace instruments_test {

struct Drawn {
  std::string name;
  TriangleMesh mesh;
  double reach;   // [m] along x
  double length;  // [m]
  bool jaw;
};
std::vector<Drawn> all() {
  return {{"shaft", shaftMesh(), 0.001, 0.301, false},
          {"grasping_jaw", graspingJawMesh(), 0.018, 0.020, true},
          {"scissors_blade", scissorsBladeMesh(), 0.060, 0.0672, true},
          {"scalpel", scalpelMesh(), 0.0, 0.150, false}};
}

TEST(InstrumentMeshes, AreSolidsOfARealInstrumentsSizeThatCostLittleToDraw) {
  for (const auto& [name, mesh, reach, length, jaw] : all()) {
    SCOPED_TRACE(name);
    const MeshReport report = inspectMesh(mesh);
    EXPECT_TRUE(report.closed());
    EXPECT_EQ(1u, report.components);
    EXPECT_EQ(0u, report.self_intersections);
    EXPECT_EQ(0u, report.degenerate_triangles);
    EXPECT_GT(report.signed_volume, 0.0) << "it is turned outwards";
    const Box box = boundsOf(mesh.vertices);
    EXPECT_NEAR(reach, box.max.x(), 1e-12);
    EXPECT_NEAR(length, box.max.x() - box.min.x(), 1e-12);
    EXPECT_LT(mesh.triangles.size(), 250u);
    EXPECT_LT(std::max(box.max.y() - box.min.y(), box.max.z() - box.min.z()), 0.01) << "slender";
  }
}

TEST(InstrumentMeshes, JawsMeetWhereTheyClose) {
  for (const auto& [name, mesh, reach, length, jaw] : all()) {
    if (!jaw) continue;
    const Box box = boundsOf(mesh.vertices);
    EXPECT_NEAR(0.0, box.min.y(), 1e-12) << name << ": the other half, turned about x, is on the other side";
    EXPECT_NEAR(-box.min.z(), box.max.z(), 1e-12) << name << ": and lies against this one";
  }
}

TEST(InstrumentMeshes, ShippedMeshesAreTheGeneratorsAndHaveNormalsOutwards) {
  for (const auto& [name, expected, reach, length, jaw] : all()) {
    SCOPED_TRACE(name);
    std::ifstream in(std::string(SOURCE_DIR) + "/media/instruments/" + name + ".obj");
    ASSERT_TRUE(in.good());
    std::string line;
    std::getline(in, line);
    EXPECT_EQ(line.rfind("# made by make_meshes", 0), 0u) << line;
    TriangleMesh mesh;
    Points normals;
    std::size_t along = 0;
    while (std::getline(in, line)) {
      std::replace(line.begin(), line.end(), '/', ' ');
      std::istringstream words(line);
      std::string kind;
      words >> kind;
      Vec3 p;
      if (kind == "v" && words >> p.x() >> p.y() >> p.z()) mesh.vertices.push_back(p);
      if (kind == "vn" && words >> p.x() >> p.y() >> p.z()) normals.push_back(p);
      if (kind != "f") continue;
      Triangle t, n;
      for (int k = 0; k < 3; ++k) words >> t[k] >> n[k];
      ASSERT_TRUE(words);
      for (Index& v : t) --v;
      mesh.triangles.push_back(t);
      const Vec3& a = mesh.vertices.at(t[0]);
      const Vec3 face = (mesh.vertices.at(t[1]) - a).cross(mesh.vertices.at(t[2]) - a).normalized();
      for (const Index k : n) {
        EXPECT_NEAR(1.0, normals.at(k - 1).norm(), 1e-3);
        along += normals.at(k - 1).dot(face) > 0.7;
      }
    }
    EXPECT_EQ(3 * mesh.triangles.size(), along);
    ASSERT_EQ(expected.triangles, mesh.triangles);
    ASSERT_EQ(expected.vertices.size(), mesh.vertices.size());
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v)
      EXPECT_LT((expected.vertices[v] - mesh.vertices[v]).norm(), 1e-9);
  }
}

}  // namespace instruments_test
}  // namespace meshless
