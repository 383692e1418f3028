// Bodies of filled cells that a blade parts: copies of cells, and what they keep.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include "meshless_surgery/body/cell_blend.h"
#include "meshless_surgery/body/cut_body.h"
#include "meshless_surgery/body/deform.h"
#include "meshless_surgery/body/filled_cells.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/query/union_find.h"
#include "shapes/organs.h"
#include "shapes/random_organ.h"
#include "support/bodies.h"
#include "support/mesh_laws.h"
#include "support/random.h"

namespace meshless {
namespace cut_cells_test {

using test::prepared;
using test::Random;

BodyDef filled(const TriangleMesh& mesh, double spacing, bool elastic = true) {
  BodyDef def = test::defOf(mesh);
  def.spacing = spacing;
  def.clusters.kind = ClusterOptions::Kind::kCells;
  def.material.youngs_modulus = elastic ? 5e3 : 0.0;
  def.material.poissons_ratio = 0.4;
  def.material.density = 1000.0;
  return def;
}

PreparedBody bodyOf(int round) {
  const bool elastic = round % 4 != 3;
  if (round % 2) return prepared(filled(sphereMesh(0.1, 0.03), 0.037, elastic));
  return prepared(filled(boxMesh(Vec3(0.2, 0.11, 0.09), 8, 4, 4), 0.03, elastic));
}

// Bent smoothly, and it spins.
void bend(PreparedBody& body, Random& random) {
  const Vec3 spin = random.vector(3.0), wave = random.vector(8.0), push = random.vector(0.02);
  for (std::size_t i = 0; i < body.state.positions.size(); ++i) {
    Vec3& p = body.state.positions[i];
    p += push * std::sin(wave.dot(p)) + Vec3(0.1, 0.2, 0.3);
    body.state.velocities[i] = spin.cross(p) + Vec3(0.3, -0.2, 0.1) + random.vector(0.1);
  }
  updateSurface(*body.model, body.state);
}

struct Sums {
  double volume = 0.0, rest_volume = 0.0, mass = 0.0;
  Vec3 centre = Vec3::Zero(), linear = Vec3::Zero(), angular = Vec3::Zero();

