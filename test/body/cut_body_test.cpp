#include "meshless_surgery/body/cut_body.h"

#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/query/nearest_on_triangle.h"
#include "support/bodies.h"
#include "support/mesh_laws.h"
#include "support/random.h"

namespace meshless {
namespace cut_body_test {

using test::prepared;
using test::Random;

Vec3 angularMomentumAbout(const Vec3& point, const BodyModel& model, const BodyState& state) {
  Vec3 sum = Vec3::Zero();
  for (std::size_t i = 0; i < state.positions.size(); ++i)
    sum += model.masses[i] * (state.positions[i] - point).cross(state.velocities[i]);
  return sum;
}

// Bent, stretched and spinning.
void disturb(PreparedBody& body, Random& random) {
  const Vec3 spin = random.vector(5.0);
  for (std::size_t i = 0; i < body.state.positions.size(); ++i) {
    Vec3& p = body.state.positions[i];
    p = Vec3(1.3 * p.x(), p.y() + 2.0 * p.x() * p.x(), 0.8 * p.z());
    body.state.velocities[i] = spin.cross(p) + Vec3(0.1, 0.2, 0.3);
  }
  updateSurface(*body.model, body.state);
}

TEST(CutBody, KeepsVolumeMassMomentumAndPlaces) {
  Random random(1);
  for (int round = 0; round < 40; ++round) {
    PreparedBody body = prepared(round % 2 ? test::ball("b", Vec3::Zero()) : test::block("b", Vec3::Zero()));
    disturb(body, random);
    const Plane plane{random.unit(), random.vector(0.04)};
    const Result<CutBody> cut = cutBody(*body.model, body.state, Blade::through(plane));
    ASSERT_TRUE(cut.ok()) << cut.error().detail;
    ASSERT_GE(cut->pieces.size(), 2u);
    const BodyMeasures before = measureBody(*body.model, body.state);
    double volume = 0, rest_volume = 0, mass = 0;
    Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
    std::vector<int> seen(body.model->rest.size(), 0);
    for (const BodyPiece& piece : cut->pieces) {
      TriangleMesh present = piece.model->surface;
      present.vertices = piece.state.surface;
      EXPECT_TRUE(laws::isClosedOriented(present));
      const BodyMeasures m = measureBody(*piece.model, piece.state);
      volume += m.volume;
      rest_volume += piece.model->rest_volume;
      mass += piece.model->mass;
      linear += m.linear_momentum;
      angular += angularMomentumAbout(Vec3::Zero(), *piece.model, piece.state);
      ASSERT_EQ(piece.parent_particles.size(), piece.model->rest.size());
      for (std::size_t i = 0; i < piece.parent_particles.size(); ++i) {
        const Index old = piece.parent_particles[i];
        if (old == kNoIndex) continue;
        ++seen[old];
        EXPECT_EQ(piece.state.positions[i], body.state.positions[old]);
        EXPECT_EQ(piece.state.velocities[i], body.state.velocities[old]);
        EXPECT_EQ(piece.model->rest[i], body.model->rest[old]);
      }
    }
    for (int n : seen) EXPECT_EQ(n, 1);
    // Rounding: 4.3e-15, 1.1e-15, 7.2e-16 and 7e-16 are reached by 40 cuts.
    const Vec3 spin = angularMomentumAbout(Vec3::Zero(), *body.model, body.state);
    EXPECT_NEAR(volume, before.volume, 1e-2 * before.volume) << "vertices at the blade follow their own side's tissue";
    EXPECT_NEAR(rest_volume, body.model->rest_volume, 5e-4 * body.model->rest_volume)
        << "vertices near the blade go to it";
    EXPECT_NEAR(mass, body.model->mass, 1e-12 * mass);
    EXPECT_LT((linear - before.linear_momentum).norm(), 1e-14 * before.linear_momentum.norm());
    EXPECT_LT((angular - spin).norm(), 1e-14 * spin.norm());
  }
}

TEST(CutBody, ARoughCutKeepsVolumeAndFitsOnBothSides) {
  Random random(3);
  for (int round = 0; round < 8; ++round) {
    PreparedBody body = prepared(test::defOf(sphereMesh(0.1, 0.015), "b"));
    disturb(body, random);
    CutBodyOptions options;
    options.roughness = 0.01;
    options.seed = static_cast<std::uint32_t>(round);
    const Result<CutBody> cut =
        cutBody(*body.model, body.state, Blade::through({random.unit(), random.vector(0.03)}), options);
    ASSERT_TRUE(cut.ok()) << cut.error().detail;
    double volume = 0.0, rest_volume = 0.0;
    for (const BodyPiece& piece : cut->pieces) {
      TriangleMesh present = piece.model->surface;
      present.vertices = piece.state.surface;
      EXPECT_TRUE(laws::isClosedOriented(present));
      volume += signedVolume(present);
      rest_volume += piece.model->rest_volume;
    }
    const double before = measureBody(*body.model, body.state).volume;
    EXPECT_NEAR(volume, before, 1e-2 * before);
    EXPECT_NEAR(rest_volume, body.model->rest_volume, 5e-4 * body.model->rest_volume);
  }
}

TEST(CutBody, ParticlesLieOnTheirSideOfTheRestCap) {
  Random random(4);
  for (bool elastic : {false, true})
    for (int round = 0; round < 10; ++round) {
      BodyDef def = test::defOf(sphereMesh(0.1, 0.012), "b");
      def.spacing = 0.02;
      if (elastic) def.material.youngs_modulus = 5000.0;
      PreparedBody body = prepared(def);
      disturb(body, random);  // bent: the cap is curved in the rest shape
      const Result<CutBody> cut =
          cutBody(*body.model, body.state, Blade::through({random.unit(), random.vector(0.03)}));
      ASSERT_TRUE(cut.ok());
      for (const BodyPiece& piece : cut->pieces) {
        const SolidQuery solid(piece.model->surface);
        // Corners of filled cells are on both sides: samples of the tissue in them are not.
        Points tissue;
        const double reach = 0.3 * def.spacing;
        const CellLattice& lattice = *piece.model->lattice;
        for (const LatticeCell& cell : lattice.cells)
          for (SampleSet left = cell.samples; left; left &= left - 1)
            tissue.push_back(lattice.restPlace(cell, samplePlace(lowestSample(left))));
        ASSERT_FALSE(tissue.empty());
        for (const Vec3& p : tissue)
          if (!solid.contains(p)) {
            double nearest = 1e9;  // to the cap's triangles
            for (std::size_t t = 0; t < piece.model->surface.triangles.size(); ++t) {
              if (piece.model->surface.patches[t] != body.model->next_patch) continue;
              const Triangle& f = piece.model->surface.triangles[t];
              const auto& v = piece.model->surface.vertices;
              nearest = std::min(nearest, (nearestOnTriangle(p, v[f[0]], v[f[1]], v[f[2]]) - p).norm());
            }
            if (SolidQuery(body.model->surface).contains(p)) {
              EXPECT_LT(nearest, reach) << elastic;
            }
          }
      }
    }
}

TEST(CutBody, FarClustersAreKept) {
  BodyDef def = test::defOf(boxMesh(Vec3(0.6, 0.05, 0.05), 36, 3, 3));
  PreparedBody body = prepared(def);
  ASSERT_GT(body.model->clusters.size(), 3u);
  const Result<CutBody> cut = cutBody(*body.model, body.state, Blade::through({Vec3::UnitX(), Vec3(0.22, 0, 0)}));
  ASSERT_TRUE(cut.ok());
  EXPECT_GT(cut->work.kept_clusters, 0u);
  EXPECT_GT(cut->work.rebuilt_clusters, 0u);
}

TEST(CutBody, AMissAndAnOpenSurfaceAreRefused) {
  PreparedBody body = prepared(test::ball("b", Vec3::Zero()));
  const Result<CutBody> miss = cutBody(*body.model, body.state, Blade::through({Vec3::UnitZ(), Vec3(0, 0, 1)}));
  ASSERT_FALSE(miss.ok());
  EXPECT_EQ(miss.error().code, ErrorCode::kMissed);
  BodyDef open = test::ball();
  open.mesh.triangles.pop_back();
  open.solid = false;
  body = prepared(open);
  const Result<CutBody> refused = cutBody(*body.model, body.state, Blade::through({Vec3::UnitZ(), Vec3(0, 0, 0.2)}));
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::kUnsuitableShape);
}

TEST(CutBody, AHundredCutsToCrumbsKeepMassVolumeAndParticles) {
  Random random(7);
  PreparedBody whole = prepared(test::ball("b", Vec3::Zero()));
  std::vector<std::pair<BodyModelPtr, BodyState>> pieces{{whole.model, whole.state}};
  int cuts = 0, refused = 0;
  while (cuts < 100 && refused < 200) {
    // The largest piece, somewhere near its middle.
    std::size_t largest = 0;
    for (std::size_t p = 1; p < pieces.size(); ++p)
      if (pieces[p].first->rest_volume > pieces[largest].first->rest_volume) largest = p;
    auto [model, state] = pieces[largest];
    const Vec3 centre = solidCentroid(state.surface, model->surface.triangles);
    Result<CutBody> cut = cutBody(*model, state, Blade::through({random.unit(), centre + random.vector(0.002)}));
    if (!cut) {
      ++refused;
      continue;
    }
    ++cuts;
    pieces.erase(pieces.begin() + static_cast<std::ptrdiff_t>(largest));
    for (BodyPiece& piece : cut->pieces) {
      ASSERT_FALSE(piece.model->rest.empty());
      ASSERT_TRUE(test::allFinite(piece.state.surface));
      pieces.emplace_back(piece.model, std::move(piece.state));
    }
  }
  EXPECT_EQ(cuts, 100);
  EXPECT_EQ(refused, 0);
  double mass = 0, volume = 0;
  for (const auto& [model, state] : pieces) {
    mass += model->mass;
    volume += measureBody(*model, state).volume;
    StepScratch scratch;
    MatchCounters counters;
    BodyState moving = state;
    for (int step = 0; step < 30; ++step) {
      matchAndMove(*model, whole.def.material, Vec3(0, 0, -9.81), 1.0 / 120, moving, scratch, counters);
      velocitiesFromPositions(1.0 / 120, moving, scratch);
    }
    updateSurface(*model, moving);
    EXPECT_TRUE(test::allFinite(moving.surface));
  }
  EXPECT_NEAR(mass, whole.model->mass, 1e-9 * mass);
  EXPECT_NEAR(volume, whole.model->rest_volume, 5e-4 * volume);
}

}  // namespace cut_body_test
}  // namespace meshless
