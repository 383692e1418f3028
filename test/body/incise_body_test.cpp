#include "meshless_surgery/body/cut_body.h"

#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "support/bodies.h"
#include "support/mesh_laws.h"

namespace meshless {
namespace incise_body_test {

using test::prepared;

// Down into the body's top along x, in the plane y = at.y: the edge that stays outside runs along +x.
Blade downwards(const Vec3& at, double length, double depth) {
  Blade blade;
  blade.origin = at;
  blade.x_axis = Vec3::UnitX();
  blade.y_axis = Vec3::UnitZ();
  blade.length = length;
  blade.depth = depth;
  return blade;
}

PreparedBody ball(bool elastic) {
  BodyDef def = test::defOf(sphereMesh(0.1, 0.02), "ball");
  def.spacing = 0.02;
  def.material.damping = 5.0;
  if (elastic) def.material.youngs_modulus = 3000.0;
  return prepared(def);
}

TEST(InciseBody, KeepsVolumeMassPlacesAndParticles) {
  for (bool elastic : {false, true}) {
    const PreparedBody body = ball(elastic);
    const Result<CutBody> opened = cutBody(*body.model, body.state, downwards(Vec3(-0.2, 0.0, 0.2), 0.4, 0.2));
    ASSERT_TRUE(opened.ok()) << opened.error().detail;
    ASSERT_EQ(opened->pieces.size(), 1u);
    const BodyPiece& piece = opened->pieces[0];
    EXPECT_NEAR(opened->opened_area, 0.5 * M_PI * 0.01, 0.05 * M_PI * 0.01);
    EXPECT_GT(opened->work.rebuilt_clusters, 0u);
    EXPECT_NEAR(piece.model->mass, body.model->mass, 1e-12 * body.model->mass);
    EXPECT_NEAR(piece.model->rest_volume, body.model->rest_volume, 1e-9 * body.model->rest_volume);
    ASSERT_GE(piece.model->rest.size(), body.model->rest.size());
    for (std::size_t i = 0; i < body.model->rest.size(); ++i) {
      EXPECT_EQ(piece.model->rest[i], body.model->rest[i]);
      EXPECT_EQ(piece.state.positions[i], body.state.positions[i]);
    }
    // The cells along the blade have corners of their own on both sides, where the others are.
    for (std::size_t i = body.model->rest.size(); i < piece.model->rest.size(); ++i) {
      const auto of = std::find(body.model->rest.begin(), body.model->rest.end(), piece.model->rest[i]);
      ASSERT_NE(of, body.model->rest.end());
      EXPECT_EQ(piece.state.positions[i], body.state.positions[of - body.model->rest.begin()]);
      const Vec3 at = body.state.placed * piece.model->rest[i];
      EXPECT_LT(std::abs(at.y()), std::sqrt(3.0) * body.model->spacing);
      EXPECT_GT(at.z(), -std::sqrt(3.0) * body.model->spacing);
    }
    TriangleMesh present = piece.model->surface;
    present.vertices = piece.state.surface;
    EXPECT_TRUE(laws::isClosedOriented(present));
    BodyState redrawn = piece.state;
    updateSurface(*piece.model, redrawn);
    for (std::size_t v = 0; v < redrawn.surface.size(); ++v)
      EXPECT_LT((redrawn.surface[v] - piece.state.surface[v]).norm(), 1e-9);
  }
}

// Half cut, held on both sides of the wound and drawn apart: how wide the wound is in the end.
double opening(const PreparedBody& start, bool clusters_kept) {
  PreparedBody body = start;
  const Result<CutBody> opened = cutBody(*body.model, body.state, downwards(Vec3(-0.2, 0.0, 0.2), 0.4, 0.2));
  EXPECT_TRUE(opened.ok());
  if (!clusters_kept) {
    body.model = opened->pieces[0].model;
    body.state = opened->pieces[0].state;
  }
  StepScratch scratch;
  MatchCounters counters;
  const BodyModel& m = *body.model;
  double pulled[2] = {0.0, 0.0};
  for (std::size_t i = 0; i < m.rest.size(); ++i)
    if (m.rest[i].z() > 0.03 && std::abs(m.rest[i].y()) > 0.02) pulled[m.rest[i].y() > 0.0] += m.masses[i];
  const double force = 0.2;  // [N] on each side
  const double h = m.highest_frequency > 0.0 ? 0.8 / (1.3 * m.highest_frequency) : 1.0 / 240.0;
  for (double t = 0.0; t < 3.0; t += h) {
    for (std::size_t i = 0; i < m.rest.size(); ++i)
      if (m.rest[i].z() > 0.03 && std::abs(m.rest[i].y()) > 0.02) {
        const int side = m.rest[i].y() > 0.0;
        body.state.velocities[i].y() += h * (side ? force : -force) / pulled[side];
      }
    matchAndMove(m, body.def.material, Vec3::Zero(), h, body.state, scratch, counters);
    velocitiesFromPositions(h, body.state, scratch);
  }
  updateSurface(m, body.state);
  // Between what is right and left of the wound's middle, at the top.
  Vec3 at[2] = {Vec3::Zero(), Vec3::Zero()}, rest[2] = {Vec3::Zero(), Vec3::Zero()};
  double count[2] = {0.0, 0.0};
  for (std::size_t i = 0; i < m.rest.size(); ++i) {
    if (m.rest[i].z() < 0.06 || std::abs(m.rest[i].y()) > 0.025 || std::abs(m.rest[i].y()) < 1e-6) continue;
    const int side = m.rest[i].y() > 0.0;
    at[side] += body.state.positions[i];
    rest[side] += m.rest[i];
    count[side] += 1.0;
  }
  EXPECT_GT(count[0] * count[1], 0.0);
  return (at[1] / count[1] - at[0] / count[0]).y() - (rest[1] / count[1] - rest[0] / count[0]).y();
}

TEST(InciseBody, AHalfCutBallOpensTenTimesAsWideAsWithItsClustersKept) {
  for (bool elastic : {false, true}) {
    const PreparedBody body = ball(elastic);
    const double kept = opening(body, true), cut = opening(body, false);
    std::printf("elastic %d: %.3f mm with its clusters kept, %.3f mm opened: %.1f times\n", elastic, 1e3 * kept,
                1e3 * cut, cut / kept);
    EXPECT_GT(cut, 10.0 * kept) << elastic;
  }
}

TEST(InciseBody, ASecondBladeMakesItComeApart) {
  for (bool elastic : {false, true}) {
    PreparedBody body = ball(elastic);
    Result<CutBody> first = cutBody(*body.model, body.state, downwards(Vec3(-0.2, 0.004, 0.2), 0.4, 0.2));
    ASSERT_TRUE(first.ok());
    Blade up = downwards(Vec3(-0.2, 0.004, -0.2), 0.4, 0.21);
    up.y_axis = -Vec3::UnitZ();
    const BodyPiece& half = first->pieces[0];
    const Result<CutBody> second = cutBody(*half.model, half.state, up);
    ASSERT_TRUE(second.ok()) << second.error().detail;
    ASSERT_EQ(second->pieces.size(), 2u);
    double mass = 0.0, volume = 0.0;
    for (const BodyPiece& piece : second->pieces) {
      mass += piece.model->mass;
      volume += piece.model->rest_volume;
      int sides[2] = {0, 0};
      const CellLattice& lattice = *piece.model->lattice;
      for (const LatticeCell& cell : lattice.cells)
        for (SampleSet left = cell.samples; left; left &= left - 1) {
          const Vec3 p = lattice.restPlace(cell, samplePlace(lowestSample(left)));
          ++sides[(body.state.placed * p).y() >= 0.004];
        }
      EXPECT_LE(std::min(sides[0], sides[1]), 0) << "all is with its side";
      EXPECT_GT(std::max(sides[0], sides[1]), 0);
    }
    EXPECT_NEAR(mass, body.model->mass, 1e-12 * mass);
    EXPECT_NEAR(volume, body.model->rest_volume, 1e-9 * volume);
  }
}

TEST(InciseBody, RefusesWhatDoesNotReachTheSurfaceAndShells) {
  const PreparedBody body = ball(false);
  const Result<CutBody> inside = cutBody(*body.model, body.state, downwards(Vec3(-0.02, 0.0, 0.02), 0.04, 0.04));
  ASSERT_FALSE(inside.ok());
  EXPECT_EQ(inside.error().code, ErrorCode::kMissed);
  EXPECT_NE(inside.error().detail.find("does not reach the surface"), std::string::npos) << inside.error().detail;
  BodyModel shell = *body.model;
  shell.solid = false;
  EXPECT_EQ(cutBody(shell, body.state, downwards(Vec3(-0.2, 0.0, 0.2), 0.4, 0.2)).error().code,
            ErrorCode::kUnsuitableShape);
}

}  // namespace incise_body_test
}  // namespace meshless