  void add(const BodyModel& model, const BodyState& state) {
    volume += signedVolume(state.surface, model.surface.triangles);
    rest_volume += model.rest_volume;
    mass += model.mass;
    for (std::size_t i = 0; i < model.masses.size(); ++i) {
      centre += model.masses[i] * state.positions[i];
      linear += model.masses[i] * state.velocities[i];
      angular += model.masses[i] * state.positions[i].cross(state.velocities[i]);
    }
  }
};

void expectSame(const Sums& a, const Sums& b) {
  // Vertices close to the blade are moved onto it.
  EXPECT_NEAR(a.volume, b.volume, 5e-4 * b.volume);
  EXPECT_NEAR(a.rest_volume, b.rest_volume, 5e-4 * b.rest_volume);
  EXPECT_NEAR(a.mass, b.mass, 1e-12 * b.mass);
  EXPECT_LT((a.centre - b.centre).norm(), 1e-12 * b.mass);
  EXPECT_LT((a.linear - b.linear).norm(), 1e-12 * b.mass);
  EXPECT_LT((a.angular - b.angular).norm(), 1e-12 * b.mass);
}

std::size_t partsOf(const BodyModel& model) {
  UnionFind corners(model.rest.size());
  for (const LatticeCell& cell : model.lattice->cells)
    for (const Index corner : cell.corners) corners.join(cell.corners[0], corner);
  std::set<Index> parts;
  for (Index i = 0; i < model.rest.size(); ++i) parts.insert(corners.find(i));
  return parts.size();
}

void expectSound(const BodyPiece& piece, const BodyModel& parent, const BodyState& before) {
  TriangleMesh present = piece.model->surface;
  present.vertices = piece.state.surface;
  EXPECT_TRUE(laws::isClosedOriented(present));
  EXPECT_EQ(partsOf(*piece.model), 1u);
  for (const double m : piece.model->masses) EXPECT_GT(m, 0.0);
  ASSERT_EQ(piece.parent_particles.size(), piece.model->rest.size());
  for (std::size_t i = 0; i < piece.parent_particles.size(); ++i) {
    const Index old = piece.parent_particles[i];
    if (old == kNoIndex) continue;
    EXPECT_EQ(piece.state.positions[i], before.positions[old]);
    EXPECT_EQ(piece.state.velocities[i], before.velocities[old]);
    EXPECT_LT((piece.model->rest[i] - parent.rest[old]).norm(), 1e-12);
  }
  BodyState redrawn = piece.state;
  updateSurface(*piece.model, redrawn);
  for (std::size_t v = 0; v < redrawn.surface.size(); ++v)
    EXPECT_LT((redrawn.surface[v] - piece.state.surface[v]).norm(), 1e-9);
  if (!piece.model->cells) return;
  EXPECT_GT(piece.model->highest_frequency, 0.5 * parent.highest_frequency);
}

TEST(CutCells, KeepMassMomentumVolumeAndPlaces) {
  Random random(1);
  for (int round = 0; round < 40; ++round) {
    SCOPED_TRACE(round);
    PreparedBody body = bodyOf(round);
    bend(body, random);
    const Plane plane{random.unit(), Vec3(0.1, 0.2, 0.3) + random.vector(0.04)};
    const Result<CutBody> cut = cutBody(*body.model, body.state, Blade::through(plane));
    ASSERT_TRUE(cut.ok()) << cut.error().detail;
    Sums before, after;
    before.add(*body.model, body.state);
    std::vector<int> heirs(body.model->rest.size(), 0);
    for (const BodyPiece& piece : cut->pieces) {
      expectSound(piece, *body.model, body.state);
      after.add(*piece.model, piece.state);
      for (const Index old : piece.parent_particles)
        if (old != kNoIndex) ++heirs[old];
    }
    expectSame(after, before);
    for (const int n : heirs) EXPECT_EQ(n, 1);
  }
}

TEST(CutCells, IncisionsKeepMassMomentumAndTheParticlesNumbers) {
  Random random(2);
  int opened = 0;
  for (int round = 0; round < 40; ++round) {
    SCOPED_TRACE(round);
    PreparedBody body = bodyOf(round);
    bend(body, random);
    Blade blade;
    const Quat turn = random.rotation();
    blade.x_axis = turn * Vec3::UnitX();
    blade.y_axis = turn * Vec3::UnitY();
    blade.length = random.uniform(0.05, 0.4);
    blade.depth = random.uniform(0.1, 0.3);
    blade.origin = Vec3(0.1, 0.2, 0.3) + random.vector(0.03) + blade.y_axis * 0.15 - 0.5 * blade.length * blade.x_axis;
    const Result<CutBody> incised = cutBody(*body.model, body.state, blade);
    if (!incised.ok()) continue;
    ++opened;
    Sums before, after;
    before.add(*body.model, body.state);
    for (const BodyPiece& piece : incised->pieces) {
      expectSound(piece, *body.model, body.state);
      after.add(*piece.model, piece.state);
    }
    expectSame(after, before);
    if (incised->pieces.size() > 1) continue;
    const BodyPiece& piece = incised->pieces[0];
    for (Index i = 0; i < piece.parent_particles.size(); ++i)
      EXPECT_EQ(piece.parent_particles[i], i < body.model->rest.size() ? i : kNoIndex);
  }
  EXPECT_GT(opened, 20);
}

// Wherever the wound's end lies in a cell or between two, and the next blade beside it.
TEST(CutCells, ABladeThroughAWoundGivesEachPieceItsTissue) {
  Random random(3);
  int pieces = 0;
  for (const double side : {0.0, 0.0012, 0.005}) {
    const PreparedBody whole = prepared(filled(boxMesh(Vec3(0.12, 0.08, 0.06), 0.01), 0.01));
    for (int round = 0; round < 15; ++round) {
      SCOPED_TRACE(testing::Message() << side << " " << round);
      Blade blade;
      blade.origin = Vec3(-0.03, side, 0.031);
      blade.x_axis = Vec3::UnitX();
      blade.y_axis = Vec3::UnitZ();
      blade.length = random.uniform(0.03, 0.06);
      blade.depth = random.uniform(0.02, 0.05);
      const Result<CutBody> incised = cutBody(*whole.model, whole.state, blade);
      ASSERT_TRUE(incised.ok());
      ASSERT_EQ(incised->pieces.size(), 1u);
      const Vec3 normal = (Vec3::UnitY() + random.vector(0.5)).normalized();
      const Result<CutBody> cut = cutBody(*incised->pieces[0].model, incised->pieces[0].state,
                                          Blade::through(Plane{normal, Vec3(0.0, side, 0.0) + random.vector(0.01)}));
      ASSERT_TRUE(cut.ok()) << cut.error().detail;
      for (const BodyPiece& piece : cut->pieces) {
        if (piece.model->rest_volume < 0.05 * whole.model->rest_volume) continue;
        ++pieces;
        EXPECT_NEAR(piece.model->mass / (1000.0 * piece.model->rest_volume), 1.0, 0.05);
      }
    }
  }
  EXPECT_GT(pieces, 60);
}

// A block that is cut down to its middle, and lies as it was, and then across above the wound's end: both halves of
// what is above come off by themselves, whichever lip the vertices inside the cut are nearest to.
TEST(CutCells, ACutAcrossAClosedWoundPartsBothSidesOfIt) {
  for (const double edge : {0.011, 0.004})
    for (const double askew : {0.0, 0.13, 0.5}) {
      SCOPED_TRACE(edge);
      SCOPED_TRACE(askew);
      const PreparedBody body = prepared(filled(boxMesh(Vec3(0.12, 0.08, 0.08), edge), 0.02));
      Blade down;
      down.x_axis = Vec3(askew, 1.0, 0.0).normalized();
      down.y_axis = Vec3::UnitZ();
      down.origin = Vec3(0.003, 0.0, 0.05) - 0.15 * down.x_axis;
      down.length = 0.3;
      down.depth = 0.06;
      const Result<CutBody> wounded = cutBody(*body.model, body.state, down);
      ASSERT_TRUE(wounded.ok()) << wounded.error().detail;
      ASSERT_EQ(wounded->pieces.size(), 1u);
      const BodyPiece& whole = wounded->pieces[0];
      const Result<CutBody> cut =
          cutBody(*whole.model, whole.state, Blade::through({Vec3::UnitZ(), Vec3(0, 0, 0.007)}));
      ASSERT_TRUE(cut.ok()) << cut.error().detail;
      ASSERT_EQ(cut->pieces.size(), 3u);
      for (const BodyPiece& piece : cut->pieces)
        EXPECT_NEAR(piece.model->mass / body.model->mass, piece.model->rest_volume / body.model->rest_volume, 0.03);
    }
}

// What nothing holds apart is not moved: each piece is accelerated as the whole was, but for what was cut.
TEST(CutCells, APieceAtRestStaysAtRest) {
  PreparedBody body = prepared(filled(boxMesh(Vec3(0.2, 0.11, 0.09), 8, 4, 4), 0.03));
  const Result<CutBody> cut =
      cutBody(*body.model, body.state, Blade::through(Plane{Vec3(1, 0.3, 0.1).normalized(), Vec3(0.01, 0, 0)}));
  ASSERT_TRUE(cut.ok());
  for (const BodyPiece& piece : cut->pieces) {
    BodyState state = piece.state;
    StepScratch scratch;
    MatchCounters counters;
    for (int n = 0; n < 20; ++n)
      matchAndMove(*piece.model, body.def.material, Vec3::Zero(), 0.5 / piece.model->highest_frequency, state, scratch,
                   counters);
    for (std::size_t i = 0; i < state.positions.size(); ++i)
      EXPECT_LT((state.positions[i] - piece.state.positions[i]).norm(), 1e-12);
  }
}

// A clamp holds what is on its side of a cut, and the other side goes free.
TEST(CutCells, AClampHoldsTheSideThatItIsOn) {
  BodyDef def = filled(boxMesh(Vec3(0.2, 0.09, 0.09), 8, 4, 4), 0.03);
  def.fixed = {{Vec3(-1, -1, -1), Vec3(-0.0905, 1, 1)}};
  const PreparedBody body = prepared(def);
  ASSERT_TRUE(body.model->any_fixed);
  for (const double at : {-0.0903, -0.09, -0.0888, -0.0886, -0.085, -0.07, -0.05})
    for (const double slope : {0.0, 0.002}) {
      SCOPED_TRACE(std::to_string(at) + ", " + std::to_string(slope));
      const Plane plane{Vec3(1.0, slope, 0.0).normalized(), Vec3(at, 0, 0)};
      const Result<CutBody> cut = cutBody(*body.model, body.state, Blade::through(plane));
      ASSERT_TRUE(cut.ok());
      ASSERT_EQ(cut->pieces.size(), 2u);
      EXPECT_FALSE(cut->pieces[0].model->any_fixed);
      EXPECT_TRUE(cut->pieces[1].model->any_fixed);
    }
}

// No vertex of the surface lies in it.
TEST(CutCells, WhatIsHeldInTheMiddleStaysInItsPiece) {
  BodyDef def = filled(boxMesh(Vec3(0.2, 0.09, 0.09), 8, 4, 4), 0.01);
  def.fixed = {{Region::sphere(Vec3(0.01, 0, 0), 0.025), false}};
  const PreparedBody body = prepared(def);
  for (const double at : {-0.06, 0.08}) {
    const Result<CutBody> cut =
        cutBody(*body.model, body.state, Blade::through(Plane{Vec3(1.0, 0.1, 0.2).normalized(), Vec3(at, 0, 0)}));
    ASSERT_TRUE(cut.ok());
    ASSERT_EQ(cut->pieces.size(), 2u);
    for (const BodyPiece& piece : cut->pieces) {
      const bool with_it = piece.model->rest_volume > 0.5 * body.model->rest_volume;
      EXPECT_EQ(piece.model->any_fixed, with_it) << at;
      EXPECT_NEAR(piece.model->mass / body.model->mass, piece.model->rest_volume / body.model->rest_volume, 0.01) << at;
      EXPECT_NEAR(heldShare(*piece.model) * piece.model->mass,
                  with_it ? heldShare(*body.model) * body.model->mass : 0.0, 1e-12);
    }
  }
}

// Slices thinner than a sample: no cell sees them, and they are bodies with mass all the same.
TEST(CutCells, SliversHaveCellsOfTheirOwn) {
  const PreparedBody body = prepared(filled(boxMesh(Vec3(0.2, 0.09, 0.09), 16, 8, 8), 0.03));
  for (const double at : {0.0999, 0.099, 0.097, 0.095}) {
    SCOPED_TRACE(at);
    const Result<CutBody> cut = cutBody(*body.model, body.state, Blade::through(Plane{Vec3::UnitX(), Vec3(at, 0, 0)}));
    ASSERT_TRUE(cut.ok()) << cut.error().detail;
    Sums before, after;
    before.add(*body.model, body.state);
    for (const BodyPiece& piece : cut->pieces) {
      expectSound(piece, *body.model, body.state);
      after.add(*piece.model, piece.state);
    }
    expectSame(after, before);
  }
}

// Two splinters off the edges of a bar, seven cells long, each of less tissue than a sample stands for: hinged in
// every cell they would flap about, and weigh seven times as much.
TEST(CutCells, SplintersOfLessThanASampleAreOneCell) {
  const PreparedBody body = prepared(filled(boxMesh(Vec3(0.2, 0.09, 0.09), 16, 8, 8), 0.03));
  const double cell = 1000.0 * std::pow(0.03, 3);  // [kg]
  for (const double side : {-1.0, 1.0}) {
    const Vec3 normal = Vec3(0, side, 1).normalized();
    const Result<CutBody> cut =
        cutBody(*body.model, body.state, Blade::through(Plane{normal, Vec3(0, 0.045 * side, 0.045) - 0.001 * normal}));
    ASSERT_TRUE(cut.ok()) << cut.error().detail;
    ASSERT_EQ(cut->pieces.size(), 2u);
    for (const BodyPiece& piece : cut->pieces) {
      expectSound(piece, *body.model, body.state);
      if (piece.model->rest_volume > 1e-5) continue;
      EXPECT_EQ(piece.model->lattice->cells.size(), 1u);
      EXPECT_LE(piece.model->mass, cell / 64.0);
    }
  }
}

TEST(CutCells, ManyCutsAfterEachOther) {
  Random random(5);
  PreparedBody whole = prepared(filled(sphereMesh(0.1, 0.02), 0.02));
  struct Part {
    BodyModelPtr model;
    BodyState state;
  };
  std::vector<Part> parts{{whole.model, whole.state}};
  Sums before, after;
  before.add(*whole.model, whole.state);
  int cuts = 0;
  for (int n = 0; n < 30; ++n) {
    const Plane plane{random.unit(), random.vector(0.05)};
    std::vector<Part> next;
    for (Part& part : parts) {
      Result<CutBody> cut = cutBody(*part.model, part.state, Blade::through(plane));
      if (!cut.ok()) {
        EXPECT_EQ(cut.error().code, ErrorCode::kMissed) << cut.error().detail;
        next.push_back(std::move(part));
        continue;
      }
      ++cuts;
      for (BodyPiece& piece : cut->pieces) {
        expectSound(piece, *part.model, part.state);
        next.push_back({std::move(piece.model), std::move(piece.state)});
      }
    }
    parts = std::move(next);
    if (parts.size() > 60) parts.resize(60);
    if (n == 4) {
      for (const Part& part : parts) after.add(*part.model, part.state);
      expectSame(after, before);
    }
  }
  EXPECT_GT(cuts, 100);
}

// What four planes near its middle leave of an organ.
std::vector<PreparedBody> slicesOf(std::uint64_t seed, std::size_t triangles, double spacing) {
  const Result<TriangleMesh> mesh = randomOrgan(seed, static_cast<int>(seed % 3), 0.2, triangles);
  EXPECT_TRUE(mesh.ok());
  std::vector<PreparedBody> pieces;
  if (!mesh) return pieces;
  Random random(static_cast<std::uint32_t>(seed));
  pieces.push_back(prepared(filled(*mesh, spacing)));
  for (int cut = 0; cut < 4; ++cut) {
    const Plane plane{random.unit(), solidCentroid(*mesh) + random.vector(0.003)};
    std::vector<PreparedBody> next;
    for (PreparedBody& piece : pieces) {
      Result<CutBody> parts = cutBody(*piece.model, piece.state, Blade::through(plane));
      if (!parts.ok()) {
        EXPECT_EQ(parts.error().code, ErrorCode::kMissed) << parts.error().detail;
        next.push_back(std::move(piece));
        continue;
      }
      for (BodyPiece& part : parts->pieces) next.push_back({BodyDef(), std::move(part.model), std::move(part.state)});
    }
    pieces = std::move(next);
  }
  EXPECT_GT(pieces.size(), 8u);
  return pieces;
}

// Thin slices among them: films that go from cell to cell by corners that no sample is next to.
TEST(CutCells, PiecesOfRandomOrgansWeighWhatTheirVolumesDo) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed)
    for (const PreparedBody& piece : slicesOf(seed, 2000, 0.0109)) {
      const BodyModel& model = *piece.model;
      // By samples: of a layer of a quarter of a cell all or nothing is counted.
      EXPECT_NEAR(model.mass / 1000.0, model.rest_volume,
                  0.1 * model.rest_volume + model.rest_area * model.spacing / 24.0)
          << seed << ": " << model.rest_volume / std::pow(model.spacing, 3) << " cells";
    }
}

