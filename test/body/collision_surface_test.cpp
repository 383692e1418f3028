// The surface that contact takes: even triangles where the visual surface is finer than the cells, cut by the same
// blade.
#include <gtest/gtest.h>

#include "meshless_surgery/base/random.h"
#include "meshless_surgery/body/binding.h"
#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"
#include "support/mesh_laws.h"

namespace meshless {
namespace collision_surface_test {

BodyDef tissue(const TriangleMesh& mesh, double cells = 600.0) {
  BodyDef def = test::defOf(mesh);
  def.material.youngs_modulus = 5000.0;
  def.material.poissons_ratio = 0.4;
  def.spacing = std::cbrt(signedVolume(mesh) / cells);
  return def;
}

/// Finer than their cells.
std::vector<shapes::Shape> fineShapes() {
  std::vector<shapes::Shape> all{{"ball", sphereMesh(0.1, 0.008)},
                                 {"box", boxMesh(Vec3(0.2, 0.12, 0.1), 0.008)},
                                 {"cylinder", cylinderMesh(0.3, 0.05, 0.01)},
                                 {"ring", torusMesh(0.1, 0.04, 0.008)}};
  for (const std::uint64_t seed : {1, 2})
    all.push_back({"organ " + std::to_string(seed), *randomOrgan(seed, 0, 0.2, 8000)});
  return all;
}

/// [m] of the farthest vertex of one surface from the other.
double farthest(const TriangleMesh& from, const TriangleMesh& to) {
  const SolidQuery solid(to);
  double most = 0.0;
  for (const Vec3& v : from.vertices) most = std::max(most, solid.distance(v));
  return most;
}

TEST(CollisionSurface, IsEvenAndNearTheVisualOneWhereThatIsFine) {
  for (const shapes::Shape& shape : fineShapes()) {
    SCOPED_TRACE(shape.name);
    const PreparedBody body = test::prepared(tissue(shape.mesh));
    ASSERT_TRUE(body.model->collision);
    const CollisionSurface& collision = *body.model->collision;
    const double spacing = body.model->spacing, mean = meanEdgeLength(collision.mesh);
    EXPECT_TRUE(laws::isClosedOriented(collision.mesh));
    EXPECT_GT(mean, 0.5 * spacing);
    EXPECT_LT(mean, spacing);
    EXPECT_LE(collision.distance, 0.12 * spacing);
    EXPECT_LE(farthest(collision.mesh, body.model->surface), collision.distance * (1 + 1e-9));
    EXPECT_LE(farthest(body.model->surface, collision.mesh), collision.distance * (1 + 1e-9));
    EXPECT_TRUE(body.def.warnings.empty());
    // Both go with the tissue: exactly where it moves affinely.
    Random random(3);
    Mat3 map;
    map << random.direction(), random.direction(), random.direction();
    Points moved;
    for (const Vec3& p : body.model->rest) moved.push_back(map * p + Vec3(1, 2, 3));
    const Points places = collisionPlaces(*body.model, moved);
    for (Index v = 0; v < places.size(); ++v)
      ASSERT_LT((places[v] - (map * collision.mesh.vertices[v] + Vec3(1, 2, 3))).norm(), 1e-12);
  }
}

TEST(CollisionSurface, IsTheVisualOneWhereThatIsNoFinerOrWasAskedFor) {
  EXPECT_FALSE(test::prepared(tissue(boxMesh(Vec3(0.1, 0.1, 0.1), 2, 2, 2))).model->collision);
  BodyDef fine = tissue(sphereMesh(0.1, 0.008));
  fine.collision.kind = CollisionChoice::Kind::kVisual;
  const PreparedBody visual = test::prepared(fine);
  EXPECT_FALSE(visual.model->collision);
  EXPECT_TRUE(visual.def.warnings.empty());
  fine.collision = {CollisionChoice::Kind::kEdge, 0.03};
  const PreparedBody coarse = test::prepared(fine);
  ASSERT_TRUE(coarse.model->collision);
  EXPECT_NEAR(meanEdgeLength(coarse.model->collision->mesh), 0.03, 0.006);
}

TEST(CollisionSurface, RefusesEdgesOutOfRange) {
  BodyDef def = tissue(sphereMesh(0.1, 0.01));
  for (const double edge : {0.0, -0.01, 1e-5, 1e-300, 1001.0, std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    def.collision = {CollisionChoice::Kind::kEdge, edge};
    const Result<PreparedBody> refused = prepareBody(def);
    ASSERT_FALSE(refused.ok()) << edge;
    EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument) << edge;
    EXPECT_NE(refused.error().detail.find("collision of body 'body'"), std::string::npos) << refused.error().detail;
    EXPECT_NE(refused.error().detail.find("accepted: "), std::string::npos) << refused.error().detail;
  }
}

// Sheets on each other cannot be made even without crossing; an open surface has no cells.
TEST(CollisionSurface, WarnsWhereItCannotBeMade) {
  BodyDef opened = test::defOf(sphereMesh(0.1, 0.01));
  opened.mesh.triangles.pop_back();
  opened.solid = false;
  opened.collision = {CollisionChoice::Kind::kEdge, 0.02};
  const PreparedBody open = test::prepared(opened);
  EXPECT_FALSE(open.model->collision);
  ASSERT_EQ(open.def.warnings.size(), 1u);
  EXPECT_NE(open.def.warnings[0].find("visual surface"), std::string::npos) << open.def.warnings[0];
  BodyDef thin = tissue(boxMesh(Vec3(0.1, 0.1, 0.001), 0.002));
  thin.spacing = 0.002;
  thin.collision = {CollisionChoice::Kind::kEdge, 0.15};
  const PreparedBody sheet = test::prepared(thin);
  EXPECT_EQ(sheet.def.warnings.size(), sheet.model->collision ? 0u : 1u);
}

// Every piece has its part of it: closed, as large as the piece, and as near to it as before but for the cut's rim.
void expectPieces(const BodyModel& parent, const std::vector<BodyPiece>& pieces, std::size_t& with, std::size_t& all) {
  for (const BodyPiece& piece : pieces) {
    ++all;
    if (!piece.model->collision) continue;
    ++with;
    const CollisionSurface& collision = *piece.model->collision;
    EXPECT_TRUE(laws::isClosedOriented(collision.mesh));
    const double spacing = parent.spacing;
    const double layer = 0.15 * spacing * piece.model->rest_area;
    EXPECT_NEAR(signedVolume(collision.mesh), piece.model->rest_volume, layer);
    EXPECT_LE(farthest(collision.mesh, piece.model->surface), 0.25 * spacing);
    EXPECT_EQ(collision.distance, parent.collision->distance);
    const Points places = collisionPlaces(*piece.model, piece.state.positions);
    for (Index v = 0; v < places.size(); ++v) ASSERT_TRUE(places[v].allFinite());
  }
}

TEST(CollisionSurface, IsCutByTheSameBlade) {
  Random random(11);
  std::size_t with = 0, all = 0;
  for (const shapes::Shape& shape : fineShapes()) {
    SCOPED_TRACE(shape.name);
    const PreparedBody body = test::prepared(tissue(shape.mesh));
    const Box bounds = boundsOf(body.model->surface.vertices);
    const Vec3 middle = 0.5 * (bounds.min + bounds.max);
    for (int round = 0; round < 3; ++round) {
      const Plane plane{random.direction(), middle + random.inCube(0.15 * bounds.diagonal())};
      const Result<CutBody> cut = cutBody(*body.model, body.state, Blade::through(plane));
      if (!cut) continue;
      expectPieces(*body.model, cut->pieces, with, all);
      const BodyPiece& large = cut->pieces[0];
      const Result<CutBody> again =
          cutBody(*large.model, large.state,
                  Blade::through(Plane{random.direction(), boundsOf(large.state.surface).min * 0.5 +
                                                               boundsOf(large.state.surface).max * 0.5}));
      if (again) expectPieces(*large.model, again->pieces, with, all);
    }
  }
  EXPECT_GT(all, 40u);
  EXPECT_GE(with + all / 20, all) << with << " of " << all;
}

TEST(CollisionSurface, IsIncisedByTheSameBlade) {
  for (const shapes::Shape& shape : fineShapes()) {
    SCOPED_TRACE(shape.name);
    const PreparedBody body = test::prepared(tissue(shape.mesh));
    Index top = 0;
    for (Index v = 1; v < body.state.surface.size(); ++v)
      if (body.state.surface[v].z() > body.state.surface[top].z()) top = v;
    Blade blade;
    blade.y_axis = Vec3::UnitZ();
    blade.length = 0.06;
    blade.depth = 0.03;
    blade.origin = body.state.surface[top] + Vec3(-0.0303, 0.0011, 0.005);
    const Result<CutBody> incised = cutBody(*body.model, body.state, blade);
    ASSERT_TRUE(incised.ok()) << incised.error().detail;
    std::size_t with = 0, all = 0;
    expectPieces(*body.model, incised->pieces, with, all);
    EXPECT_EQ(with, all);
    if (all != 1) continue;
    const double opened =
        surfaceArea(incised->pieces[0].model->collision->mesh) - surfaceArea(body.model->collision->mesh);
    EXPECT_NEAR(opened, 2.0 * incised->opened_area, 0.1 * incised->opened_area);
  }
}

}  // namespace collision_surface_test
}  // namespace meshless
