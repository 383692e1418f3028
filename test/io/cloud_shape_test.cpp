#include "meshless_surgery/io/cloud_shape.h"

#include <gtest/gtest.h>

#include <random>
#include <sstream>

#include "io/temporary_folder.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/primitives.h"

namespace meshless {
namespace cloud_shape_test {

/// What a noisy sensor sees of a sphere of 0.1 m: `stray` points are anywhere in a box of 0.4 m.
Points seen(std::size_t count, std::size_t stray, const Vec3& centre = Vec3::Zero()) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> anywhere(-0.2, 0.2);
  Points points;
  for (std::size_t k = 0; k < count; ++k) {
    const Vec3 out(normal(random), normal(random), normal(random));
    points.push_back(centre + (0.1 + 2e-4 * normal(random)) * out.normalized());
  }
  for (std::size_t k = 0; k < stray; ++k)
    points.push_back(centre + Vec3(anywhere(random), anywhere(random), anywhere(random)));
  return points;
}

const double kVolume = 4.0 / 3.0 * M_PI * 1e-3;

void expectRefused(const Points& cloud, const CloudFilter& filter, ErrorCode code, const std::string& words) {
  const auto made = shapeOfCloud(cloud, filter);
  ASSERT_FALSE(made.ok()) << "should say: " << words;
  EXPECT_EQ(made.error().code, code);
  EXPECT_NE(made.error().detail.find(words), std::string::npos) << made.error().detail;
}

TEST(CloudShape, NoiseAndStrayPointsAreFilteredAndTheSurfaceIsClosed) {
  for (const Vec3& centre : {Vec3(0.0, 0.0, 0.0), Vec3(900.0, -700.0, 500.0)}) {
    Points cloud = seen(60000, 40, centre);
    cloud.push_back(Vec3::Constant(std::nan("")));
    const auto made = shapeOfCloud(cloud, {0.006, 3.0});
    ASSERT_TRUE(made.ok()) << made.error().detail;
    EXPECT_TRUE(made->shape.solid);
    EXPECT_TRUE(inspectMesh(made->shape.mesh).closed());
    EXPECT_NEAR(signedVolume(made->shape.mesh), kVolume, 0.03 * kVolume) << made->shape.notes[1];
    EXPECT_LT(made->points, 10000u);
    EXPECT_NE(made->shape.notes[0].find("of 60041 points 1 were not finite"), std::string::npos)
        << made->shape.notes[0];
  }
}

TEST(CloudShape, TheGridIsChosenFromTheCloud) {
  const auto made = shapeOfCloud(seen(60000, 0), {});
  ASSERT_TRUE(made.ok()) << made.error().detail;
  EXPECT_NEAR(signedVolume(made->shape.mesh), kVolume, 0.03 * kVolume);
}

TEST(CloudShape, StraysChangeNeitherGridNorExtentAndAreCounted) {
  const Points body = seen(20000, 0);
  const auto alone = shapeOfCloud(body, {});
  ASSERT_TRUE(alone.ok()) << alone.error().detail;
  const Box bounds = boundsOf(alone->shape.mesh.vertices);
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  const auto direction = [&] { return Vec3(normal(random), normal(random), normal(random)).normalized(); };
  for (const std::size_t count : {1, 3, 40})
    for (const bool clump : {false, true})
      for (const double away : {0.03, 0.3, 1.0, 1e9}) {
        Points cloud = body;
        const Vec3 side = direction();
        for (std::size_t k = 0; k < count; ++k)
          cloud.push_back(clump ? Vec3((0.1 + away) * side + 0.002 * direction()) : Vec3((0.1 + away) * direction()));
        std::ostringstream what;
        what << count << (clump ? " in a clump, " : " spread, ") << away << " m away";
        const auto made = shapeOfCloud(cloud, {});
        ASSERT_TRUE(made.ok()) << what.str() << ": " << made.error().detail;
        const Box box = boundsOf(made->shape.mesh.vertices);
        EXPECT_NEAR(box.diagonal(), bounds.diagonal(), 0.03 * bounds.diagonal()) << what.str();
        const double points = static_cast<double>(alone->points);  // as many as the spacing lets in
        EXPECT_NEAR(static_cast<double>(made->points), points, 0.03 * points) << what.str();
        EXPECT_NE(made->shape.notes.at(1).find(std::to_string(count) + " stray points were dropped"), std::string::npos)
            << what.str() << ": " << made->shape.notes[1];
      }
}

TEST(CloudShape, StraysOfACloudFromAFileAreDroppedToo) {
  const TemporaryFolder folder;
  TriangleMesh cloud = sphereMesh(0.1, 0.02);
  cloud.triangles.clear();
  cloud.vertices.emplace_back(0.5, 0.0, 0.0);
  ASSERT_TRUE(writeObj(folder.file("cloud.obj"), cloud, "").ok());
  const auto loaded = loadShape(folder.file("cloud.obj"), 1.0);
  ASSERT_TRUE(loaded.ok()) << loaded.error().detail;
  EXPECT_LT(boundsOf(loaded->mesh.vertices).max.x(), 0.101);
  EXPECT_NE(loaded->notes.at(1).find("1 stray points were dropped"), std::string::npos) << loaded->notes[1];
}

TEST(CloudShape, TwoPartsAreKeptAndSaid) {
  Points cloud = seen(20000, 0);
  for (const Vec3& p : seen(3000, 0)) cloud.push_back(Vec3(0.3, 0.0, 0.0) + 0.4 * p);
  std::vector<std::string> notes;
  EXPECT_EQ(withoutStrays(cloud, notes).size(), cloud.size());
  const auto made = shapeOfCloud(cloud, {});
  ASSERT_TRUE(made.ok()) << made.error().detail;
  EXPECT_NEAR(boundsOf(made->shape.mesh.vertices).max.x(), 0.34, 0.01);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_NE(notes[0].find("the cloud has 2 parts"), std::string::npos) << notes[0];
  EXPECT_EQ(made->shape.notes.at(1), notes[0]);
}

TEST(CloudShape, OtherUnitsAndOddValuesAreRefused) {
  Points millimetres = seen(1000, 0);
  for (Vec3& p : millimetres) p *= 1000.0;
  expectRefused(millimetres, {}, ErrorCode::kUnsuitableShape, "scale 0.001 is for a cloud in millimetres");
  Points tiny = seen(1000, 0);
  for (Vec3& p : tiny) p *= 1e-3;
  expectRefused(tiny, {}, ErrorCode::kUnsuitableShape, "m across; accepted: 0.001..10 m");
  expectRefused(seen(1000, 0), {1.0, 3.0}, ErrorCode::kInvalidArgument, "voxel is 1 m; accepted for this cloud");
  expectRefused(seen(1000, 0), {1e-9, 3.0}, ErrorCode::kInvalidArgument, "voxel is 1e-09 m");
  expectRefused(seen(3, 0), {}, ErrorCode::kUnsuitableShape, "3 finite points");
  expectRefused({}, {}, ErrorCode::kUnsuitableShape, "0 finite points");
  expectRefused(seen(400000, 0), {4e-4, 3.0}, ErrorCode::kUnsuitableShape, "accepted: up to 50000");
  Points flat = seen(1000, 0);
  for (Vec3& p : flat) p.z() = 0.0;
  expectRefused(flat, {}, ErrorCode::kUnsuitableShape, "points that are left");
}

// A rounding is no distance: 4e-19 m is what points have that are the surface's own vertices.
TEST(CloudShape, TheDistanceOfPointsFromTheSurfaceIsSaidWhereThereIsOne) {
  SurfaceFromPoints surface;
  surface.mesh = boxMesh(Vec3(0.1, 0.1, 0.1), 0.05);
  surface.method = "alpha wrapping";
  surface.max_distance = surface.mean_distance = 4.33681e-19;
  EXPECT_EQ(surfaceInWords(surface), "surface by alpha wrapping; all of them lie on it");
  surface.max_distance = 0.00123456;
  surface.mean_distance = 0.0004;
  EXPECT_EQ(surfaceInWords(surface),
            "surface by alpha wrapping; the points are up to 0.00123 m from it, on average 0.0004 m");
}

}  // namespace cloud_shape_test
}  // namespace meshless