// Edges of a surface whose ends are in cells that do not hang together near it: by corners, through cells within a
// place of either.
std::size_t seamsOf(const BodyModel& model) {
  const CellLattice& lattice = *model.lattice;
  const CornerUses uses = cornerUses(lattice);
  const auto hangTogether = [&](Index from, Index to) {
    const auto isNear = [&](Index c) {
      for (int k = 0; k < 3; ++k) {
        const auto [low, high] = std::minmax({lattice.cells[from].place[k], lattice.cells[to].place[k]});
        if (lattice.cells[c].place[k] < low - 1 || lattice.cells[c].place[k] > high + 1) return false;
      }
      return true;
    };
    std::vector<Index> reached{from};
    std::set<Index> seen{from};
    for (std::size_t n = 0; n < reached.size(); ++n)
      for (const Index corner : lattice.cells[reached[n]].corners)
        for (Index u = uses.offsets[corner]; u < uses.offsets[corner + 1]; ++u)
          if (isNear(uses.cells[u]) && seen.insert(uses.cells[u]).second) reached.push_back(uses.cells[u]);
    return seen.count(to) > 0;
  };
  std::map<std::pair<Index, Index>, bool> known;
  std::size_t seams = 0;
  for (const Triangle& t : model.surface.triangles)
    for (int k = 0; k < 3; ++k) {
      const Index a = model.binding.cells[t[k]], b = model.binding.cells[t[(k + 1) % 3]];
      if (a >= b) continue;
      const auto [found, is_new] = known.emplace(std::pair(a, b), false);
      if (is_new) found->second = hangTogether(a, b);
      seams += !found->second;
    }
  return seams;
}

