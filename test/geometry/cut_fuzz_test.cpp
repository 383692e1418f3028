// Random and adversarial cuts. MESHLESS_SURGERY_CUT_FUZZ sets their number (default 12000), MESHLESS_SURGERY_CUT_SEED
// the first seed. What breaks a law is written to the test's temporary folder, ready for test/corpus.
#include <cstdlib>
#include <deque>

#include <gtest/gtest.h>

#include "support/cut_cases.h"
#include "support/mesh_laws.h"
#include "support/plane_cut.h"

namespace meshless {
namespace cut_fuzz_test {

long numberFrom(const char* variable, long fallback) {
  const char* text = std::getenv(variable);
  return text ? std::strtol(text, nullptr, 10) : fallback;
}

class CutFuzz : public testing::Test {
 protected:
  long cuts_ = numberFrom("MESHLESS_SURGERY_CUT_FUZZ", 12000);
  std::uint32_t seed_ = static_cast<std::uint32_t>(numberFrom("MESHLESS_SURGERY_CUT_SEED", 1));
  int faults_ = 0;

  /// Cuts and checks; the pieces, none where the cut missed or was refused.
  std::vector<CutPiece> cutAndCheck(const TriangleMesh& mesh, const Plane& plane, const CutOptions& options,
                                    bool embedded, const std::string& name, bool worn = false) {
    Result<CutSurface> cut = cutByPlane(mesh, plane, options);
    const testing::AssertionResult law = laws::cutObeysLaws(mesh, plane, options, cut, embedded, worn);
    if (!law && ++faults_ <= 10) {
      const std::string path =
          testing::TempDir() + "cut_" + std::to_string(seed_) + "_" + std::to_string(faults_) + ".obj";
      shapes::writeCutCase(path, {mesh, plane, embedded, worn});
      ADD_FAILURE() << name << ": " << law.message() << "\nwritten to " << path;
    }
    if (cut) {
      for (const CutPiece& piece : cut->pieces) with_inner_points_ += !piece.cap_interior.empty();
      return std::move(cut->pieces);
    }
    refused_ += cut.error().code != ErrorCode::kMissed;
    return {};
  }

  /// Every third cut has points inside its cap, some of them so few that the budget bites; every ninth is rough.
  static CutOptions optionsOf(long cut, const TriangleMesh& mesh) {
    CutOptions options;
    if (cut % 3 != 1) return options;
    options.cap_points = cut % 6 == 1 ? kUsualCapPoints : 20;
    if (cut % 9 == 1) {
      options.roughness = 0.01 * boundsOf(mesh.vertices).diagonal();
      options.seed = static_cast<std::uint32_t>(cut);
    }
    return options;
  }

  long refused_ = 0, with_inner_points_ = 0;
};

TEST_F(CutFuzz, EmbeddedShapes) {
  std::vector<shapes::Shape> all = shapes::simpleShapes();
  for (const shapes::Shape& shape : shapes::hardShapes()) all.push_back(shape);
  std::mt19937 random(seed_);
  long pieces = 0;
  for (long i = 0; i < cuts_ / 2; ++i) {
    const shapes::Shape& shape = all[static_cast<std::size_t>(i / 2) % all.size()];
    const TriangleMesh mesh = i % 2 ? shapes::moved(shape.mesh, shapes::anyPose(), 0.37) : shape.mesh;
    pieces += static_cast<long>(
        cutAndCheck(mesh, shapes::hardPlane(mesh, random), optionsOf(i / 2, mesh), true, shape.name).size());
  }
  EXPECT_EQ(faults_, 0);
  EXPECT_GT(pieces, cuts_ / 2);
  EXPECT_GT(with_inner_points_, cuts_ / 100);
}

TEST_F(CutFuzz, PiecesOfPieces) {
  std::mt19937 random(seed_ + 1000);
  const std::vector<shapes::Shape> all = shapes::hardShapes();
  std::deque<TriangleMesh> pool;
  for (long i = 0; i < cuts_ / 4; ++i) {
    if (i % 100 == 0)
      pool.assign(1, i % 200 ? sphereMesh(0.1, 0.03) : all[static_cast<std::size_t>(i / 200) % all.size()].mesh);
    const TriangleMesh mesh = std::move(pool.front());
    pool.pop_front();
    CutOptions options = optionsOf(i, mesh);
    options.cap_patch = static_cast<std::uint32_t>(i % 100 + 1);
    const std::vector<CutPiece> pieces =
        cutAndCheck(mesh, shapes::hardPlane(mesh, random), options, true, "a piece", true);
    for (const CutPiece& piece : pieces) pool.push_back(piece.mesh);
    if (pieces.empty()) pool.push_back(mesh);
  }
  EXPECT_EQ(faults_, 0);
  EXPECT_LE(refused_, 0.002 * static_cast<double>(cuts_ / 4));
  EXPECT_GT(with_inner_points_, cuts_ / 4 / 50);
  RecordProperty("refused", static_cast<int>(refused_));
}

TEST_F(CutFuzz, RandomVoxels) {
  std::mt19937 random(seed_ + 2000);
  for (long i = 0; i < cuts_ / 8;) {
    const TriangleMesh mesh = shapes::randomVoxels(4, 0.1 + 0.005 * static_cast<double>(random() % 100),
                                                   static_cast<std::uint32_t>(random()));
    if (mesh.empty()) continue;
    for (int k = 0; k < 10; ++k, ++i)
      cutAndCheck(mesh, shapes::hardPlane(mesh, random), optionsOf(i, mesh), true, "voxels");
  }
  EXPECT_EQ(faults_, 0);
}

/// Solids that touch or cross: a refusal is allowed, but rare.
TEST_F(CutFuzz, TouchingAndCrossingSolids) {
  std::mt19937 random(seed_ + 3000);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::vector<shapes::Shape> all = shapes::touchingShapes();
  const std::size_t touching = all.size();
  for (long i = 0; i < cuts_ / 8; ++i) {
    TriangleMesh mesh;
    std::string name = "crossing solids";
    if (i % 2 == 0) {
      const shapes::Shape& shape = all[static_cast<std::size_t>(i / 2) % touching];
      name = shape.name;
      mesh = i % 4 ? shapes::moved(shape.mesh, shapes::anyPose(), 0.37) : shape.mesh;
    } else {
      mesh = i % 4 == 1 ? sphereMesh(1.0, 0.5) : boxMesh(Vec3(1.5, 1.5, 1.5), 2, 2, 2);
      shapes::append(mesh, torusMesh(1.0, 0.3, 0.4), Vec3(unit(random), unit(random), unit(random)));
    }
    cutAndCheck(mesh, shapes::hardPlane(mesh, random), optionsOf(i, mesh), false, name);
  }
  EXPECT_EQ(faults_, 0);
  EXPECT_LE(refused_, 0.05 * static_cast<double>(cuts_ / 8));
}

}  // namespace cut_fuzz_test
}  // namespace meshless
