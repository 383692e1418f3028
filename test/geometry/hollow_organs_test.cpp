// Shapes of the scene abdomen.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "shapes/hollow_organs.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"

namespace meshless {
namespace hollow_organs_test {

struct Made {
  std::string name;
  TriangleMesh mesh;
  Vec3 size;  // [m]
  bool closed;
};
std::vector<Made> all() {
  return {{"gallbladder", gallbladderMesh(), Vec3(0.072, 0.032, 0.03), true},
          {"stomach", stomachMesh(), Vec3(0.14, 0.064, 0.052), true},
          {"vessel", vesselMesh(), Vec3(0.05, 0.006, 0.006), true},
          {"omentum", omentumMesh(), Vec3(0.11, 0.09, 0.003), false}};
}

TEST(HollowOrgans, AreEmbeddedAndOfARealOrgansSize) {
  for (const auto& [name, mesh, size, closed] : all()) {
    SCOPED_TRACE(name);
    const MeshReport report = inspectMesh(mesh);
    EXPECT_EQ(report.closed(), closed);
    EXPECT_EQ(report.components, 1u);
    EXPECT_EQ(report.self_intersections, 0u);
    if (closed) EXPECT_GT(report.signed_volume, 0.0) << "it is turned outwards";
    const Box box = boundsOf(mesh.vertices);
    EXPECT_LT((box.max - box.min - size).cwiseAbs().maxCoeff(), 0.1 * size.maxCoeff())
        << (box.max - box.min).transpose();
    EXPECT_LT((box.max + box.min).norm(), 0.01 * size.maxCoeff());
  }
  EXPECT_NEAR(inspectMesh(vesselMesh()).signed_volume, M_PI * (9e-6 - 3.24e-6) * 0.05, 0.03 * M_PI * 5.76e-6 * 0.05);
}

TEST(HollowOrgans, ShippedMeshesAreTheGenerators) {
  for (const auto& [name, expected, size, is_closed] : all()) {
    std::ifstream in(std::string(SOURCE_DIR) + "/config/meshes/" + name + ".obj");
    ASSERT_TRUE(in.good()) << name;
    std::string line;
    std::getline(in, line);
    EXPECT_EQ(line.rfind("# made by make_meshes", 0), 0u) << name << ": " << line;
    std::size_t vertices = 0, faces = 0;
    Vec3 sum = Vec3::Zero(), wanted = Vec3::Zero();
    while (std::getline(in, line)) {
      std::istringstream words(line);
      std::string kind;
      words >> kind;
      Vec3 p;
      if (kind == "v" && words >> p.x() >> p.y() >> p.z()) {
        ++vertices;
        sum += p.cwiseAbs2();
      }
      faces += kind == "f";
    }
    for (const Vec3& p : expected.vertices) wanted += p.cwiseAbs2();
    EXPECT_NEAR(double(vertices), double(expected.vertices.size()), 0.02 * expected.vertices.size()) << name;
    EXPECT_NEAR(double(faces), double(expected.triangles.size()), 0.02 * expected.triangles.size()) << name;
    EXPECT_LT((sum - wanted).norm(), 0.02 * wanted.norm()) << name;
  }
}

}  // namespace hollow_organs_test
}  // namespace meshless