// Thin sheets whose samples fall apart, while their surface does not: it would be torn open there.
TEST(CutCells, TissueThatASurfaceEnclosesHangsTogetherAlongIt) {
  for (const std::uint64_t seed : {6, 26})
    for (const PreparedBody& piece : slicesOf(seed, 4120, 0.011))
      EXPECT_EQ(seamsOf(*piece.model), 0u) << seed << ": " << piece.model->mass;
}

void expectRowsAsMadeAnew(const CellLattice& lattice, const Points& rest, const SurfaceBinding& binding) {
  const SurfaceBinding anew = bindToCells(lattice, rest, binding.cells);
  ASSERT_EQ(binding.offsets, anew.offsets);
  ASSERT_EQ(binding.carriers, anew.carriers);
  for (std::size_t k = 0; k < anew.weights.size(); ++k) ASSERT_NEAR(binding.weights[k], anew.weights[k], 1e-12);
}

// Away from the blade vertices keep what they follow; it is what a search would find.
TEST(CutCells, WhatASurfaceFollowsIsAsIfItWereMadeAnew) {
  Random random(7);
  for (int round = 0; round < 6; ++round) {
    SCOPED_TRACE(round);
    const TriangleMesh mesh = round % 4 == 0   ? boxMesh(Vec3(0.2, 0.11, 0.09), 20, 10, 10)
                              : round % 4 == 1 ? sphereMesh(0.1, 0.012)
                                               : *randomOrgan(static_cast<std::uint64_t>(round), round % 3, 0.2, 2000);
    std::vector<PreparedBody> bodies{prepared(filled(mesh, 0.0109, round % 3 != 2))};
    for (int n = 0; n < 4; ++n) {
      std::vector<PreparedBody> next;
      for (PreparedBody& body : bodies) {
        const Vec3 normal = random.unit(), at = solidCentroid(mesh) + random.vector(0.03);
        Blade blade;
        blade.x_axis = normal.unitOrthogonal();
        blade.y_axis = normal.cross(blade.x_axis);
        blade.length = 0.5;
        blade.depth = 0.3;
        blade.origin = at - 0.25 * blade.x_axis;
        std::vector<BodyPiece> pieces;
        if (n % 2) {
          if (Result<CutBody> cut = cutBody(*body.model, body.state, Blade::through({normal, at})); cut.ok())
            pieces = std::move(cut->pieces);
        } else if (Result<CutBody> incised = cutBody(*body.model, body.state, blade); incised.ok()) {
          pieces = std::move(incised->pieces);
        }
        for (BodyPiece& piece : pieces) {
          const BodyModel& model = *piece.model;
          expectRowsAsMadeAnew(*model.lattice, model.surface.vertices, model.binding);
          if (model.collision)
            expectRowsAsMadeAnew(*model.lattice, model.collision->mesh.vertices, model.collision->binding);
          next.push_back({BodyDef(), std::move(piece.model), std::move(piece.state)});
        }
        if (pieces.empty()) next.push_back(std::move(body));
      }
      bodies = std::move(next);
    }
    EXPECT_GT(bodies.size(), 1u);
  }
}

}  // namespace cut_cells_test
}  // namespace meshless
